"""What each pixel looks like without the person: one diagonal Gaussian per pixel."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging.images import Image, check_image
from markerless_tracker.imaging.settings import ImagingSettings
from markerless_tracker.records import locked

FloatImage = NDArray[np.float32]

# Weight, in frames, of the image's typical variance when a pixel's own is estimated.
_PRIOR_FRAMES = 4.0


@dataclass(frozen=True, eq=False)
class BackgroundModel:
    """The empty scene of one camera.

    Attributes:
        mean: (h, w, c) float32, grey levels, c = 1 (grey) or 3 (BGR); read-only.
        variance: (h, w, c) float32, squared grey levels, above 0; read-only.
        note: how it was made, and what that costs.

    Raises:
        ImageError: shapes that do not belong together, or numbers that are no background.
    """

    mean: FloatImage
    variance: FloatImage
    note: str

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

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height) of the images it belongs to."""
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
    """Mean and variance per pixel of frames of the empty scene, one pass, two images of memory.

    A few frames say little about one pixel's variance, so the image's median variance counts as
    four more of them. A single still says nothing: `background_sigma_still` is assumed.

    Args:
        frames: one or more images of the same size and channels.
        settings: `background_sigma_min` and `background_sigma_still`.
        camera: name for error messages.
        note: what the model's note says, instead of how many frames it was learned from.

    Raises:
        ImageError: no frame, or frames that differ in size or channels.
    """
    settings = settings or ImagingSettings()
    count = 0
    shape: tuple[int, ...] = ()
    mean = moment = np.zeros(0, dtype=np.float32)
    for frame in frames:
        check_image(frame, f"{camera}: background frame {count}")
        values = frame.reshape(frame.shape[0], frame.shape[1], -1).astype(np.float32)
        if count == 0:
            shape = frame.shape
            mean = np.zeros_like(values)
            moment = np.zeros_like(values)
        elif frame.shape != shape:
            raise ImageError(
                f"{camera}: background frame {count} is {frame.shape}, the first was {shape}"
            )
        count += 1
        change = values - mean
        mean += change / np.float32(count)
        moment += change * (values - mean)
    if count == 0:
        raise ImageError(f"{camera}: no background frame came, expected at least one")
    return model_from_moments(mean, moment, count, settings, note=note)


def model_from_moments(
    mean: FloatImage,
    moment: FloatImage,
    count: int,
    settings: ImagingSettings,
    *,
    note: str | None = None,
) -> BackgroundModel:
    """A model from the mean and summed squared deviations (h, w, c) of ``count`` frames."""
    if count == 1:
        sigma = settings.background_sigma_still
        variance = np.full_like(mean, sigma**2)
        how = f"one still image; a sensor noise of {sigma:g} grey levels is assumed"
    else:
        typical = np.median(moment, axis=(0, 1)) / (count - 1)
        pooled = (moment + _PRIOR_FRAMES * typical) / (count - 1 + _PRIOR_FRAMES)
        variance = pooled.astype(np.float32)
        how = f"mean and variance of {count} frames"
    np.maximum(variance, settings.background_sigma_min**2, out=variance)
    return BackgroundModel(mean, variance, note if note is not None else how)


def foreground_limit(variance: FloatImage, risk: float) -> FloatImage:
    """(h, w) float32: squared Mahalanobis distance beyond which a pixel is foreground.

    H-MCPSO Eq 11 in logs, N(pix; mu, rho) < 1 / (256^3 delta) with intensities in 0..1 as HumanEva
    has them: d^2 > 2 ln(256^c delta^(c/3)) - sum_c ln(2 pi rho_c). One channel takes a third of the
    exponent of three. At least 1, so that no background is foreground at its own mean.

    Args:
        variance: (h, w, c), squared grey levels.
        risk: log10(delta).
    """
    channels = variance.shape[2]
    bound = 2.0 * channels * (math.log(256.0) + risk * math.log(10.0) / 3.0)
    spread = np.log(2.0 * math.pi * variance.astype(np.float64) / 255.0**2).sum(axis=2)
    limit: FloatImage = np.maximum(bound - spread, 1.0).astype(np.float32)
    return limit
