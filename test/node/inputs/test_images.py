import array
import re
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from rclpy.serialization import serialize_message
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header

from markerless_tracker.camera import CameraModel
from markerless_tracker.node.health import QUIET_S
from markerless_tracker.node.inputs.images import CameraInput
from markerless_tracker.node.ros.camera_info import info_of
from markerless_tracker.node.ros.stamps import time_message
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
        self.channels: int | None = None
        self.input = CameraInput(
            "cam02",
            self.camera if calibrated else None,
            self.sets,
            self.status,
            report=self.reports.append,
            clock=lambda: self.now_s,
            channels=lambda _: self.channels,
        )

    def refused(self) -> int:
        return int(self.status.values(self.sets.counts, ("cam02",), ())["refused/cam02"])

    def missing(self, *, others_send: bool = True, left_out: bool = False) -> list[str]:
        silent = "cam02" in self.sets.silent(self.now_s, QUIET_S)
        return self.input.missing(silent, left_out, others_send, self.now_s)


def image(width: int = 8, height: int = 4, encoding: str = "mono8", stamp: int = 1) -> bytes:
    message = Image(
        header=Header(stamp=time_message(stamp)),
        width=width,
        height=height,
        step=width,
        encoding=encoding,
        data=array.array("B", bytes(width * height)),
    )
    return bytes(serialize_message(message))


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_good_images_are_stored_as_they_came(bench: Bench) -> None:
    came = image()
    bench.input.on_image(came)
    bench.sets.add("cam01", 1, None, now_s=0.0)
    matched = bench.sets.take()
    assert matched is not None
    stored = matched.views["cam02"]
    assert (stored.width, stored.height, stored.stamp_ns) == (8, 4, 1)
    assert np.shares_memory(stored.data, np.frombuffer(came, np.uint8))
    assert bench.refused() == 0 and not bench.reports


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        (image(encoding="mono16"), "cam02/image_raw.*'mono16'"),
        (image(width=16), "cam02/image_raw.*16x4 px.*cam02.*8x4 px"),
        (image(height=8), "8x8 px"),
        (image(encoding="bgr8"), "cam02/image_raw: 32 bytes"),
        (image()[:60], "cam02/image_raw: a message of 60 bytes is cut"),
    ],
    ids=["encoding", "wide", "high", "channels", "cut"],
)
def test_bad_images_are_counted_and_reported_with_every_occurrence(
    bench: Bench, bad: Any, says: str
) -> None:
    for _ in range(5):
        bench.input.on_image(bad)
    assert bench.refused() == 5 and bench.sets.held == 0
    assert all(re.search(says, report) for report in bench.reports) and len(bench.reports) == 5
    assert re.search(says, bench.input.refusal)
    bench.input.on_image(image())
    assert bench.sets.held == 1 and bench.input.refusal == ""


def test_an_image_of_other_channels_than_the_background_is_refused(bench: Bench) -> None:
    bench.channels = 3
    bench.input.on_image(image())
    assert bench.refused() == 1 and bench.sets.held == 0
    assert bench.reports == [
        "cam02/image_raw: a grey image (mono8) came, the background of cam02 is colour"
    ]
    bench.now_s += 2 * QUIET_S
    assert bench.input.refusal == ""
    bench.channels = 1
    bench.input.on_image(image())
    assert bench.sets.held == 1


def test_a_text_from_the_wire_is_cut(bench: Bench) -> None:
    bench.input.on_image(image(encoding="x" * 2000))
    assert "'" + 80 * "x" + "'" in bench.reports[0] and len(bench.reports[0]) < 300


def test_a_camera_info_of_another_size_stops_its_camera_until_they_agree(bench: Bench) -> None:
    wrong, right = info_of(bench.camera.scaled(0.5), 0), info_of(bench.camera, 0)
    for _ in range(3):
        bench.input.on_info(wrong)
        bench.input.on_image(image())
    assert bench.sets.held == 0 and bench.refused() == 3
    assert len(set(bench.reports)) == 1 and "cam02/camera_info" in bench.reports[0]
    assert "4x2" in bench.reports[0] and "8x4" in bench.reports[0]
    bench.input.on_info(right)
    assert bench.reports[-1] == "cam02/camera_info: agrees with the calibration file again"
    bench.input.on_image(image())
    assert bench.sets.held == 1


def test_a_camera_info_with_another_lens_is_reported_once_and_used_no_further(bench: Bench) -> None:
    other = info_of(bench.camera, 0)
    other.k[0] *= 1.05
    for number in range(3):
        bench.input.on_info(other)
        bench.input.on_image(image(stamp=number))
    assert len(bench.reports) == 1 and bench.sets.held == 3
    assert "cam02/camera_info: K is [52.5 " in bench.reports[0]
    assert "the calibration file is used" in bench.reports[0]


@pytest.mark.parametrize("calibrated", [True, False])
def test_a_missing_camera_info_is_named_once_it_is_due(calibrated: bool) -> None:
    bench = Bench(calibrated=calibrated)
    assert bench.missing() == ["cam02/image_raw", "cam02/camera_info"]
    bench.reports.clear()
    bench.input.on_image(image())
    bench.now_s += 0.5 * QUIET_S
    assert bench.missing() == ["cam02/camera_info"] and not bench.reports
    bench.now_s += QUIET_S
    bench.input.on_image(image(stamp=2))
    for _ in range(3):
        bench.missing()
    assert len(bench.reports) == 1
    said = "using the calibration file" if calibrated else "waiting for it"
    assert "cam02/camera_info" in bench.reports[0] and said in bench.reports[0]
    bench.input.on_info(info_of(bench.camera, 0))
    assert bench.missing() == []


def test_a_silent_camera_and_its_return_are_named_once(bench: Bench) -> None:
    bench.input.on_info(info_of(bench.camera, 0))
    bench.input.on_image(image())
    assert bench.missing() == []
    bench.now_s += 2 * QUIET_S
    for changes in ({"others_send": False, "left_out": True}, {"left_out": False}):
        assert bench.missing(**changes) == ["cam02/image_raw"] and not bench.reports
    for _ in range(3):
        assert bench.missing(left_out=True) == ["cam02/image_raw"]
    assert bench.reports == [
        "cam02/image_raw: no usable image for 2 s while other cameras send; cam02 is left out "
        "until one comes"
    ]
    bench.now_s += 10.0
    bench.input.on_image(image(stamp=2))
    assert bench.reports[1:] == ["cam02/image_raw: usable images again after 12.0 s"]


def test_gaps_in_the_publishers_numbers_are_lost_images(bench: Bench) -> None:
    for number in (5, 6, 9, 10, 2, 3, 10**9, 10**9 + 2):
        bench.input.on_image(image(stamp=number), number)
    values = bench.status.values(bench.sets.counts, ("cam02",), ())
    assert values["lost/cam02"] == "3"


def test_numbers_of_two_publishers_are_no_lost_images(bench: Bench) -> None:
    for number in range(10):
        bench.input.on_image(image(stamp=2 * number), 500 + number)
        bench.input.on_image(image(stamp=2 * number + 1), 1 + number)
    values = bench.status.values(bench.sets.counts, ("cam02",), ())
    assert values["lost/cam02"] == "0"


def test_a_camera_info_that_is_cut_is_reported_and_changes_nothing(bench: Bench) -> None:
    good = bytes(serialize_message(info_of(bench.camera, 0)))
    bench.input.on_info_bytes(good)
    for size in (12, 20, len(good) // 2):
        bench.input.on_info_bytes(good[:size])
    assert len(bench.reports) == 3
    assert bench.reports[0].startswith("cam02/camera_info: a message of 12 bytes cannot be read")
    bench.input.on_info_bytes(good)
    bench.input.on_image(image())
    assert bench.refused() == 0


def test_an_unchanged_camera_info_is_decoded_once(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []
    monkeypatch.setattr(bench.input, "on_info", seen.append)
    for stamp in (0, 5 * 10**9, 6):
        bench.input.on_info_bytes(serialize_message(info_of(bench.camera, stamp)))
    assert len(seen) == 1 and seen[0].k[0] == 50.0
    bench.input.on_info_bytes(serialize_message(info_of(bench.camera.scaled(0.5), 7)))
    assert len(seen) == 2 and seen[1].width == 4


def compressed(picture: Any, stamp: int = 1) -> bytes:
    data = cv2.imencode(".png", picture)[1].tobytes()
    return bytes(
        serialize_message(
            CompressedImage(header=Header(stamp=time_message(stamp)), format="png", data=data)
        )
    )


def test_compressed_images_are_checked_before_they_are_decoded(bench: Bench) -> None:
    bench.channels = 1
    bench.input.on_compressed(compressed(np.zeros((4, 8), np.uint8)))
    assert bench.sets.held == 1 and not bench.reports
    bench.input.on_compressed(compressed(np.zeros((4, 9), np.uint8), 2))
    bench.input.on_compressed(compressed(np.zeros((4, 8, 3), np.uint8), 3))
    assert bench.sets.held == 1 and bench.refused() == 2
    assert bench.reports == [
        "cam02/image_raw/compressed: an image of 9x4 px came, the calibration of cam02 expects "
        "8x4 px",
        "cam02/image_raw/compressed: a colour image (png) came, the background of cam02 is grey",
    ]


def test_a_changed_camera_info_is_reported_where_the_first_gave_the_calibration() -> None:
    bench = Bench(calibrated=False)
    first = info_of(bench.camera, 0)
    bench.input.on_info(first)
    bench.input.camera = bench.camera
    bench.input.on_info(first)
    assert not bench.reports
    other = info_of(bench.camera, 0)
    other.k[0] *= 1.05
    bench.input.on_info(other)
    assert bench.reports == [
        "cam02/camera_info: K is [52.5 0 4 0 50 2], the first camera info says [50 0 4 0 50 2]; "
        "the first camera info is used until the tracker is restarted"
    ]
    bench.input.on_info(info_of(bench.camera.scaled(0.5), 0))
    assert "says 4x2 px, the first camera info says 8x4 px; cam02 is left out" in bench.reports[-1]
