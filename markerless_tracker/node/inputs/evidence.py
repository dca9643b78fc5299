"""Receives a segmenter's evidence of one camera; silhouettes and edge maps are paired by stamp."""

from typing import Any

from markerless_tracker.camera import CameraModel
from markerless_tracker.errors import ImageError
from markerless_tracker.node.inputs.images import CameraInput
from markerless_tracker.node.inputs.wire import (
    EDGES,
    EDGES_TOPIC,
    SILHOUETTE,
    SILHOUETTE_TOPIC,
    Evidence,
    EvidenceMessage,
    read_evidence,
)

_HELD = 8
"""Largest number of silhouettes or edge maps that wait for their counterpart."""


class EvidenceInput(CameraInput):
    """Receives one camera's evidence instead of images, and its camera infos.

    Args:
        name, camera, sets, status: as for `CameraInput`; `sets` gets `Evidence`.
        scale: factor by which images are made smaller before they are segmented.
        digest: of the tracker's own imaging settings.
        with_edges: whether edge maps are used.
        others: as for `CameraInput`.

    Attributes:
        edges_topic: of the camera; None if edge maps are not used.
    """

    _what = "evidence"

    def __init__(
        self,
        name: str,
        camera: CameraModel | None,
        sets: Any,
        status: Any,
        *,
        scale: float,
        digest: bytes,
        with_edges: bool,
        **others: Any,
    ) -> None:
        super().__init__(name, camera, sets, status, image_topic=SILHOUETTE_TOPIC, **others)
        self.edges_topic = EDGES_TOPIC.replace("NAME", name) if with_edges else None
        self._scale, self._digest = scale, digest
        self._differs = False
        self._held: dict[int, dict[bytes, EvidenceMessage]] = {}

    def on_silhouette(self, serialised: bytes, sequence: int | None = None) -> None:
        """Store a message of ``NAME/silhouette``; as `on_image`."""
        self._take(serialised, sequence, read_evidence, self.image_topic)

    def on_edges(self, serialised: bytes) -> None:
        """Store a message of ``NAME/edges``."""
        assert self.edges_topic is not None
        self._take(serialised, self._sequence, read_evidence, self.edges_topic)

    def _store(self, message: EvidenceMessage, now_s: float) -> None:
        if self.edges_topic is None:
            super()._store(Evidence(message, None), now_s)
            return
        pair = self._held.setdefault(message.stamp_ns, {})
        pair[message.kind] = message
        if len(pair) == 2:
            del self._held[message.stamp_ns]
            super()._store(Evidence(pair[SILHOUETTE], pair[EDGES]), now_s)
        elif len(self._held) > _HELD:
            stamp_ns = next(iter(self._held))
            came, missing = self.image_topic, self.edges_topic
            if EDGES in self._held.pop(stamp_ns):
                came, missing = self.edges_topic, self.image_topic
            self._refuse(
                f"{missing}: no message with the stamp {stamp_ns} of {came}: has the segmenter the "
                "same `edge_weight` as this node?",
                now_s,
            )

    def _expected_size_px(self, camera: CameraModel) -> tuple[int, int]:
        return camera.scaled(self._scale).size_px

    def _check_kind(self, message: Any, topic: str) -> None:
        expected = EDGES if topic == self.edges_topic else SILHOUETTE
        if message.kind != expected:
            raise ImageError(f"{topic}: evidence of kind {message.kind!r}, expected {expected!r}")
        if message.digest != self._digest and not self._differs:
            self._report(
                f"{topic}: the evidence is made with other settings of the imaging than this "
                "node's; results differ from those of images"
            )
        self._differs = message.digest != self._digest
