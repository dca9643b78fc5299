"""Scaling of a background model to smaller images of the same camera."""

import cv2
import numpy as np

from markerless_tracker.imaging.background.model import BackgroundModel, Mode
from markerless_tracker.imaging.images import FloatImage


def scale_background_model(model: BackgroundModel, size_px: tuple[int, int]) -> BackgroundModel:
    """The model at ``size_px`` = (width, height); the same object if it already has that size.

    Means and variances are averaged over areas, like images by `scale_image`; those of modes are
    weighted. The variance remains that of one pixel, which is an upper bound: a mean of pixels is
    less noisy, by a factor that is unknown since demosaicing and compression correlate neighbours.
    """
    if size_px == model.size_px:
        return model
    modes = []
    for mode in model.modes:
        weight = _smaller(mode.weight, size_px)
        there = np.maximum(weight, np.float32(1e-9))[:, :, None]
        mean, variance = (
            np.divide(_smaller(value * mode.weight[:, :, None], size_px), there, dtype=np.float32)
            for value in (mode.mean, mode.variance)
        )
        modes.append(Mode(weight, mean, variance))
    width, height = model.size_px
    return BackgroundModel(
        _smaller(model.mean, size_px),
        _smaller(model.variance, size_px),
        f"{model.note}; scaled from {width}x{height} px",
        tuple(modes),
    )


def _smaller(values: FloatImage, size_px: tuple[int, int]) -> FloatImage:
    scaled = cv2.resize(values, size_px, interpolation=cv2.INTER_AREA)
    # OpenCV drops a single channel.
    return np.asarray(scaled, dtype=np.float32).reshape(size_px[1], size_px[0], *values.shape[2:])
