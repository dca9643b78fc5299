"""`doctor` listens to cameras over the real middleware."""

import array
import json
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from sensor_msgs.msg import CompressedImage, Image

from markerless_tracker.camera import write_calibration
from markerless_tracker.cli.main import main
from markerless_tracker.node.ros.images import fill_image
from markerless_tracker.node.ros.messages import header
from markerless_tracker.node.ros.qos import image_qos
from markerless_tracker.synthesis import SyntheticScene

FPS = 20.0


@pytest.fixture(scope="module")
def scene() -> SyntheticScene:
    return SyntheticScene(size_px=(164, 122), cameras=3, fps=FPS, samples=1, seed=3)


@pytest.fixture
def folder(scene: SyntheticScene, tmp_path: Path) -> Path:
    write_calibration(tmp_path / "calibration.toml", scene.rig)
    (tmp_path / "background").mkdir()
    for name, images in scene.backgrounds(1).items():
        cv2.imwrite(str(tmp_path / "background" / f"{name}.png"), images[0])
    return tmp_path


@pytest.fixture
def sending(scene: SyntheticScene, peer: Any) -> Iterator[None]:
    """cam01 raw, cam02 as PNG of another size; cam03 sends nothing."""
    raw = peer.node.create_publisher(Image, "cam01/image_raw", image_qos())
    packed = peer.node.create_publisher(CompressedImage, "cam02/image_raw/compressed", image_qos())
    images = scene.frame(0)[0]
    small = array.array("B", cv2.imencode(".png", images["cam02"][:100])[1].tobytes())
    first = fill_image(Image(), images["cam01"], "cam01")
    second = CompressedImage(format="png", data=small)
    ended = threading.Event()

    def send() -> None:
        while not ended.wait(1.0 / FPS):
            head = header(time.time_ns())
            first.header = second.header = head
            raw.publish(first)
            packed.publish(second)

    thread = threading.Thread(target=send)
    thread.start()
    yield
    ended.set()
    thread.join()


def test_lines_of_cameras_that_send_and_do_not(
    folder: Path, sending: None, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["doctor", "--calibration", str(folder / "calibration.toml"), "--background",
             str(folder / "background"), "--seconds", "1", "--json"]  # fmt: skip
    assert main(words) == 3
    found = json.loads(capsys.readouterr().out)["findings"]
    by = {(line["check"], line["camera"]): line for line in found}
    assert {"shared memory", "socket buffers", "threads", "ROS", "profile", "calibration"} < {
        check for check, _ in by
    }
    assert by["calibration", ""]["state"] == "green"
    assert by["rate", "cam01"]["state"] != "red" and "images/s" in by["rate", "cam01"]["text"]
    for check in ("stamps", "exposure", "sharpness", "background"):
        assert by[check, "cam01"]["state"] == "green", by[check, "cam01"]
    assert by["background", "cam02"]["state"] == "red"
    assert by["rate", "cam03"]["state"] == "red"
    assert "cam03/image_raw" in by["rate", "cam03"]["text"] and by["rate", "cam03"]["advice"]


def test_without_a_calibration_it_finds_the_cameras_that_send(
    sending: None, capsys: pytest.CaptureFixture[str]
) -> None:
    status = main(["doctor", "--seconds", "0.5"])
    lines = capsys.readouterr().out.splitlines()
    assert any(line.split()[1:3] == ["rate:", "cam01:"] for line in lines)
    assert any(line.split()[1:3] == ["rate:", "cam02:"] for line in lines)
    assert not any("cam03" in line for line in lines)
    assert status == (3 if any(line.startswith("RED") for line in lines) else 0)
    assert lines[-1].startswith("doctor: ")


def test_ctrl_c_ends_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(names: Any, *, stop: Any, **_: Any) -> dict[str, Any]:
        stop.received = True
        return {}

    monkeypatch.setattr("markerless_tracker.node.doctor.listen.listen", interrupted)
    assert main(["doctor", "--cameras", "cam01"]) == 130
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--image-topic", "/rig/NAME/image"], "--image-topic needs the names of the cameras"),
        (["--cameras", "a", "--image-topic", "/image"], "is '/image', expected NAME in it"),
        (["--seconds", "-1"], "--seconds is -1, expected 0 to 3600"),
        (["--seconds", "nan"], "--seconds is nan, expected 0 to 3600"),
        (["--seconds", "0", "--background", "empty"], "--background needs --calibration"),
    ],
)
def test_arguments_that_would_check_nothing_are_refused(
    capsys: pytest.CaptureFixture[str], words: list[str], expected: str
) -> None:
    assert main(["doctor", *words]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert expected in line


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--cameras", "cam-01"], "'NAME/image_raw' of camera 'cam-01' cannot be a topic"),
        (["--cameras", "a", "--image-topic", "/x y/NAME"], "'/x y/NAME' of camera 'a' cannot be"),
    ],
)
def test_names_that_ros_refuses_are_a_red_line(
    capsys: pytest.CaptureFixture[str], words: list[str], expected: str
) -> None:
    assert main(["doctor", *words]) == 3
    lines = capsys.readouterr().out.splitlines()
    (line,) = [line for line in lines if "cameras:" in line]
    assert line.startswith("RED") and expected in line


def test_blanks_after_commas_are_no_part_of_names(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: list[str] = []

    def listened(names: Any, **_: Any) -> dict[str, Any]:
        asked.extend(names)
        return {}

    monkeypatch.setattr("markerless_tracker.node.doctor.listen.listen", listened)
    main(["doctor", "--cameras", "cam01, cam02"])
    assert asked == ["cam01", "cam02"] and "shared memory" in capsys.readouterr().out


@pytest.mark.parametrize("names", [(), ("cam01",)])
def test_a_topic_without_a_camera_name_is_a_yellow_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], names: tuple[str, ...]
) -> None:
    asked: list[str] = []

    def listened(names: Any, **_: Any) -> dict[str, Any]:
        asked.extend(names)
        return {}

    module = "markerless_tracker.node.doctor.listen"
    monkeypatch.setattr(f"{module}.image_topics", lambda stop: ("", *names))
    monkeypatch.setattr(f"{module}.listen", listened)
    main(["doctor", "--json"])
    found = json.loads(capsys.readouterr().out)["findings"]
    (line,) = [line for line in found if line["check"] == "cameras"]
    assert (line["state"], line["camera"], line["advice"]) == (
        "yellow", "", "give the driver a namespace",
    )  # fmt: skip
    assert line["text"] == "/image_raw has no camera name, expected NAME/image_raw"
    assert asked == list(names)


def test_a_domain_that_ros_refuses_is_a_red_line_and_ends_the_check(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "abc")
    assert main(["doctor", "--cameras", "cam01"]) == 3
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith("RED  discovery: ROS_DOMAIN_ID is 'abc'") for line in lines)
    assert not any("cam01" in line for line in lines)


def test_a_calibration_that_cannot_be_read_is_a_red_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "broken.toml").write_text("[cam01")
    status = main(["doctor", "--calibration", str(tmp_path / "broken.toml"), "--seconds", "0"])
    lines = capsys.readouterr().out.splitlines()
    (line,) = [line for line in lines if "calibration:" in line]
    assert status == 3 and line.startswith("RED") and "broken.toml" in line
