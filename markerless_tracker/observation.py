"""What one camera's image says about the body: masks packed into words, and `Observation`."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.errors import ImageError

MaskWords = NDArray[np.uint64]
"""A mask packed by `pack_mask`: (h, ceil(w / 64))."""
_ALL = np.uint64(0xFFFFFFFFFFFFFFFF)


def locked(array: Any, dtype: Any) -> NDArray[Any]:
    """A C-contiguous read-only array of that type; copied only if the type or layout differs."""
    result = np.ascontiguousarray(array, dtype=dtype)
    if result is array and result.flags.writeable:
        result = result.view()
    result.flags.writeable = False
    return result


def pack_mask(mask: NDArray[Any]) -> MaskWords:
    """Pack a mask (h, w), non-zero = body, into words (h, ceil(w / 64)).

    Column u is bit ``u % 64`` (least significant first) of word ``u // 64``; padding bits are 0.
    """
    height, width = mask.shape
    padded = np.zeros((height, (width + 63) // 64 * 64), dtype=np.bool_)
    np.not_equal(mask, 0, out=padded[:, :width])
    packed = np.packbits(padded, bitorder="little").view("<u8")
    return packed.astype(np.uint64, copy=False).reshape(height, -1)


def unpack_mask(words: MaskWords, width: int) -> NDArray[np.bool_]:
    """The mask (h, width) that `pack_mask` packed."""
    raw = np.ascontiguousarray(words, dtype="<u8").view(np.uint8)
    return np.unpackbits(raw, axis=1, count=width, bitorder="little").view(np.bool_)


def cut_mask(words: MaskWords, left: int, top: int, width: int, height: int) -> MaskWords:
    """The part (height, ceil(width / 64)) of a packed mask, from the pixel (left, top) on.

    The part must lie in the mask. It is packed as `pack_mask` does.
    """
    first, shift = left // 64, left % 64
    count = (width + 63) // 64
    rows = words[top : top + height]
    part = rows[:, first : first + count] >> np.uint64(shift)
    if shift:
        # A word of the part begins in one word of the mask and ends in the next one.
        following = rows[:, first + 1 : first + 1 + count]
        part[:, : following.shape[1]] |= following << np.uint64(64 - shift)
    part[:, -1] &= _ALL >> np.uint64(-width % 64)
    return part


def no_edges(shape: tuple[int, int]) -> NDArray[np.uint8]:
    """An edge map (h, w) without edges, read-only. It takes no memory: all values are the same."""
    return np.broadcast_to(np.uint8(0), shape)


@dataclass(frozen=True, eq=False)
class Observation:
    """The evidence of one camera's image, in that camera's own (distorted) pixels.

    A pixel is person, background or undecided. Undecided pixels differ from the background as a
    shadow on it would; they do not count.

    Attributes:
        camera: the camera's name.
        stamp_ns: capture time.
        size_px: (width, height) of the full frame.
        offset_px: (u, v) of the region's top left pixel in the full frame.
        mask_words: (h, ceil(w / 64)) uint64, the silhouette (person) packed as `pack_mask` does.
        edges: (h, w) uint8, edge strength M = value / 255, in the same region.
        undecided_words: the undecided pixels, packed likewise; none if left out. No pixel is
            person and undecided.
        exposure: brightness of the image relative to its background, by channel; None if unknown.
    """

    camera: str
    stamp_ns: int
    size_px: tuple[int, int]
    offset_px: tuple[int, int]
    mask_words: MaskWords
    edges: NDArray[np.uint8]
    undecided_words: MaskWords | None = None
    exposure: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "mask_words", locked(self.mask_words, np.uint64))
        if self.undecided_words is not None:
            words = locked(self.undecided_words, np.uint64)
            # None stands for none, so that equal evidence is equal and costs nothing.
            object.__setattr__(self, "undecided_words", words if words.any() else None)
            if words.shape != self.mask_words.shape or (words & self.mask_words).any():
                raise ImageError(
                    f"{self.camera}: undecided words {words.shape} beside mask words "
                    f"{self.mask_words.shape}, expected the same shape and no pixel in both"
                )
        # An array with strides of 0 is `no_edges`, which stays as small as it is.
        if any(self.edges.strides) or self.edges.dtype != np.uint8:
            object.__setattr__(self, "edges", locked(self.edges, np.uint8))
        if self.edges.ndim != 2 or self.mask_words.shape != (self.height, (self.width + 63) // 64):
            raise ImageError(
                f"{self.camera}: observation holds edges {self.edges.shape} and mask words "
                f"{self.mask_words.shape}, expected (h, w) and (h, ceil(w / 64))"
            )
        (full_w, full_h), (u, v) = self.size_px, self.offset_px
        if u < 0 or v < 0 or u + self.width > full_w or v + self.height > full_h:
            raise ImageError(
                f"{self.camera}: region {self.width}x{self.height} at ({u}, {v}) does not lie "
                f"inside the frame of {full_w}x{full_h} px"
            )

    def __getstate__(self) -> dict[str, Any]:
        """For another process: of an empty edge map its shape alone."""
        state = dict(self.__dict__)
        if not self.has_edges:
            state["edges"] = self.edges.shape
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        edges = state["edges"]
        if isinstance(edges, tuple):
            state = {**state, "edges": no_edges(edges)}
        self.__dict__.update(state)

    @cached_property
    def has_edges(self) -> bool:
        """Whether the edge map holds any edge."""
        # With strides of 0 all values are the same.
        edges = self.edges if any(self.edges.strides) else self.edges[:1, :1]
        return bool(edges.any())

    @property
    def width(self) -> int:
        """Width of the region in px."""
        return int(self.edges.shape[1])

    @property
    def height(self) -> int:
        """Height of the region in px."""
        return int(self.edges.shape[0])

    @property
    def is_whole(self) -> bool:
        """Whether the region is the full frame."""
        return (self.width, self.height) == self.size_px

    @property
    def mask(self) -> NDArray[np.bool_]:
        """The silhouette of the region, unpacked: (h, w)."""
        return unpack_mask(self.mask_words, self.width)

    @property
    def undecided(self) -> NDArray[np.bool_] | None:
        """The undecided pixels of the region, unpacked: (h, w); None if there are none."""
        if self.undecided_words is None:
            return None
        return unpack_mask(self.undecided_words, self.width)

    @property
    def not_background(self) -> NDArray[np.bool_]:
        """The pixels of the region that are person or undecided, unpacked: (h, w)."""
        words = self.mask_words
        if self.undecided_words is not None:
            words = words | self.undecided_words
        return unpack_mask(words, self.width)

    def in_full_frame(self, part: NDArray[Any]) -> NDArray[Any]:
        """An array (h, w) of the region as one of the full frame, 0 outside the region.

        The very same if the region is the full frame.
        """
        width, height = self.size_px
        if part.shape == (height, width):
            return part
        u, v = self.offset_px
        frame = np.zeros((height, width), dtype=part.dtype)
        frame[v : v + self.height, u : u + self.width] = part
        return frame

    @classmethod
    def from_mask(
        cls,
        camera: str,
        stamp_ns: int,
        mask: NDArray[Any],
        edges: NDArray[np.uint8],
        *,
        undecided: NDArray[Any] | None = None,
        size_px: tuple[int, int] | None = None,
        offset_px: tuple[int, int] = (0, 0),
    ) -> "Observation":
        """Build from a mask (h, w), non-zero = person; the region is the full frame unless given.

        Args:
            undecided: (h, w), non-zero = undecided; none if left out.
        """
        size = size_px or (int(mask.shape[1]), int(mask.shape[0]))
        words = None if undecided is None else pack_mask(undecided)
        return cls(camera, stamp_ns, size, offset_px, pack_mask(mask), edges, words)

    def cut(self, box: tuple[int, int, int, int]) -> "Observation":
        """The part in a box (left, top, right, bottom) of the frame, which lies in the region.

        The very same if the box is the region.
        """
        u, v = self.offset_px
        left, top, right, bottom = box
        if box == (u, v, u + self.width, v + self.height):
            return self
        place = (left - u, top - v, right - left, bottom - top)
        inside = np.s_[top - v : bottom - v, left - u : right - u]
        undecided = self.undecided_words
        return replace(
            self,
            offset_px=(left, top),
            mask_words=cut_mask(self.mask_words, *place),
            edges=self.edges[inside] if self.has_edges else no_edges((bottom - top, right - left)),
            undecided_words=None if undecided is None else cut_mask(undecided, *place),
        )

    def with_masks(self, mask: NDArray[Any], undecided: NDArray[Any] | None) -> "Observation":
        """The same view with other silhouette and undecided pixels, (h, w) of the region."""
        words = None if undecided is None else pack_mask(undecided)
        return replace(self, mask_words=pack_mask(mask), undecided_words=words)
