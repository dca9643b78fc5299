"""The errors this package raises; every message says what came, what was expected, and where."""


class TrackerError(Exception):
    """Root of all errors of this package."""


class CalibrationError(TrackerError):
    """A camera's calibration is missing, malformed or does not fit its images."""


class BodyModelError(TrackerError):
    """A body description, subject or pose is malformed."""


class DatasetError(TrackerError):
    """A recording, bag, marker file or result cannot be read or written."""


class ConfigError(TrackerError):
    """A setting is unknown or its value impossible."""


class ImageError(TrackerError):
    """An image has an unknown encoding or a size other than its calibration's."""


class SearchError(TrackerError):
    """A search was set up with impossible numbers (bounds, particles, budget)."""


def one_line(error: BaseException) -> str:
    """An error in one line, with its type unless it is a `TrackerError`."""
    text = " ".join(str(error).split())
    return text if isinstance(error, TrackerError) else f"{type(error).__name__}: {text}"
