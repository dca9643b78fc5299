"""Evidence of segmenters in place of images: inputs, and a graph of real processes."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from rclpy.serialization import serialize_message
from sensor_msgs.msg import CompressedImage

from markerless_tracker.camera import CameraModel
from markerless_tracker.camera.calibration import read_calibration
from markerless_tracker.errors import ConfigError
from markerless_tracker.node.inputs.evidence import EvidenceInput
from markerless_tracker.node.inputs.wire import (
    Evidence,
    edges_data,
    settings_digest,
    silhouette_data,
)
from markerless_tracker.node.ros.messages import header
from markerless_tracker.node.tracker.cameras.build import make_inputs
from markerless_tracker.node.tracker.parameters import read_settings
from markerless_tracker.node.tracker.setup import RigSource, build
from markerless_tracker.node.tracker.status import TrackerStatus
from markerless_tracker.node.tracker.synchronizer import Synchronizer
from markerless_tracker.records import Observation, TrackState
from markerless_tracker.tracking import TrackerConfig

DIGEST = settings_digest(TrackerConfig.from_mapping({}))


class Bench:
    """The input of a camera of 16x8 px whose images are halved."""

    def __init__(self, *, with_edges: bool) -> None:
        matrix = np.array([[50.0, 0, 8], [0, 50, 4], [0, 0, 1]])
        camera = CameraModel("cam01", (16, 8), matrix, np.zeros(5), np.eye(4))
        self.sets: Synchronizer[Any] = Synchronizer(("cam01",))
        self.status = TrackerStatus()
        self.reports: list[str] = []
        self.input = EvidenceInput(
            "cam01", camera, self.sets, self.status, scale=0.5, digest=DIGEST,
            with_edges=with_edges, report=self.reports.append, clock=lambda: 1.0,
        )  # fmt: skip

    def silhouette(self, stamp_ns: int, **other: Any) -> None:
        self.input.on_silhouette(sent(silhouette_data, stamp_ns, **other))

    def edges(self, stamp_ns: int) -> None:
        self.input.on_edges(sent(edges_data, stamp_ns))


def sent(
    write: Any, stamp_ns: int, size_px: tuple[int, int] = (8, 4), digest: bytes = DIGEST
) -> bytes:
    width, height = size_px
    mask = np.eye(height, width)
    seen = Observation.from_mask("cam01", stamp_ns, mask, np.uint8(mask))
    message = CompressedImage(header=header(stamp_ns))
    message.data = list(write(seen, digest))
    return bytes(serialize_message(message))


def test_silhouette_and_edges_of_one_image_are_one_view() -> None:
    bench = Bench(with_edges=True)
    bench.silhouette(1)
    bench.edges(2)
    bench.silhouette(3)
    assert bench.sets.take() is None
    bench.edges(3)
    taken = bench.sets.take()
    assert taken is not None and taken.stamp_ns == 3
    view = taken.views["cam01"]
    assert isinstance(view, Evidence) and view.edges is not None and view.edges.stamp_ns == 3
    for stamp_ns in range(4, 100):
        bench.silhouette(stamp_ns)
    assert len(bench.input._held) < 20 and bench.sets.take() is None
    assert bench.reports[0].startswith("cam01/edges: no message with the stamp 1 of")
    assert bench.reports[1].startswith("cam01/silhouette: no message with the stamp 2 of")


def test_silhouettes_without_their_edges_are_refused_with_the_reason() -> None:
    bench = Bench(with_edges=True)
    for stamp_ns in range(40):
        bench.silhouette(stamp_ns)
    assert bench.sets.take() is None
    expected = "cam01/edges: no message with the stamp 31 of cam01/silhouette: has the segmenter"
    assert bench.input.refusal.startswith(expected) and "`edge_weight`" in bench.input.refusal
    assert bench.status._refused["cam01"] == 32


def test_silhouettes_alone_where_edges_are_not_used() -> None:
    bench = Bench(with_edges=False)
    bench.silhouette(1)
    taken = bench.sets.take()
    assert taken is not None and taken.views["cam01"].edges is None
    assert bench.input.edges_topic is None and not bench.reports


def test_evidence_of_another_size_is_refused_and_of_other_settings_reported() -> None:
    bench = Bench(with_edges=False)
    bench.silhouette(1, size_px=(16, 8))
    assert bench.sets.take() is None
    (line,) = bench.reports
    assert line.startswith("cam01/silhouette: evidence of 16x8 px came") and "8x4" in line
    for stamp_ns in (2, 3):
        bench.silhouette(stamp_ns, digest=b"8 others")
        assert bench.sets.take() is not None
    assert len(bench.reports) == 2 and "other settings" in bench.reports[1]


def test_edges_on_the_topic_of_silhouettes_are_refused() -> None:
    bench = Bench(with_edges=True)
    bench.input.on_silhouette(sent(edges_data, 1))
    assert "cam01/silhouette: evidence of kind b'e', expected b's'" in bench.reports


@pytest.fixture
def inputs_of(world: Any) -> Any:
    def made(**given: Any) -> dict[str, Any]:
        files = {name: str(value) for name, value in world.parameters().items()}
        settings = read_settings({**files, **given})
        found = make_inputs(
            settings, RigSource(settings), None, None,
            channels=lambda _: 3, report=print, clock=lambda: 0.0,
        )  # fmt: skip
        return {entry.name: entry for entry in found}

    return made


def test_which_cameras_send_evidence(inputs_of: Any) -> None:
    def topics(**given: Any) -> dict[str, str]:
        return {name: entry.image_topic for name, entry in inputs_of(**given).items()}

    names = list(topics())
    assert topics() == {name: f"{name}/image_raw" for name in names}
    assert topics(image_transport="evidence") == {name: f"{name}/silhouette" for name in names}
    mixed = topics(evidence_cameras=["cam02"])
    assert [n for n, topic in mixed.items() if topic.endswith("silhouette")] == ["cam02"]
    assert inputs_of(image_transport="evidence", edge_weight=1.0)["cam03"].edges_topic == (
        "cam03/edges"
    )
    with pytest.raises(ConfigError, match=r"evidence_cameras: got cam07, expected some of cam01"):
        inputs_of(evidence_cameras=["cam07"])


def test_no_background_is_needed_of_cameras_that_send_evidence(world: Any) -> None:
    given = {name: str(value) for name, value in world.parameters().items()}
    del given["background_dir"]
    settings = read_settings({**given, "image_transport": "evidence"})
    rig = read_calibration(given["calibration_file"])
    tracker = build(settings, rig, rig).tracker
    assert all(tracker.segmenter(name) is None for name in rig.names)
    with pytest.raises(ConfigError, match="background_dir: not given"):
        build(read_settings({**given, "evidence_cameras": ["cam02"]}), rig, rig)


def test_a_mixed_graph_gives_the_poses_of_images(
    world: Any, begin: Any, start: Any, tmp_path: Path
) -> None:
    """One camera's edges and silhouettes come from a process beside it, the others' as images."""
    shared = {"edge_weight": 0.5, "evaluations": 250, "body": "balan31"}
    process = start(
        "segmenter", camera="cam02", background_dir=world.folder / "background", **shared
    )
    only = tmp_path / "background"
    only.mkdir()
    for name in ("cam01", "cam03", "cam04"):
        (only / name).symlink_to(world.folder / "background" / name)
    live = begin(background_dir=only, evidence_cameras="[cam02]", threads=0, **shared)

    def counted() -> dict[str, str]:
        said = [s for m in live.diagnostics for s in m.status]
        found = [s for s in said if s.name == "segmenter: segmenting"]
        return {pair.key: pair.value for pair in found[-1].values} if found else {}

    # Evidence that is sent before its subscriber is known is lost, and the first set with it.
    live.until(lambda: counted().get("subscribers") == "1", "the tracker's subscriptions")
    given = {name: str(value) for name, value in world.parameters().items()}
    settings = read_settings({**given, **shared})
    rig = read_calibration(given["calibration_file"])
    tracker = build(settings, rig, rig).tracker
    for _ in range(4):
        index = live.track()
        expected = tracker.step(world.scene.frame(index)[0], world.scene.stamp_ns(index))
        assert expected.state is TrackState.TRACKING
        assert live.points().tobytes() == expected.markers_m.tobytes()
    assert live.value("matched/cam02") == "4" and live.value("refused/cam02") == "0"
    assert float(live.value("exposure/cam02")) == pytest.approx(
        np.mean(expected.exposure["cam02"]), abs=1e-3
    )

    values = live.until(lambda: counted().get("published") == "4" and counted(), "the segmenter")
    assert values["camera"] == "cam02" and values["dropped"] == values["refused"] == "0"
    assert int(values["bytes_in"]) == 4 * 328 * 245 * 3
    assert int(values["bytes_out"]) < 0.06 * int(values["bytes_in"])
    process.stop()
    assert process.wait() == 0
    assert "cam02/image_raw to cam02/silhouette and cam02/edges" in process.output
