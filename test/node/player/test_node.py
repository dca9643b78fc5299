import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from sensor_msgs.msg import CameraInfo, Image

from markerless_tracker.bags import write_bag
from markerless_tracker.camera import CameraRig
from markerless_tracker.datasets import FrameSet, Recording
from markerless_tracker.node.ros.camera_info import camera_of
from markerless_tracker.node.ros.images import decode_image
from markerless_tracker.node.ros.qos import image_qos, latched_qos
from markerless_tracker.node.ros.stamps import stamp_of
from markerless_tracker.synthesis.rig import ring_rig

SETS, FPS = 8, 20.0
FIRST_NS = 1_700_000_000_123_456_789


class Pictures(Recording):
    """A recording of noise: grey in cam02, colour elsewhere."""

    def __init__(self, rig: CameraRig) -> None:
        super().__init__(Path("pictures"), rig, scale=1.0, fps=FPS, frame_count=SETS)

    def picture(self, name: str, index: int) -> np.ndarray:
        width, height = self.rig[name].size_px
        rng = np.random.default_rng([index, int(name[-1])])
        shape = (height, width) if name == "cam02" else (height, width, 3)
        return rng.integers(0, 256, shape, dtype=np.uint8)

    def _read(self, start: int, every: int) -> Iterator[FrameSet]:
        for index in range(start, SETS, every):
            images = {name: self.picture(name, index) for name in self.rig.names}
            yield FrameSet(index, FIRST_NS + round(index * 1e9 / FPS), images)

    def _nearest(self, stamp_ns: int) -> tuple[int, int]:
        raise NotImplementedError


@pytest.fixture(scope="module")
def pictures() -> Pictures:
    return Pictures(ring_rig(3, (40, 30)))


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory, pictures: Pictures) -> Path:
    folder = tmp_path_factory.mktemp("player") / "bag"
    backgrounds = {name: [pictures.picture(name, 99)] for name in pictures.rig.names}
    write_bag(pictures, folder, backgrounds=backgrounds)
    return folder


class Audience:
    """Listens to all topics of a player."""

    def __init__(self, peer: Any, names: tuple[str, ...]) -> None:
        self.images = {n: peer.collect(Image, f"{n}/image_raw", image_qos(depth=50)) for n in names}
        self.infos = {
            n: peer.collect(CameraInfo, f"{n}/camera_info", image_qos(depth=50)) for n in names
        }

    @property
    def heard(self) -> int:
        return min(len(got) for got in self.images.values())


def test_a_bag_arrives_whole_with_its_own_stamps(
    bag: Path, pictures: Pictures, peer: Any, start: Callable[..., Any]
) -> None:
    names = pictures.rig.names
    audience = Audience(peer, names)
    says = peer.node.create_publisher(DiagnosticArray, "state", latched_qos())

    def say(ready: str) -> None:
        values = [KeyValue(key="ready", value=ready)]
        says.publish(DiagnosticArray(status=[DiagnosticStatus(values=values)]))

    say("false")
    player = start("player", bag=bag, rate=2.0, wait_for_subscribers=True)
    alone = "waiting for `state` to say ready"
    peer.until(lambda: alone in player.output, "the player to wait for `state` alone")
    assert audience.heard == 0
    say("true")
    peer.until(lambda: audience.heard >= SETS, "all images")
    peer.until(lambda: not player.running, "the player to end")
    assert player.wait() == 0, player.output
    for name in names:
        images, infos = audience.images[name], audience.infos[name]
        assert len(images) == len(infos) == SETS
        for index, (image, info) in enumerate(zip(images, infos, strict=True)):
            assert stamp_of(image) == stamp_of(info) == FIRST_NS + round(index * 1e9 / FPS)
            assert image.header.frame_id == info.header.frame_id == f"{name}_optical_frame"
            np.testing.assert_array_equal(decode_image(image, name), pictures.picture(name, index))
            camera = camera_of(name, info, pictures.rig[name].T_cam_world, f"{name}/camera_info")
            np.testing.assert_array_equal(camera.matrix, pictures.rig[name].matrix)
    assert f"played {SETS} sets" in player.output


class Trackers:
    """Publishes the `state` of made-up trackers, and deals with sets at once or never."""

    def __init__(self, peer: Any, audience: Audience, **deals: bool) -> None:
        self._says = peer.node.create_publisher(DiagnosticArray, "state", latched_qos())
        self._peer, self._audience, self._deals = peer, audience, deals
        self.most_ahead = 0
        self._dealt: int | None = None
        self.say()
        peer.node.create_timer(0.05, self._tick)

    def say(self) -> None:
        """Publish every tracker's state."""
        status = []
        for name, deals in self._deals.items():
            dealt = "" if self._dealt is None or not deals else str(self._dealt)
            pairs = {"ready": "true", "dealt_with_ns": dealt}
            values = [KeyValue(key=key, value=value) for key, value in pairs.items()]
            status.append(DiagnosticStatus(name=name, values=values))
        self._says.publish(DiagnosticArray(status=status))

    def _tick(self) -> None:
        heard = self._audience.heard
        if heard:
            stamps = [stamp_of(image) for image in self._audience.images["cam01"]]
            ahead = heard - 1 if self._dealt is None else sum(s > self._dealt for s in stamps)
            self.most_ahead = max(self.most_ahead, ahead)
            self._dealt = stamps[heard - 1]
        self.say()


def test_in_lockstep_every_set_waits_for_the_tracker(
    bag: Path, pictures: Pictures, peer: Any, start: Callable[..., Any]
) -> None:
    audience = Audience(peer, pictures.rig.names)
    trackers = Trackers(peer, audience, first=True, second=True)
    # Without lockstep all sets would be sent within a millisecond.
    player = start("player", bag=bag, rate=1000.0, lockstep=True, wait_for_subscribers=True)
    peer.until(lambda: not player.running, "the player to end")
    assert player.wait() == 0, player.output
    assert "in lockstep" in player.output and "WARN" not in player.output
    assert audience.heard == SETS and trackers.most_ahead == 1


def test_in_lockstep_a_tracker_without_an_answer_is_named_and_does_not_stop_the_bag(
    bag: Path, pictures: Pictures, peer: Any, start: Callable[..., Any]
) -> None:
    audience = Audience(peer, pictures.rig.names)
    Trackers(peer, audience, good=True, dumb=False)
    player = start(
        "player", bag=bag, lockstep=True, lockstep_timeout=1.0, wait_for_subscribers=True
    )
    peer.until(lambda: not player.running, "the player to end")
    assert player.wait() == 0, player.output
    assert player.output.count("not dealt with by dumb in 1 s (lockstep_timeout)") == 1
    assert audience.heard == SETS


def test_in_lockstep_without_a_tracker_the_bag_is_played_at_its_pace(
    bag: Path, peer: Any, start: Callable[..., Any]
) -> None:
    player = start("player", bag=bag, lockstep=True)
    peer.until(lambda: not player.running, "the player to end")
    assert player.wait() == 0, player.output
    assert "no tracker's `state` says ready; playing at 1 x 20 fps" in player.output
    assert f"played {SETS} sets" in player.output


@pytest.mark.parametrize("compress", ["zstd", "jpeg"])
def test_compressed_bags(
    compress: str, pictures: Pictures, tmp_path: Path, peer: Any, start: Callable[..., Any]
) -> None:
    names = pictures.rig.names
    backgrounds = {name: [pictures.picture(name, 99)] for name in names}
    write_bag(pictures, tmp_path / "bag", compress=compress, backgrounds=backgrounds)
    audience = Audience(peer, names)
    Trackers(peer, audience, one=True)
    # Images sent before discovery are lost.
    player = start("player", bag=tmp_path / "bag", rate=4.0, wait_for_subscribers=True)
    peer.until(lambda: audience.heard >= SETS, "all images")
    assert player.wait() == 0, player.output
    for name in names:
        for index, image in enumerate(audience.images[name]):
            assert stamp_of(image) == FIRST_NS + round(index * 1e9 / FPS)
            assert image.header.frame_id == f"{name}_optical_frame"
            decoded, truth = decode_image(image, name), pictures.picture(name, index)
            assert decoded.shape == truth.shape
            assert compress == "jpeg" or (decoded == truth).all()


def test_a_loop_begins_anew_until_a_signal_and_an_offset_leaves_sets_out(
    bag: Path, pictures: Pictures, peer: Any, start: Callable[..., Any]
) -> None:
    audience = Audience(peer, pictures.rig.names)
    player = start("player", bag=bag, rate=4, loop=True, start_offset=0.2)
    peer.until(lambda: audience.heard > 3 * SETS, "more than one pass")
    player.signal(signal.SIGTERM)
    peer.until(lambda: not player.running, "the player to end")
    assert player.wait() == 0, player.output
    stamps = [stamp_of(image) for image in audience.images["cam01"]]
    assert set(stamps) == {FIRST_NS + round(i * 1e9 / FPS) for i in range(4, SETS)}
    steps = np.diff(stamps)
    assert (steps < 0).sum() >= 2 and set(steps[steps > 0]) == {50_000_000}


@pytest.mark.parametrize(
    ("parameters", "says"),
    [
        ({"bag": "nowhere"}, "nowhere: no such file"),
        ({"bag": "{tmp}"}, "no bag, expected"),
        ({"bag": "{bag}", "start_offset": 60.0}, "start_offset: bag: ends 0.350 s after"),
        ({"bag": "{bag}", "lopp": True}, "'lopp' is unknown, did you mean 'loop'"),
        ({"bag": "{damaged}"}, "damaged"),
    ],
)
def test_what_cannot_be_played_is_one_line_and_exit_1(
    parameters: dict[str, Any],
    says: str,
    bag: Path,
    tmp_path: Path,
    start: Callable[..., Any],
) -> None:
    damaged = tmp_path / "damaged"
    damaged.mkdir()
    (damaged / "x.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(100))
    places = {"tmp": tmp_path, "bag": bag, "damaged": damaged}
    given = {k: v.format(**places) if isinstance(v, str) else v for k, v in parameters.items()}
    player = start("player", **given)
    assert player.wait() == 1
    lines = [line for line in player.output.splitlines() if line.startswith("player: ")]
    assert len(lines) == 1 and says in lines[0], player.output
    assert "Traceback" not in player.output


def test_a_bag_without_a_cameras_images_is_refused(
    bag: Path, pictures: Pictures, tmp_path: Path, start: Callable[..., Any]
) -> None:
    other = tmp_path / "other"
    rig = CameraRig(tuple(pictures.rig)[:2])
    write_bag(Pictures(rig), other, backgrounds={n: [pictures.picture(n, 99)] for n in rig.names})
    (other / "calibration.toml").write_bytes((bag / "calibration.toml").read_bytes())
    player = start("player", bag=other)
    assert player.wait() == 1
    assert "no images of cam03, expected the topic /cam03/image_raw" in player.output
