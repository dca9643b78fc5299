"""The background model: one or several diagonal Gaussians per pixel."""

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging.background.mixture import learn_modes
from markerless_tracker.imaging.background.moments import Moments
from markerless_tracker.imaging.images import FloatImage, Image, check_image
from markerless_tracker.imaging.settings import ImagingSettings
from markerless_tracker.records import locked

HUMANEVA_RISKS = {1: 80.0, 2: 60.0, 3: 30.0, 4: 80.0}
"""log10 of HumanEva's risk factors delta, by number of the camera."""

# Weight, in frames, of the image's typical variance when a pixel's own is estimated.
_PRIOR_FRAMES = 4.0


@dataclass(frozen=True, eq=False)
class Mode:
    """One further Gaussian of the mixture.

    Attributes:
        weight: (h, w) float32, fraction of the frames; 0 where a pixel has no such mode; read-only.
        mean, variance: (h, w, c) float32 as in `BackgroundModel`; read-only.
    """

    weight: FloatImage
    mean: FloatImage
    variance: FloatImage

    def __post_init__(self) -> None:
        for name in ("weight", "mean", "variance"):
            object.__setattr__(self, name, locked(getattr(self, name), np.float32))


@dataclass(frozen=True, eq=False)
class BackgroundModel:
    """The empty scene of one camera.

    Attributes:
        mean: (h, w, c) float32, grey levels, c = 1 (grey) or 3 (BGR); read-only.
        variance: (h, w, c) float32, squared grey levels, above 0; read-only.
        note: how it was learned, and what that implies.
        modes: further Gaussians of the mixture; `mean` and `variance` are the most frequent
            Gaussian, which has the remaining weight.

    Raises:
        ImageError: shapes do not match, values are not finite, or variances are not above 0.
    """

    mean: FloatImage
    variance: FloatImage
    note: str
    modes: tuple[Mode, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "mean", locked(self.mean, np.float32))
        object.__setattr__(self, "variance", locked(self.variance, np.float32))
        shape = self.mean.shape
        if len(shape) != 3 or shape[2] not in (1, 3) or self.variance.shape != shape:
            raise ImageError(
                f"background: mean {shape} and variance {self.variance.shape}, "
                "expected (h, w, 1) or (h, w, 3) both"
            )
        if self.mean.size == 0:
            raise ImageError(f"background: got an empty image {shape}")
        if not (np.isfinite(self.mean).all() and np.isfinite(self.variance).all()):
            raise ImageError("background: got numbers that are not finite")
        if self.variance.min() <= 0.0:
            raise ImageError(f"background: least variance {self.variance.min()}, expected above 0")
        for mode in self.modes:
            if (
                mode.weight.shape != shape[:2]
                or not mode.mean.shape == mode.variance.shape == shape
            ):
                raise ImageError(
                    f"background: mode of {mode.weight.shape}, {mode.mean.shape} and "
                    f"{mode.variance.shape}, expected {shape[:2]} and twice {shape}"
                )
            there = mode.weight > 0.0
            if not all(np.isfinite(a).all() for a in (mode.weight, mode.mean, mode.variance)) or (
                there.any() and mode.variance[there].min() <= 0.0
            ):
                raise ImageError("background: got a mode that is no Gaussian")

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height) of the camera's images."""
        return int(self.mean.shape[1]), int(self.mean.shape[0])

    @property
    def channels(self) -> int:
        """1 (grey) or 3 (BGR)."""
        return int(self.mean.shape[2])

    @property
    def image(self) -> Image:
        """The mean as an image: (h, w) or (h, w, 3) uint8."""
        image = np.clip(np.rint(self.mean), 0, 255).astype(np.uint8)
        return image[:, :, 0] if self.channels == 1 else image


def learn_background(
    frames: Iterable[Image],
    settings: ImagingSettings | None = None,
    *,
    camera: str = "background",
    note: str | None = None,
) -> BackgroundModel:
    """Learn a background from frames of the empty scene, in one pass.

    A few frames do not determine a pixel's variance, so the image's median variance counts as four
    more frames. For a single image `background.sigma_still` is assumed.

    Args:
        frames: one or more images, uint8, (h, w, 3) BGR or (h, w) grey, of the same size.
        settings: `background.modes`, `background.sigma_min` and `background.sigma_still`.
        camera: name for error messages.
        note: the model's note; by default the number of frames.

    Raises:
        ImageError: no frame, or frames that differ in size or channels.
    """
    settings = settings or ImagingSettings()
    values = _checked(frames, camera)
    if settings.background.modes > 1:
        return _mixture(values, settings, note)
    moments = Moments()
    for frame in values:
        moments.add(frame)
    return model_from_moments(moments.mean, moments.squares, moments.count, settings, note=note)


def _checked(frames: Iterable[Image], camera: str) -> Iterator[Image]:
    """The checked frames as (h, w, c)."""
    shape: tuple[int, ...] = ()
    index = -1
    for index, frame in enumerate(frames):
        check_image(frame, f"{camera}: background frame {index}")
        if index == 0:
            shape = frame.shape
        elif frame.shape != shape:
            raise ImageError(
                f"{camera}: background frame {index} is {frame.shape}, the first was {shape}"
            )
        yield frame.reshape(frame.shape[0], frame.shape[1], -1)
    if index < 0:
        raise ImageError(f"{camera}: no background frame came, expected at least one")


def _mixture(
    frames: Iterator[Image], settings: ImagingSettings, note: str | None
) -> BackgroundModel:
    """A mixture of `background.modes` Gaussians per pixel, from frames (h, w, c)."""
    total, counts, means, moments = learn_modes(frames, settings.background.modes)
    if total == 1:
        return model_from_moments(means[0], moments[0], 1, settings, note=note)
    # The variance of the most frequent modes is the sensor's noise, which all modes have.
    free = np.maximum(counts[0] - 1.0, 1.0)[..., None]
    typical = np.median(moments[0] / free, axis=(0, 1))
    least = settings.background.sigma_min**2
    free = np.maximum(counts - 1.0, 0.0)[..., None]
    pooled = (moments + _PRIOR_FRAMES * typical) / (free + _PRIOR_FRAMES)
    variances = np.maximum(pooled, least).astype(np.float32)
    modes = tuple(
        Mode(counts[k] / np.float32(total), means[k], variances[k])
        for k in range(1, len(counts))
        if counts[k].any()
    )
    how = f"up to {len(modes) + 1} Gaussians per pixel from {total} frames"
    return BackgroundModel(means[0], variances[0], note if note is not None else how, modes)


def model_from_moments(
    mean: FloatImage,
    squares: FloatImage,
    count: int,
    settings: ImagingSettings,
    *,
    note: str | None = None,
) -> BackgroundModel:
    """A model from the mean and summed squared deviations (h, w, c) of ``count`` frames."""
    if count == 1:
        sigma = settings.background.sigma_still
        variance = np.full_like(mean, sigma**2)
        how = f"one still image; a sensor noise of {sigma:g} grey levels is assumed"
    else:
        typical = np.median(squares, axis=(0, 1)) / (count - 1)
        pooled = (squares + _PRIOR_FRAMES * typical) / (count - 1 + _PRIOR_FRAMES)
        variance = pooled.astype(np.float32)
        how = f"mean and variance of {count} frames"
    np.maximum(variance, settings.background.sigma_min**2, out=variance)
    return BackgroundModel(mean, variance, note if note is not None else how)


def foreground_limit(
    variance: FloatImage, risk: float, *, weight: FloatImage | None = None
) -> FloatImage:
    """(h, w) float32: squared Mahalanobis distance beyond which a pixel is foreground.

    H-MCPSO Eq 11 in logs, N(pix; mu, rho) < 1 / (256^3 delta) with intensities in 0..1 as HumanEva
    has them: d^2 > 2 ln(256^c delta^(c/3)) - sum_c ln(2 pi rho_c). One channel takes a third of the
    exponent of three. At least 1, so that a value at the mean is always background.
    For one Gaussian of a mixture its log weight is added to the log density. A pixel is foreground
    if it is beyond the limit of all k Gaussians: the sum of densities is replaced by its largest
    term, an error of at most ln k in a bound of about 30.

    Args:
        variance: (h, w, c), squared grey levels.
        risk: log10(delta).
        weight: (h, w) weight in the mixture; 1 if None.
    """
    channels = variance.shape[2]
    bound = 2.0 * channels * (math.log(256.0) + risk * math.log(10.0) / 3.0)
    spread = np.log(2.0 * math.pi * variance.astype(np.float64) / 255.0**2).sum(axis=2)
    if weight is not None:
        spread -= 2.0 * np.log(np.maximum(weight.astype(np.float64), 1e-6))
    limit: FloatImage = np.maximum(bound - spread, 1.0).astype(np.float32)
    return limit


def risk_of(camera: str, settings: ImagingSettings) -> float:
    """log10 of the risk factor for a camera.

    `background.risk`, or with `background.risks` = humaneva the published 80, 60, 30 and 80 of its
    colour cameras C1 to C4, by the number at the end of the camera's name.
    """
    if settings.background.risks == "humaneva":
        digits = re.search(r"(\d+)\D*$", camera)
        found = HUMANEVA_RISKS.get(int(digits.group(1))) if digits else None
        if found is not None:
            return found
    return settings.background.risk
