"""Regions of an image that a silhouette of a smaller region depends on."""

from dataclasses import dataclass

from markerless_tracker.imaging.region import Region
from markerless_tracker.imaging.segmentation.blobs import BOTTOM, LEFT, RIGHT, TOP
from markerless_tracker.imaging.segmentation.border import border_reach
from markerless_tracker.imaging.segmentation.labels import LOOK_PX
from markerless_tracker.imaging.segmentation.level_set import level_set_reach
from markerless_tracker.imaging.segmentation.morphology import patch_reach, repair_reach
from markerless_tracker.imaging.settings import ImagingSettings


@dataclass(frozen=True)
class Zones:
    """Nested regions, from the innermost to the outermost, each as large as the next one needs.

    Attributes:
        patches: where patches must have the right size, before border and contour are moved.
        zone: `patches` and some slack, in which patches are measured.
        patches_before_repair, zone_before_repair: the same before opening and closing.
        window: what is labelled.
        open_sides: sides of `zone` beyond which the image goes on, and with it its patches.
        frame_px: pixels of the whole image.
    """

    patches: Region
    zone: Region
    patches_before_repair: Region
    zone_before_repair: Region
    window: Region
    open_sides: int
    frame_px: int

    @classmethod
    def around(
        cls,
        need: Region,
        slack_px: int,
        size_px: tuple[int, int],
        settings: ImagingSettings,
        *,
        grey: bool,
    ) -> "Zones":
        """The zones from which the silhouette in `need` follows, with slack for its patches."""
        if settings.level_set.iterations:
            reach = level_set_reach(settings.level_set.iterations, settings.level_set.radius_px)
            need = need.grown(reach, size_px)
        patches = need.grown(border_reach(settings.mask.trim_px), size_px)
        zone = patches.grown(slack_px, size_px)
        frame_px = size_px[0] * size_px[1]
        repair = repair_reach(settings, frame_px)
        before = zone.grown(repair, size_px)
        return cls(
            patches=patches,
            zone=zone,
            patches_before_repair=patches.grown(repair, size_px),
            zone_before_repair=before,
            window=before.grown(LOOK_PX + patch_reach(settings, grey=grey), size_px),
            open_sides=_open_sides(zone, size_px),
            frame_px=frame_px,
        )


def _open_sides(zone: Region, size_px: tuple[int, int]) -> int:
    return (
        LEFT * (zone.left > 0)
        | TOP * (zone.top > 0)
        | RIGHT * (zone.right < size_px[0])
        | BOTTOM * (zone.bottom < size_px[1])
    )
