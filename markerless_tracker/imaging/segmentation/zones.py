"""Regions of an image that the silhouette in a smaller region depends on."""

from dataclasses import dataclass

from markerless_tracker.imaging.region import Region
from markerless_tracker.imaging.segmentation.blobs import BOTTOM, LEFT, RIGHT, TOP
from markerless_tracker.imaging.segmentation.border import border_radius_px
from markerless_tracker.imaging.segmentation.labels import EXAMINED_RADIUS_PX, patch_radius_px
from markerless_tracker.imaging.segmentation.level_set import refinement_radius_px
from markerless_tracker.imaging.segmentation.morphology import (
    SPLIT_RADIUS_PX,
    opening_radius_px,
    repair_radius_px,
)
from markerless_tracker.imaging.segmentation.shadow import patches_radius_px
from markerless_tracker.imaging.settings import ImagingSettings


@dataclass(frozen=True)
class Zones:
    """Nested regions, from the innermost to the outermost; each includes what the one before needs.

    Attributes:
        patches: where patches must have the right size, before border and contour are moved.
        zone: `patches` and a margin, in which patches are measured.
        patches_before_repair, zone_before_repair: the same before opening and closing.
        corrected: where texture corrects labels: `zone_before_repair`, and the radius of labels
            that the opening of shadows and the means of patches depend on.
        window: the labelled region: `corrected`, and the radius of colours that these labels depend
            on.
        open_sides: sides of `zone` beyond which the image continues.
        frame_px: number of pixels of the whole image.
    """

    patches: Region
    zone: Region
    patches_before_repair: Region
    zone_before_repair: Region
    corrected: Region
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
        """The zones that the silhouette in `need` depends on, with a margin for its patches."""
        if settings.level_set.iterations:
            radius_px = refinement_radius_px(
                settings.level_set.iterations, settings.level_set.radius_px
            )
            need = need.grown(radius_px, size_px)
        if settings.shadow.undecided:
            need = need.grown(SPLIT_RADIUS_PX, size_px)
        patches = need.grown(border_radius_px(settings.mask.trim_px), size_px)
        zone = patches.grown(slack_px, size_px)
        frame_px = size_px[0] * size_px[1]
        repair = repair_radius_px(settings, frame_px)
        before = zone.grown(repair, size_px)
        radius_px = opening_radius_px(settings, grey=grey) + patch_radius_px(settings)
        corrected = before.grown(radius_px, size_px)
        return cls(
            patches=patches,
            zone=zone,
            patches_before_repair=patches.grown(repair, size_px),
            zone_before_repair=before,
            corrected=corrected,
            window=corrected.grown(
                EXAMINED_RADIUS_PX + patches_radius_px(settings, grey=grey), size_px
            ),
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
