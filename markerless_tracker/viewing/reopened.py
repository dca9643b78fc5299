"""Opening a result's recording as the run opened it."""

from pathlib import Path
from typing import Any

from markerless_tracker.datasets import Recording, detect_format, open_recording
from markerless_tracker.errors import DatasetError
from markerless_tracker.results.stored_result import StoredResult

_KINDS: dict[str, tuple[type, ...]] = {
    "format": (str, type(None)),
    "input_fps": (int, float, type(None)),
    "up": (str,),
    "units": (str,),
}


def reopened(result: StoredResult, path: Path, *, scale: float = 1.0) -> Recording:
    """A recording opened with the run's options for format, rate, up axis and units.

    A bag that was made of the run's recording has its own rate, and metres with z up.

    Args:
        result: the result.
        path: the recording: the run's, a copy of it, or a bag made of it.
        scale: factor for all images and cameras, in (0, 1].

    Raises:
        DatasetError, CalibrationError, ImageError, ConfigError: as `open_recording`; and if the
            result names impossible options.
    """
    options = result.summary.get("reading") or {}
    if not isinstance(options, dict) or not all(
        isinstance(value, _KINDS.get(name, ())) for name, value in options.items()
    ):
        raise DatasetError(
            f"the result of {result.source}: `reading` is {options!r}, expected some of "
            f"{', '.join(_KINDS)}"
        )
    made_bag = detect_format(path) == "bag" and detect_format(Path(result.source)) != "bag"
    chosen: dict[str, Any] = {} if made_bag else options
    return open_recording(path, scale=scale, **chosen)
