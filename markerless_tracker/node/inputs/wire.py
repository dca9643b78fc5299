"""Evidence as sensor_msgs/CompressedImage: the packed words of `Observation`, compressed by zlib.

`data` of both topics, little endian:

| bytes | |
|---|---|
| 4 | `MTE1` |
| 1 | `s`: silhouette and undecided pixels, `e`: edge map |
| 1 | n, channels of the exposure |
| 8 | digest of the settings of the imaging |
| 6 x 4 | width and height of the frame; left, top, width and height of the region, px |
| n x 8 | exposure: brightness of the image relative to its background's, by channel |
| rest | zlib: words of the person, then of the undecided pixels (`pack_mask`); or the edge map |
"""

import hashlib
import struct
import zlib
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging import ImagingSettings
from markerless_tracker.node.ros.cdr import compressed_fields
from markerless_tracker.observation import Observation, no_edges

SILHOUETTE_TOPIC, EDGES_TOPIC = "NAME/silhouette", "NAME/edges"
"""Topics of a camera's evidence; NAME stands for the camera."""
FORMAT = "markerless_tracker evidence; zlib"
"""`format` of the messages."""
SILHOUETTE, EDGES = b"s", b"e"

_MAGIC = b"MTE1"
_HEAD = struct.Struct("<4scB8s6I")
_SIDE_MAX = 32768
_CHANNELS_MAX = 4
_LEVEL = 1
"""Masks are mostly runs: higher levels of zlib save a twentieth and take twice the time."""


@dataclass(frozen=True, eq=False)
class EvidenceMessage:
    """One message of evidence, still compressed.

    Attributes:
        stamp_ns: time of the image, ns.
        frame_id: frame of the header.
        kind: `SILHOUETTE` or `EDGES`.
        width, height: of the full frame, px.
        box: left, top, width and height of the region, px.
        exposure: see `Observation`.
        digest: of the imaging settings that it was made with.
        data: compressed words or edge map.
        topic: of the message, for error messages.
    """

    stamp_ns: int
    frame_id: str
    kind: bytes
    width: int
    height: int
    box: tuple[int, int, int, int]
    exposure: tuple[float, ...]
    digest: bytes
    data: bytes
    topic: str


class Evidence(NamedTuple):
    """A silhouette and, where edges are used, the edge map of the same image."""

    silhouette: EvidenceMessage
    edges: EvidenceMessage | None

    @property
    def stamp_ns(self) -> int:
        """Time of the image, ns."""
        return self.silhouette.stamp_ns


def settings_digest(settings: ImagingSettings) -> bytes:
    """Digest (8 bytes) of all settings that change the evidence."""
    names = {setting.name for setting in ImagingSettings.settings()}
    chosen = {name: value for name, value in settings.by_name().items() if name in names}
    return hashlib.sha256(repr(sorted(chosen.items())).encode()).digest()[:8]


def silhouette_data(observation: Observation, digest: bytes) -> bytes:
    """`data` of a message with an observation's person and undecided pixels."""
    undecided = observation.undecided_words
    if undecided is None:
        undecided = np.zeros_like(observation.mask_words)
    words = (observation.mask_words, undecided)
    plain = b"".join(part.astype("<u8", copy=False).tobytes() for part in words)
    return _data(SILHOUETTE, observation, digest, plain)


def edges_data(observation: Observation, digest: bytes) -> bytes:
    """`data` of a message with an observation's edge map."""
    return _data(EDGES, observation, digest, observation.edges.tobytes())


def read_evidence(serialised: bytes, topic: str) -> EvidenceMessage:
    """The evidence of a serialised message, checked except for its compressed part.

    Raises:
        ImageError: the message is no evidence, or inconsistent; names the topic.
    """
    stamp_ns, frame_id, kind, data = compressed_fields(serialised, topic)
    raw = data.tobytes()
    if len(raw) < _HEAD.size or raw[: len(_MAGIC)] != _MAGIC:
        raise ImageError(
            f"{topic}: {len(raw)} bytes of format {kind[:80]!r}, expected evidence of a segmenter "
            f"({FORMAT!r})"
        )
    _, what, channels, digest, width, height, *box = _HEAD.unpack_from(raw)
    start = _HEAD.size + 8 * channels
    left, top, w, h = box
    good = (
        what in (SILHOUETTE, EDGES)
        and channels <= _CHANNELS_MAX
        and len(raw) > start
        and 0 < w <= width <= _SIDE_MAX
        and 0 < h <= height <= _SIDE_MAX
        and left + w <= width
        and top + h <= height
    )
    if not good:
        raise ImageError(
            f"{topic}: evidence of kind {what!r}, {channels} channels, {w}x{h} px at "
            f"({left}, {top}) in a frame of {width}x{height} px, expected a region inside the frame"
        )
    exposure = struct.unpack_from(f"<{channels}d", raw, _HEAD.size)
    return EvidenceMessage(
        stamp_ns, frame_id, what, width, height, (left, top, w, h), exposure, digest,
        raw[start:], topic,
    )  # fmt: skip


def unpack(camera: str, evidence: Evidence) -> Observation:
    """The observation of evidence, equal to the original byte by byte; without edges the map is 0.

    Raises:
        ImageError: the data are truncated or do not fit the region; names the topic.
    """
    seen, edges = evidence
    left, top, width, height = seen.box
    words = (width + 63) // 64
    plain = _plain(seen, 2 * 8 * words * height)
    person, undecided = np.frombuffer(plain, "<u8").reshape(2, height, words).astype(np.uint64)
    padding = np.uint64(0) if width % 64 == 0 else ~np.uint64((1 << width % 64) - 1)
    if ((person[:, -1] | undecided[:, -1]) & padding).any():
        raise ImageError(f"{seen.topic}: evidence has pixels beyond its width of {width} px")
    if edges is None:
        edge_map = no_edges((height, width))
    elif edges.box != seen.box:
        raise ImageError(
            f"{edges.topic}: edges of a region {edges.box}, the silhouette's is {seen.box}"
        )
    else:
        edge_map = np.frombuffer(_plain(edges, width * height), np.uint8).reshape(height, width)
    size_px, exposure = (seen.width, seen.height), seen.exposure or None
    return Observation(
        camera, seen.stamp_ns, size_px, (left, top), person, edge_map, undecided, exposure
    )


def _data(kind: bytes, observation: Observation, digest: bytes, plain: bytes) -> bytes:
    exposure = observation.exposure or ()
    head = _HEAD.pack(
        _MAGIC, kind, len(exposure), digest, *observation.size_px, *observation.offset_px,
        observation.width, observation.height,
    )  # fmt: skip
    return head + struct.pack(f"<{len(exposure)}d", *exposure) + zlib.compress(plain, _LEVEL)


def _plain(message: EvidenceMessage, size: int) -> bytes:
    """The decompressed part, which must have a given size; more is never decompressed."""
    unpacker = zlib.decompressobj()
    try:
        plain = unpacker.decompress(message.data, size + 1)
    except zlib.error as error:
        raise ImageError(f"{message.topic}: evidence cannot be decompressed: {error}") from error
    if len(plain) != size:
        raise ImageError(
            f"{message.topic}: evidence of {len(plain)} bytes or more, expected {size} for its "
            f"region of {message.box[2]}x{message.box[3]} px"
        )
    return plain
