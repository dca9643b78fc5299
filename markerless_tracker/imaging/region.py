"""A rectangle of pixels in an image."""

from typing import NamedTuple


class Region(NamedTuple):
    """Pixels left <= u < right, top <= v < bottom."""

    left: int
    top: int
    right: int
    bottom: int

    @classmethod
    def whole(cls, size_px: tuple[int, int]) -> "Region":
        """The whole image of (width, height)."""
        return cls(0, 0, size_px[0], size_px[1])

    @property
    def width(self) -> int:
        """Columns."""
        return self.right - self.left

    @property
    def height(self) -> int:
        """Rows."""
        return self.bottom - self.top

    @property
    def slices(self) -> tuple[slice, slice]:
        """Index of the region in an array (h, w, ...) of the image."""
        return slice(self.top, self.bottom), slice(self.left, self.right)

    def grown(self, px: int, size_px: tuple[int, int]) -> "Region":
        """The region grown by `px` on every side, clipped to an image of (width, height)."""
        return Region(
            max(self.left - px, 0),
            max(self.top - px, 0),
            min(self.right + px, size_px[0]),
            min(self.bottom + px, size_px[1]),
        )

    def relative_to(self, other: "Region") -> "Region":
        """The same region, relative to the other region's top left corner."""
        return self.moved(-other.left, -other.top)

    def moved(self, right_px: int, down_px: int) -> "Region":
        """The region shifted by columns and rows."""
        return Region(
            self.left + right_px, self.top + down_px, self.right + right_px, self.bottom + down_px
        )
