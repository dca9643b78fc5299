"""Settings of segmentation and edge map."""

from dataclasses import dataclass

from markerless_tracker.errors import ConfigError
from markerless_tracker.settings import GroupedSettings, SettingsGroup, group, setting


@dataclass(frozen=True, kw_only=True)
class BackgroundSettings(SettingsGroup):
    """Background model, and the comparison of images with it."""

    NAME = "background"

    risk: float = setting(
        8.0,
        "log10 of the risk factor of the foreground test for three channels: a pixel is foreground "
        "where its background density is below 1 / (256^3 * 10^risk); higher means less foreground",
        least=-6.0,
        most=200.0,
    )
    risks: str = setting(
        "same",
        "same: risk for every camera; humaneva: that dataset's own for cameras 1 to 4 "
        "(80, 60, 30, 80), by the number at the end of the name",
        choices=("same", "humaneva"),
    )
    modes: int = setting(
        1,
        "Gaussians per pixel of a background learned from several images: 1 = mean and variance, "
        "more = a mixture, for scenes that alternate (screens, leaves)",
        least=1,
        most=8,
    )
    sigma_min: float = setting(
        2.0, "least noise of a background pixel, grey levels", least=0.1, most=50.0
    )
    sigma_still: float = setting(
        4.0,
        "noise assumed where the background is a single still, grey levels",
        least=0.1,
        most=50.0,
    )
    follow_s: float = setting(
        0.0,
        "time constant with which the background follows slow changes of light away from the "
        "silhouette; 0 = never: evidence then depends on each image alone",
        least=0.0,
        most=1e6,
    )
    follow_margin_px: int = setting(
        12, "distance from the silhouette that does not follow", least=0, most=500
    )
    denoise_sigma: float = setting(
        5.0,
        "images of cameras whose background is noisier than this, grey levels, are smoothed first",
        least=0.0,
        most=1000.0,
    )
    exposure_compensation: bool = setting(
        True,
        "estimate in every image its brightness relative to the background (exposure steps, "
        "flicker), by channel, and scale the background by it",
    )


@dataclass(frozen=True, kw_only=True)
class ShadowSettings(SettingsGroup):
    """Shadow test: hue, saturation and value relative to the background's."""

    NAME = "shadow"

    removal: bool = setting(True, "take pixels that look like a shadow out of the silhouette")
    undecided: bool = setting(
        True,
        "pixels that look like a shadow are undecided: person near the predicted body, elsewhere "
        "not counted; false: they are background",
    )
    weak_sigmas: float = setting(
        1.0,
        "patches whose mean differs from the background by so many sigmas are undecided; 0 = none",
        least=0.0,
        most=1000.0,
    )
    weak_least: float = setting(
        4.0, "least difference of such a patch, grey levels", least=0.0, most=255.0
    )
    undecided_value_min: float = setting(
        0.42,
        "value_min where shadows are undecided, of colour and grey cameras alike",
        least=0.0,
        most=1.0,
    )
    spread_max: float = setting(
        0.05,
        "where shadows are undecided, the ratios of a shadow to its background differ among the "
        "channels by no more than this part of the largest; means of patches, colour cameras",
        least=0.0,
        most=1.0,
    )
    value_min: float = setting(
        0.5,
        "darkest shadow, as a ratio of its brightness to the background's (without `undecided`)",
        least=0.0,
        most=1.0,
    )
    value_max: float = setting(
        1.0,
        "faintest shadow, as a ratio of its brightness to the background's",
        least=0.0,
        most=2.0,
    )
    saturation_max: float = setting(
        0.05,
        "a shadow's saturation exceeds the background's by no more than this",
        least=-1.0,
        most=1.0,
    )
    hue_max_deg: float = setting(
        40.0,
        "a shadow's hue differs from the background's by no more than this",
        least=0.0,
        most=180.0,
    )
    chroma_min: float = setting(
        12.0,
        "hue is compared only where the background, darkened as much as the pixel, would have this "
        "much colour (largest minus smallest channel, grey levels); below it hue is noise",
        least=0.0,
        most=255.0,
    )
    blob_share: float = setting(
        2e-4,
        "shadow patches below this share of the image belong to the person, colour cameras",
        least=0.0,
        most=1.0,
    )
    grey_value_min: float = setting(
        0.75,
        "value_min of grey cameras, where no colour protects clothes (without `undecided`)",
        least=0.0,
        most=1.0,
    )
    grey_value_max: float = setting(
        0.95, "value_max of grey cameras (without `undecided`)", least=0.0, most=2.0
    )
    grey_blob_share: float = setting(
        1e-3,
        "blob_share of grey cameras, whose patches are opened first (with `undecided` all are)",
        least=0.0,
        most=1.0,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        pairs = [("value_min", "value_max"), ("grey_value_min", "grey_value_max")]
        if self.undecided:
            pairs = [("undecided_value_min", "value_max")]
        for least, most in pairs:
            low, high = getattr(self, least), getattr(self, most)
            if low > high:
                raise ConfigError(f"shadow.{least}: got {low}, expected at most {most} ({high})")


@dataclass(frozen=True, kw_only=True)
class TextureSettings(SettingsGroup):
    """Texture test: a shadow keeps the background's pattern."""

    NAME = "texture"

    radius_px: int = setting(
        3,
        "radius of the windows in which image and background are compared: the background's "
        "pattern in any light is shadow, a hidden pattern is foreground; 0 = no test",
        least=0,
        most=6,
    )
    light_min: float = setting(
        0.15,
        "darkest shadow that its pattern can show, as a ratio of its brightness to the "
        "background's",
        least=0.0,
        most=1.0,
    )
    reveal: bool = setting(
        True,
        "grey cameras: pixels as bright as the background that hide its pattern are foreground",
    )


@dataclass(frozen=True, kw_only=True)
class MaskSettings(SettingsGroup):
    """Repair of the silhouette: morphology, holes, blobs, border."""

    NAME = "mask"

    open_px: int = setting(
        3, "side of the opening that removes specks, odd; 0 or 1 = none", least=0, most=101
    )
    close_px: int = setting(
        5,
        "side of the closing that closes cracks, in images of 640x480 or more; in smaller ones it "
        "is scaled down with them; 0 or 1 = none",
        least=0,
        most=101,
    )
    trim_px: int = setting(
        1,
        "layers of pixels that may be taken from the silhouette's border where the body, by the "
        "colours beside them, covers less than half of them; 0 = none",
        least=0,
        most=20,
    )
    hole_share: float = setting(
        2e-4, "holes up to this share of the image are filled", least=0.0, most=1.0
    )
    blob_share: float = setting(
        3e-4, "blobs below this share of the image are dropped", least=0.0, most=1.0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.open_px and self.open_px % 2 == 0:
            raise ConfigError(f"mask.open_px: got {self.open_px}, expected 0 or an odd number")


@dataclass(frozen=True, kw_only=True)
class LevelSetSettings(SettingsGroup):
    """Localised active contour on the silhouette's border."""

    NAME = "level_set"

    iterations: int = setting(
        0,
        "steps of a pixel by which the silhouette's contour may move to the local change of colour "
        "(localised active contour); 0 = the contour of the foreground test",
        least=0,
        most=20,
    )
    radius_px: int = setting(5, "radius within which colours are compared", least=1, most=100)


@dataclass(frozen=True, kw_only=True)
class EdgeMapSettings(SettingsGroup):
    """The edge map of an image."""

    NAME = "edges"

    form: str = setting(
        "soft",
        "soft: gradient rising from 0 at half the threshold to 1 at twice it, then blurred; "
        "published: 1 at and above the threshold, else 0, then blurred",
        choices=("soft", "published"),
    )
    gradient: float = setting(
        4.0,
        "gradient (Sobel / 8, grey levels per pixel) that counts as an edge",
        least=0.01,
        most=255.0,
    )
    blur_px: int = setting(7, "side of the edge map's blur, odd", least=1, most=101)
    margin_px: int = setting(
        6, "edges count up to this far outside the silhouette", least=0, most=200
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.blur_px % 2 == 0:
            raise ConfigError(f"edges.blur_px: got {self.blur_px}, expected an odd number")


@dataclass(frozen=True, kw_only=True)
class ImagingSettings(GroupedSettings):
    """Settings of the imaging room, in groups.

    Lengths ending in ``_px`` are pixels of the image that is segmented, areas are fractions of that
    image, sigmas and gradients are grey levels of 0..255.

    Raises:
        ConfigError: a value of the wrong type, out of its range or not among its choices.
    """

    background: BackgroundSettings = group(BackgroundSettings)
    shadow: ShadowSettings = group(ShadowSettings)
    texture: TextureSettings = group(TextureSettings)
    mask: MaskSettings = group(MaskSettings)
    level_set: LevelSetSettings = group(LevelSetSettings)
    edges: EdgeMapSettings = group(EdgeMapSettings)
