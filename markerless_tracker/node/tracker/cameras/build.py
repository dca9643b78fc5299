"""Makes the inputs of all cameras from the settings, and the tracker's views from messages."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from markerless_tracker.camera import CameraRig
from markerless_tracker.errors import ConfigError
from markerless_tracker.imaging import scale_image
from markerless_tracker.node.inputs.evidence import EvidenceInput
from markerless_tracker.node.inputs.images import CameraInput
from markerless_tracker.node.inputs.wire import Evidence, settings_digest, unpack
from markerless_tracker.node.ros.images import decode_received
from markerless_tracker.node.tracker.parameters import NodeSettings
from markerless_tracker.node.tracker.setup import RigSource


def make_inputs(
    settings: NodeSettings,
    source: RigSource,
    sets: Any,
    status: Any,
    *,
    channels: Callable[[str], int | None],
    report: Callable[[str], None],
    clock: Callable[[], float],
) -> list[CameraInput]:
    """The input of each camera, in their order; arguments as for `CameraInput`.

    Raises:
        ConfigError: `evidence_cameras` names an unknown camera.
    """
    unknown = [name for name in settings.evidence_cameras if name not in source.names]
    if unknown:
        raise ConfigError(
            f"evidence_cameras: got {', '.join(unknown)}, expected some of "
            f"{', '.join(source.names)}"
        )
    digest = settings_digest(settings.config)
    made: list[CameraInput] = []
    for name in source.names:
        camera = None if source.rig is None else source.rig[name]
        common: dict[str, Any] = {
            "report": report,
            "clock": clock,
            "info_topic": settings.info_topic,
            "offset_ns": source.offset_ns(name),
        }
        if settings.takes_evidence(name):
            made.append(
                EvidenceInput(
                    name,
                    camera,
                    sets,
                    status,
                    scale=settings.scale,
                    digest=digest,
                    with_edges=settings.config.edge_weight > 0.0,
                    **common,
                )  # fmt: skip
            )
        else:
            made.append(
                CameraInput(
                    name,
                    camera,
                    sets,
                    status,
                    channels=channels,
                    image_topic=settings.image_topic,
                    **common,
                )  # fmt: skip
            )
    return made


def view_reader(scaled: CameraRig, inputs: Sequence[CameraInput]) -> Callable[[str, Any], Any]:
    """A function that makes the tracker's image or observation of a camera's message.

    Args:
        scaled: cameras of the scaled images, which the tracker uses.
        inputs: of all cameras.
    """
    sizes_px = {camera.name: camera.size_px for camera in scaled}
    return partial(_read, sizes_px, {entry.name: entry.image_topic for entry in inputs})


def _read(
    sizes_px: Mapping[str, tuple[int, int]], topics: Mapping[str, str], name: str, message: Any
) -> Any:
    if isinstance(message, Evidence):
        return unpack(name, message)
    return scale_image(decode_received(message, topics[name]), sizes_px[name])
