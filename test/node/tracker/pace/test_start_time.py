import pytest

from markerless_tracker.node.tracker.pace.start_time import StartTimeGate

FRAME_NS = 16_666_667


@pytest.mark.parametrize(
    ("start_ns", "stamps", "admitted"),
    [
        (None, [5, 6], [True, True]),
        (16_666_667, [0, FRAME_NS, 2 * FRAME_NS], [False, True, True]),
        (17_000_000, [0, FRAME_NS], [False, True]),
        (16_666_667, [10**18], [True]),
        (FRAME_NS // 2, [0, 4_166_667, 8_333_333], [False, False, True]),
    ],
)
def test_start_time(start_ns: int | None, stamps: list[int], admitted: list[bool]) -> None:
    gate = StartTimeGate(start_ns)
    assert [gate.admits(stamp) for stamp in stamps] == admitted
