import array
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from markerless_tracker.camera import CameraModel
from markerless_tracker.node.ros.camera_info import info_of
from markerless_tracker.node.tracker.inputs import PATIENCE_S, CameraInput
from markerless_tracker.node.tracker.status import TrackerStatus
from markerless_tracker.node.tracker.synchronizer import Synchronizer


class Bench:
    def __init__(self, *, calibrated: bool = True) -> None:
        matrix = np.array([[50.0, 0, 4], [0, 50, 2], [0, 0, 1]])
        self.camera = CameraModel("cam02", (8, 4), matrix, np.zeros(5), np.eye(4))
        self.now_s = 10.0
        self.sets: Synchronizer[Any] = Synchronizer(("cam01", "cam02"))
        self.status = TrackerStatus()
        self.reports: list[str] = []
        self.input = CameraInput(
            "cam02",
            self.camera if calibrated else None,
            self.sets,
            self.status,
            report=self.reports.append,
            clock=lambda: self.now_s,
        )

    def refused(self) -> int:
        return int(self.status.values(self.sets.counts, ("cam02",), ())["refused/cam02"])

    def missing(self, *, others_speak: bool = True) -> list[str]:
        silent = "cam02" in self.sets.silent(self.now_s, PATIENCE_S)
        return self.input.missing(silent, others_speak, self.now_s)


def image(width: int = 8, height: int = 4, encoding: str = "mono8", stamp: int = 1) -> Any:
    return SimpleNamespace(
        header=SimpleNamespace(stamp=SimpleNamespace(sec=0, nanosec=stamp)),
        width=width,
        height=height,
        step=width,
        encoding=encoding,
        data=array.array("B", bytes(width * height)),
    )


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_good_images_are_stored_as_they_came(bench: Bench) -> None:
    came = image()
    bench.input.on_image(came)
    bench.sets.add("cam01", 1, None, now_s=0.0)
    matched = bench.sets.take()
    assert matched is not None and matched.views["cam02"] is came
    assert bench.refused() == 0 and not bench.reports


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        (image(encoding="mono16"), "cam02/image_raw.*'mono16'"),
        (image(width=16), "cam02/image_raw.*16x4 px.*cam02.*8x4 px"),
        (image(height=8), "8x8 px"),
        (image(encoding="bgr8"), "cam02/image_raw: 32 bytes"),
    ],
)
def test_bad_images_are_counted_and_reported_once(bench: Bench, bad: Any, says: str) -> None:
    import re

    for _ in range(5):
        bench.input.on_image(bad)
    assert bench.refused() == 5 and bench.sets.held == 0
    assert len(bench.reports) == 1 and re.search(says, bench.reports[0])
    # Good ones go on being used, and the next bad one is news again.
    bench.input.on_image(image())
    bench.input.on_image(bad)
    assert bench.sets.held == 1 and len(bench.reports) == 2


def test_a_camera_info_of_another_size_stops_its_camera_until_they_agree(bench: Bench) -> None:
    wrong, right = info_of(bench.camera.scaled(0.5), 0), info_of(bench.camera, 0)
    for _ in range(3):
        bench.input.on_info(wrong)
        bench.input.on_image(image())
    assert bench.sets.held == 0 and bench.refused() == 3
    assert len(bench.reports) == 1 and "cam02/camera_info" in bench.reports[0]
    assert "4x2" in bench.reports[0] and "8x4" in bench.reports[0]
    bench.input.on_info(right)
    bench.input.on_image(image())
    assert bench.sets.held == 1


@pytest.mark.parametrize("calibrated", [True, False])
def test_a_missing_camera_info_is_named_once_it_is_due(calibrated: bool) -> None:
    bench = Bench(calibrated=calibrated)
    assert bench.missing() == ["cam02/image_raw", "cam02/camera_info"]
    bench.reports.clear()
    bench.input.on_image(image())
    bench.now_s += 0.5 * PATIENCE_S
    assert bench.missing() == ["cam02/camera_info"] and not bench.reports
    bench.now_s += PATIENCE_S
    bench.input.on_image(image(stamp=2))
    for _ in range(3):
        bench.missing()
    assert len(bench.reports) == 1
    said = "using the calibration file" if calibrated else "waiting for it"
    assert "cam02/camera_info" in bench.reports[0] and said in bench.reports[0]
    bench.input.on_info(info_of(bench.camera, 0))
    assert bench.missing() == []


def test_a_silent_camera_is_named_once_while_others_speak(bench: Bench) -> None:
    bench.input.on_info(info_of(bench.camera, 0))
    bench.input.on_image(image())
    assert bench.missing() == []
    bench.now_s += 2 * PATIENCE_S
    assert bench.missing(others_speak=False) == ["cam02/image_raw"] and not bench.reports
    for _ in range(3):
        assert bench.missing() == ["cam02/image_raw"]
    assert len(bench.reports) == 1 and "cam02/image_raw: no usable image" in bench.reports[0]


def test_gaps_in_the_publishers_numbers_are_lost_images(bench: Bench) -> None:
    for number in (5, 6, 9, 10, 2, 3, 10**9, 10**9 + 2):
        bench.input.on_image(image(stamp=number), number)
    values = bench.status.values(bench.sets.counts, ("cam02",), ())
    assert values["lost/cam02"] == "3"
