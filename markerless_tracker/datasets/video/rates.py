"""Frame rates: nominal rates, stamps of frames, subsampling."""

from markerless_tracker.errors import ConfigError

TOLERANCE = 0.01
"""Accepted difference from a rate, as a share of it."""


def stamp_of(index: int, fps: float) -> int:
    """Stamp (ns) of frame `index` of a video at `fps` (1/s): round(index * 1e9 / fps)."""
    return round(index * 1e9 / fps)


def tidy_fps(fps: float) -> float:
    """The nominal rate (1/s) of a measured or stored one.

    Rates within 0.01 % of a whole number become that number, those within 0.01 % of a whole number
    * 1000/1001 (such as 29.97) become that product; others are rounded to 1/1000. A rate measured
    from stamps in ns and the container's own are then the same float.
    """
    for whole in (float(round(fps)), round(fps * 1.001) * 1000.0 / 1001.0):
        if whole > 0.0 and abs(fps - whole) < 1e-4 * whole:
            return whole
    return round(fps, 3)


def every_for_fps(source_fps: float, fps: float | None) -> int:
    """k such that every k-th frame of a source gives `fps` within `TOLERANCE`; 1 for None.

    Raises:
        ConfigError: no k gives it; names the nearest rates that one gives.
    """
    if fps is None:
        return 1
    if not 0.0 < fps * (1.0 - TOLERANCE) <= source_fps:
        raise ConfigError(
            f"fps {fps:g}: expected a rate above 0 and at most the source's {source_fps:g}"
        )
    every = max(1, round(source_fps / fps))
    if abs(source_fps / every - fps) > TOLERANCE * fps:
        below, above = int(source_fps // fps) + 1, max(1, int(source_fps // fps))
        raise ConfigError(
            f"fps {fps:g}: the source has {source_fps:g}, keeping every k-th frame gives "
            f"{source_fps / above:.6g} or {source_fps / below:.6g}"
        )
    return every
