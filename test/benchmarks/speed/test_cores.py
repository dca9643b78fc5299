"""The speed of one core, and of all at once. No time is tested."""

import pytest

from markerless_tracker.benchmarks.speed import cores
from markerless_tracker.benchmarks.speed.cores import CoreSpeed, core_meter


@pytest.mark.parametrize("count", [1, 3])
def test_the_cores_are_measured_again_and_again(count, monkeypatch) -> None:
    # With more processes than cores, too, each takes one task.
    monkeypatch.setattr(cores, "usable_cores", lambda: count)
    with core_meter() as measure:
        for speed in (measure(), measure()):
            assert speed.reference_us > 0.0
            assert speed.at_once > 0.0


def test_what_all_do_is_a_multiple_of_what_one_does() -> None:
    speed = CoreSpeed.of_rates(5000.0, [4000.0, 4500.0])
    assert (speed.reference_us, speed.at_once) == pytest.approx((200.0, 1.7))
