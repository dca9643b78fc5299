"""Background statistics of HumanEva: Gaussians of the pixels, one of each clip."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from markerless_tracker.errors import DatasetError
from markerless_tracker.imaging import BackgroundModel, Image, Mode
from markerless_tracker.imaging.images import FloatImage

_LEVELS = 255.0
_NO_VARIANCE = 1e-3
"""Variance, of values in [0, 1], of pixels that have none, as in HumanEva's toolbox."""


class Statistic(NamedTuple):
    """The Gaussians of the pixels of one clip.

    Attributes:
        mean: (h, w, 3) float32 BGR, grey levels.
        variance: (h, w, 3) float32, squared grey levels, above 0; None if the file has none.
    """

    mean: FloatImage
    variance: FloatImage | None

    @property
    def image(self) -> Image:
        """The mean as an image (h, w, 3) uint8."""
        return np.asarray(np.rint(np.clip(self.mean, 0.0, _LEVELS)), dtype=np.uint8)


def read_statistics(path: Path) -> list[Statistic]:
    """Read a `Background_(C1).mat`: cells `bg_means` and, if there, `bg_vars`, RGB in [0, 1].

    Raises:
        DatasetError: the file cannot be read or is malformed; names the cell.
    """
    # Few recordings need it, and it takes a moment to import.
    from scipy.io import loadmat

    try:
        content: dict[str, Any] = loadmat(str(path))
    except Exception as error:  # damaged bytes raise any exception
        raise DatasetError(f"{path}: cannot be read as a MATLAB file: {error}") from error
    if "bg_means" not in content:
        raise DatasetError(f"{path}: no bg_means, expected cells of the means of the pixels")
    means = _cells(path, content, "bg_means")
    if "bg_vars" not in content:
        return [Statistic(mean * np.float32(_LEVELS), None) for mean in means]
    variances = _cells(path, content, "bg_vars")
    if [value.shape for value in variances] != [value.shape for value in means]:
        raise DatasetError(
            f"{path}: bg_vars has {len(variances)} cells, expected {len(means)} of the sizes of "
            "bg_means"
        )
    statistics = []
    for number, (mean, variance) in enumerate(zip(means, variances, strict=True), start=1):
        if variance.min() < 0.0:
            raise DatasetError(f"{path}: bg_vars {number} has negative values, expected variances")
        above = np.where(variance > 0.0, variance, np.float32(_NO_VARIANCE))
        statistics.append(Statistic(mean * np.float32(_LEVELS), above * np.float32(_LEVELS**2)))
    return statistics


def mixture_of(statistics: Sequence[Statistic]) -> BackgroundModel | None:
    """The mixture of the Gaussians with equal weights; None without variances."""
    gaussians = [(s.mean, s.variance) for s in statistics if s.variance is not None]
    if not gaussians or len({mean.shape for mean, _ in gaussians}) > 1:
        return None
    (mean, variance), *others = gaussians
    weight = np.full(mean.shape[:2], 1.0 / len(gaussians), dtype=np.float32)
    note = f"HumanEva's background statistics of {len(gaussians)} clips"
    return BackgroundModel(mean, variance, note, tuple(Mode(weight, m, v) for m, v in others))


def _cells(path: Path, content: dict[str, Any], field: str) -> list[FloatImage]:
    """The cells of a field, (h, w, 3) float32 each, as BGR."""
    images = []
    for number, cell in enumerate(np.asarray(content[field], dtype=object).ravel(), start=1):
        try:
            with np.errstate(over="ignore"):
                values = np.asarray(cell, dtype=np.float32)
        except (TypeError, ValueError):
            values = np.empty(0, dtype=np.float32)
        if values.ndim != 3 or values.shape[2] != 3 or not np.isfinite(values).all():
            raise DatasetError(
                f"{path}: {field} {number} has shape {values.shape}, expected (h, w, 3) and "
                "finite numbers"
            )
        images.append(np.ascontiguousarray(values[..., ::-1]))
    return images
