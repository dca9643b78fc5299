"""Images and camera infos that cannot be used, over the real middleware."""

from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

import cv2
import numpy as np
from sensor_msgs.msg import Image

from markerless_tracker.node.ros.camera_info import info_of
from markerless_tracker.node.ros.images import fill_image
from markerless_tracker.node.ros.messages import header


def bad_image(encoding: str, width: int, height: int, stamp_ns: int = 0) -> Image:
    message = Image(header=header(stamp_ns, "x"), encoding=encoding, width=width, height=height)
    message.step = width * 3
    message.data = bytes(message.step * height)
    return message


def grey(live: Any, name: str) -> Any:
    """Makes one camera's images grey."""

    def make(index: int) -> Image:
        scene = live.camera.scene
        picture = scene.frame(index)[0][name].mean(axis=2).astype(np.uint8)
        return fill_image(Image(header=header(scene.stamp_ns(index), name)), picture, name)

    return make


def test_a_missing_camera_info_is_named_and_does_not_stop_it(live: Any) -> None:
    live.track()
    live.until(lambda: "cam03/camera_info: no camera info" in live.process.output, "the line")
    assert "cam03/camera_info" in live.value("missing")
    assert live.process.output.count("cam03/camera_info") == 1
    live.camera.send_infos()
    live.until(lambda: "camera_info" not in live.value("missing"), "nothing to be missing")


@pytest.mark.parametrize(
    ("encoding", "width", "height", "says"),
    [
        ("mono16", 328, 245, "cam02/image_raw: image encoding 'mono16' is not known"),
        ("bgr8", 164, 122, "cam02/image_raw: an image of 164x122 px came"),
    ],
)
def test_a_bad_image_costs_its_set_only(
    live: Any, encoding: str, width: int, height: int, says: str
) -> None:
    live.track()
    refused, tracked = int(live.value("refused/cam02")), int(live.value("tracked"))
    live.send_without_pose(cam02=bad_image(encoding, width, height))
    live.until(lambda: int(live.value("refused/cam02")) == refused + 1, "the refusal")
    assert live.value("last_error").startswith(says)
    assert live.process.output.count(says) == 1
    live.track()
    live.until(lambda: int(live.value("tracked")) == tracked + 1, "the next set")
    assert live.value("state") == "TRACKING"


def test_a_camera_of_another_encoding_is_left_out_and_the_others_go_on(live: Any) -> None:
    says = "tracking without cam02: cam02/image_raw: a grey image"
    silent = "cam02/image_raw: no usable image for 2 s while other cameras send"
    live.track()
    images = grey(live, "cam02")
    live.send_until(lambda: silent in live.process.output, "the line", cam02=images)
    for _ in range(2):
        live.send_until(lambda: says in live.message, "tracking without cam02", cam02=images)
        assert live.level == 1 and live.value("iou/cam02") == "nan"
        live.send_until(lambda: live.value("iou/cam02") != "nan", "cam02 again")
    assert "the background of cam02 is colour" in live.process.output
    assert "cam02/image_raw: usable images again" in live.process.output


def test_a_camera_info_of_another_size_stops_its_camera_until_it_is_right(live: Any) -> None:
    live.track()
    rig = live.world.scene.rig
    live.camera.infos["cam01"].publish(info_of(rig["cam01"].scaled(0.5), 0))
    live.until(lambda: "cam01/camera_info: says 164x122" in live.value("last_error"), "the error")
    refused = int(live.value("refused/cam01"))
    live.send_without_pose()
    live.until(lambda: int(live.value("refused/cam01")) > refused, "the refusal")
    live.camera.infos["cam01"].publish(info_of(rig["cam01"], 0))
    # The topics are apart: images may overtake the camera info.
    again = "cam01/camera_info: agrees with the calibration file again"
    live.send_until(lambda: again in live.process.output, "the camera info's acceptance")
    live.send_until(lambda: live.value("iou/cam01") != "nan", "cam01 again")


def test_a_camera_info_with_another_lens_is_reported(live: Any) -> None:
    live.track()
    info = info_of(live.world.scene.rig["cam04"], 0)
    info.k[0] *= 1.05
    live.camera.infos["cam04"].publish(info)
    live.until(lambda: "cam04/camera_info: K is [" in live.process.output, "the difference")
    live.track()
    assert live.value("state") == "TRACKING" and live.value("iou/cam04") != "nan"


def test_of_sets_that_come_too_fast_the_newest_is_tracked(live: Any) -> None:
    live.track()
    before = {key: int(live.value(key)) for key in ("tracked", "skipped")}
    sets = 20
    for _ in range(sets):
        live.send_without_pose()
        live.peer.executor.spin_once(timeout_sec=0.01)
    # A set of which the middleware lost an image cannot be tracked.
    live.track()
    tracked, skipped = (int(live.value(key)) - before[key] for key in before)
    assert 0 < tracked and tracked + skipped <= sets + 1
    lost = sum(int(live.value(f"lost/{name}")) for name in live.camera.names)
    assert tracked + skipped == sets + 1 or lost > 0


def test_a_camera_that_stops_is_named_and_its_return_too(live: Any) -> None:
    live.track()
    live.send_until(
        lambda: "tracking without cam03" in live.message, "tracking without cam03", cam03=None
    )
    live.until(
        lambda: (
            "cam03/image_raw: no usable image for 2 s while other cameras send; cam03 is left "
            "out" in live.process.output
        ),
        "the line",
    )
    assert "cam03: left out, no image" in live.process.output
    live.send_until(lambda: live.value("iou/cam03") != "nan", "cam03 again")
    live.until(lambda: "cam03/image_raw: usable images again" in live.process.output, "its return")


def test_duplicates_and_late_sets_are_dropped_and_counted(live: Any) -> None:
    index = live.track()
    before = {key: int(live.value(key)) for key in ("tracked", "late", "duplicates", "restarts")}
    counted = ("received", "matched", "late", "dropped")
    views = {what: int(live.value(f"{what}/cam02")) for what in counted}
    live.camera.send(index)
    live.until(lambda: int(live.value("duplicates")) == before["duplicates"] + 4, "duplicates")
    scene = live.camera.scene
    live.next += 10
    for pair in range(3):
        newer, older = live.next + 2 * pair + 1, live.next + 2 * pair
        live.track_at(newer, scene.stamp_ns(newer))
        live.camera.send(older)
        late = before["late"] + pair + 1
        live.until(lambda late=late: int(live.value("late")) == late, "a late set")
    live.next += 6
    live.track()
    assert int(live.value("tracked")) == before["tracked"] + 4
    assert int(live.value("restarts")) == before["restarts"]
    after = {what: int(live.value(f"{what}/cam02")) for what in views}
    changes = {what: after[what] - views[what] for what in views}
    assert changes == {"received": 8, "matched": 4, "late": 3, "dropped": 1}
    assert float(live.value("offset_ms/cam02")) == 0.0


def test_without_images_the_state_is_stale_and_says_why(live: Any) -> None:
    live.track()
    live.until(lambda: live.level == 3, "STALE")
    assert live.message == "TRACKING: no image from any camera"
    live.until(lambda: live.value("fps") == "0.00", "the rate to fall")
    assert live.diagnostics[-1].status[0].name == "tracker: tracking"
    assert "no image from any camera" in live.process.output
    live.track()
    live.until(lambda: live.level == 0, "OK again")


def test_stamps_that_differ_are_named_with_the_parameter(live: Any) -> None:
    live.track()

    def late(index: int) -> Image:
        return live.camera.message("cam04", index, live.camera.scene.stamp_ns(index) + 2_000_000)

    says = "stamps differ, cam04 by +2 ms; sync_tolerance is 0 s"
    live.send_until(lambda: says in live.message, "the spread", cam04=late)
    assert live.level == 1 and says in live.process.output
    live.send_until(lambda: live.level == 0, "OK again")


def test_compressed_images_on_other_topics_are_tracked(begin: Any) -> None:
    live = begin(
        camera={"compressed": True, "image_topic": "/rig/NAME"},
        image_topic="/rig/NAME",
        stamp_offsets="[0.0, 0.004, 0.0, 0.0]",
    )
    live.next = 1
    late = live.camera.message("cam02", 1, live.camera.scene.stamp_ns(1) + 4_000_000)
    live.track(cam02=late)
    assert float(live.value("fitness")) > 0.9
    assert "/rig/cam01: compressed images are received" in live.process.output
    says = "/rig/cam02/compressed: an image of 164x122 px came, the calibration of cam02 expects"
    message = live.camera.message("cam02", live.next, live.camera.scene.stamp_ns(live.next))
    small = cv2.imencode(".jpg", np.zeros((122, 164, 3), np.uint8))[1].tobytes()
    message.data = small
    live.send_without_pose(cam02=message)
    # Camera infos that are missing are the later error.
    live.until(lambda: live.value("refused/cam02") == "1", "the refusal")
    live.until(lambda: says in live.process.output, "the line")
    stamp_ns = live.camera.scene.stamp_ns(live.next) + 4_000_000
    live.track(cam02=live.camera.message("cam02", live.next, stamp_ns))
    assert live.value("state") == "TRACKING"
