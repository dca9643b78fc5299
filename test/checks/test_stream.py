"""Checks of cameras that are sending: each fault is told by its own line."""

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from markerless_tracker.checks.stream import CameraStream, check_streams
from markerless_tracker.synthesis import SyntheticScene

PERIOD_NS = 33_333_333
COUNT = 60


@pytest.fixture(scope="module")
def scene() -> SyntheticScene:
    return SyntheticScene(size_px=(328, 245), cameras=2, fps=5.0, samples=1, seed=3)


@pytest.fixture(scope="module")
def pictures(scene: SyntheticScene) -> dict[str, list[Any]]:
    frames = [scene.frame(index)[0] for index in range(6)]
    return {name: [frame[name] for frame in frames] for name in scene.rig.names}


@pytest.fixture(scope="module")
def empty(scene: SyntheticScene) -> dict[str, Any]:
    return {name: images[0] for name, images in scene.backgrounds(1).items()}


@pytest.fixture
def streams(pictures: dict[str, list[Any]]) -> dict[str, CameraStream]:
    stamps = [10**18 + PERIOD_NS * i for i in range(COUNT)]
    arrivals = [5.0 + PERIOD_NS * i / 1e9 for i in range(COUNT)]
    return {
        name: CameraStream(f"{name}/image_raw", stamps, arrivals, [0.005] * COUNT, images)
        for name, images in pictures.items()
    }


def lines(streams: dict[str, CameraStream], empty: dict[str, Any]) -> dict[tuple[str, str], Any]:
    found = check_streams(streams, empty, listened_s=2.0)
    assert all(line.state == "green" or line.advice for line in found)
    return {(line.check, line.camera): line for line in found}


def states(found: dict[tuple[str, str], Any]) -> dict[tuple[str, str], str]:
    """Those that are not green."""
    return {key: line.state for key, line in found.items() if line.state != "green"}


def test_good_cameras_are_green(streams: Any, empty: Any) -> None:
    found = lines(streams, empty)
    assert states(found) == {}
    assert {check for check, camera in found if camera == "cam02"} == {
        "rate", "jitter", "stamps", "exposure", "sharpness", "background", "in step"
    }  # fmt: skip
    assert found["rate", "cam01"].text == "30.0 images/s, 30.0 by their stamps"


def test_no_image_and_unusable_images(streams: Any, empty: Any) -> None:
    none = CameraStream("cam02/image_raw", [], [], [], [], 7, "cam02: an encoding")
    found = lines({**streams, "cam02": none}, empty)
    assert states(found) == {("rate", "cam02"): "red", ("images", "cam02"): "red"}
    assert "cam02/image_raw" in found["rate", "cam02"].text
    assert "7 unusable: cam02: an encoding" in found["images", "cam02"].text


@pytest.mark.parametrize(
    "changes, expected",
    [
        ({"ages_s": [0.4] * COUNT}, {("stamps", "cam02"): "yellow"}),
        ({"ages_s": [-0.5] * COUNT}, {("stamps", "cam02"): "red"}),
        ({"ages_s": [1e8] * COUNT}, {}),
        (
            {"arrivals_s": [5.0 + 0.033333333 * i + 0.05 * (i % 2) for i in range(COUNT)]},
            {("jitter", "cam02"): "red"},
        ),
        (
            {"arrivals_s": [5.0 + 0.04 * i for i in range(COUNT)]},
            {("rate", "cam02"): "yellow"},
        ),
    ],
)  # fmt: skip
def test_times(streams: Any, empty: Any, changes: Any, expected: Any) -> None:
    found = states(lines({**streams, "cam02": replace(streams["cam02"], **changes)}, empty))
    assert found == expected


def test_repeated_stamps(streams: Any, empty: Any) -> None:
    changed = replace(streams["cam02"], stamps_ns=[10**18] * COUNT)
    found = lines({**streams, "cam02": changed}, empty)
    assert found["jitter", "cam02"].state == "red"


@pytest.mark.parametrize("off_ns, state", [(2_000_000, "yellow"), (16_700_000, "red")])
def test_stamps_of_one_camera_are_off(streams: Any, empty: Any, off_ns: int, state: str) -> None:
    stamps = [stamp + off_ns for stamp in streams["cam02"].stamps_ns]
    found = lines({**streams, "cam02": replace(streams["cam02"], stamps_ns=stamps)}, empty)
    assert states(found) == {("in step", "cam02"): state}
    if state == "yellow":
        assert "sync_tolerance:=0.0024" in found["in step", "cam02"].advice


@pytest.mark.parametrize(
    "camera, lost", [("cam01", 0), ("cam01", 30), ("cam02", 59), ("cam02", 30)]
)
def test_a_lost_image_is_no_offset(streams: Any, empty: Any, camera: str, lost: int) -> None:
    """The stamp without a counterpart would ask for a tolerance of a whole period."""

    def without(values: Any) -> Any:
        return [value for index, value in enumerate(values) if index != lost]

    stream = streams[camera]
    changed = replace(
        stream, stamps_ns=without(stream.stamps_ns), arrivals_s=without(stream.arrivals_s),
        ages_s=without(stream.ages_s),
    )  # fmt: skip
    found = lines({**streams, camera: changed}, empty)
    assert found["in step", "cam02"].state == "green"


def test_an_offset_is_told_without_a_lost_image(streams: Any, empty: Any) -> None:
    stamps = [stamp + 2_000_000 for stamp in streams["cam02"].stamps_ns]
    first = streams["cam01"]
    lost = replace(first, stamps_ns=[*first.stamps_ns[:30], *first.stamps_ns[31:]],
                   arrivals_s=first.arrivals_s[1:], ages_s=first.ages_s[1:])  # fmt: skip
    found = lines({"cam01": lost, "cam02": replace(streams["cam02"], stamps_ns=stamps)}, empty)
    assert "sync_tolerance:=0.0024" in found["in step", "cam02"].advice


def test_pictures(streams: Any, empty: Any) -> None:
    def of(change: Any) -> dict[tuple[str, str], str]:
        stream = streams["cam02"]
        changed = replace(stream, images=[change(image) for image in stream.images])
        return states(lines({**streams, "cam02": changed}, empty))

    assert of(lambda image: cv2.GaussianBlur(image, (0, 0), 4.0))["sharpness", "cam02"] == "red"
    assert of(lambda image: np.uint8(image * 0.05))["exposure", "cam02"] == "red"
    assert of(lambda image: np.uint8(np.clip(image * 3.0, 0, 255)))["exposure", "cam02"] == "red"
    assert of(lambda image: np.roll(image, 6, axis=1))["background", "cam02"] == "red"
    assert of(lambda image: image[:200])["background", "cam02"] == "red"
