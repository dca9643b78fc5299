"""Smoothing of a finished result without lag, and filling of gaps.

A Kalman filter with constant velocity, then the backward pass of Rauch, Tung and Striebel (AIAA
Journal 1965), for each parameter. The measurements' variances are those of the result, the spectral
density of the acceleration is r T (2 pi f)^4, r their median, T the period: for even variances
the gain at a frequency g is then 1 / (1 + (g / f)^4), that of a Butterworth filter of second order
passed forward and backward (Winter 2009, section 3.4.4).
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.compiled import kernel
from markerless_tracker.errors import ConfigError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.results.appended import not_written
from markerless_tracker.results.journal import Journal, open_summary
from markerless_tracker.results.pose_angles import PoseAngles
from markerless_tracker.results.read import read_result
from markerless_tracker.results.stored_result import StoredResult
from markerless_tracker.results.trc_stream import TrcStream

CUTOFF_HZ = 6.0
"""Usual cutoff for joint positions in walking (Winter 2009)."""
LEAST_CUTOFF_HZ = 0.1
FILL_CUTOFF_HZ = 15.0
"""Cutoff if gaps are filled without smoothing, so that frames beside a gap hardly change."""
_RUN_GAP_S = 0.3
# Largest ratio of variances, which limits the weights of single frames.
_VARIANCE_RATIO = 10.0
_UNKNOWN_SD = 0.02
_TURN_RAD, _TURN_DEG = 2.0 * np.pi, 360.0
_STEP = 1e-6
# Stamps are rounded: gaps longer by less than that count as equally long.
_TIME_TOLERANCE_S = 1e-6


@dataclass(frozen=True)
class Smoothing:
    """Settings of the smoothing of a finished result.

    Attributes:
        cutoff_hz: cutoff frequency; None leaves frames with a pose as they are.
        fill_s: longest gap that is filled, s; 0 for none.

    Raises:
        ConfigError: a value is impossible.
    """

    cutoff_hz: float | None = CUTOFF_HZ
    fill_s: float = 0.0

    def __post_init__(self) -> None:
        if self.cutoff_hz is not None and not LEAST_CUTOFF_HZ <= self.cutoff_hz < np.inf:
            raise ConfigError(
                f"smooth is {self.cutoff_hz:g} Hz, expected from {LEAST_CUTOFF_HZ:g} to half the "
                "rate of the frames"
            )
        if not 0.0 <= self.fill_s <= 10.0:
            raise ConfigError(f"fill-gaps is {self.fill_s} s, expected from 0 to 10")

    def check_rate(self, fps: float) -> None:
        """Check that frames at a rate (1/s) can show motion at the cutoff frequency.

        They show no motion above half their rate (Nyquist).

        Raises:
            ConfigError: the cutoff is above half the rate.
        """
        if self.cutoff_hz is not None and self.cutoff_hz > 0.5 * fps:
            raise ConfigError(
                f"smooth is {self.cutoff_hz:g} Hz, expected from {LEAST_CUTOFF_HZ:g} to "
                f"{0.5 * fps:g}, half the rate of the frames ({fps:g} frames/s)"
            )


@kernel
def rts(times, values, variances, density, work, out, out_variance):  # type: ignore[no-untyped-def]
    """Fill out (n,) and out_variance (n,) with the smoothed values of one parameter.

    Args:
        times: (n,) increasing, s.
        values: (n,) measured; NaN = none.
        variances: (n,) of the measurements.
        density: spectral density of the acceleration.
        work: (n, 10) filtered mean and covariance (position, velocity), then the predicted ones.
    """
    n = times.size
    m, p, ahead, ahead_p = work[:, :2], work[:, 2:5], work[:, 5:7], work[:, 7:]
    x, v = values[0], 0.0
    a, b, c = variances[0], 0.0, 1e6 * variances[0]
    for i in range(n):
        if i > 0:
            t = times[i] - times[i - 1]
            x = x + t * v
            a = a + 2.0 * t * b + t * t * c + density * t * t * t / 3.0
            b = b + t * c + density * t * t / 2.0
            c = c + density * t
        ahead[i, 0], ahead[i, 1] = x, v
        ahead_p[i, 0], ahead_p[i, 1], ahead_p[i, 2] = a, b, c
        if i > 0 and np.isfinite(values[i]):
            gain = 1.0 / (a + variances[i])
            k, h = a * gain, b * gain
            off = values[i] - x
            x, v = x + k * off, v + h * off
            c = c - h * b
            a, b = (1.0 - k) * a, (1.0 - k) * b
        m[i, 0], m[i, 1] = x, v
        p[i, 0], p[i, 1], p[i, 2] = a, b, c
    out[n - 1], out_variance[n - 1] = x, a
    for i in range(n - 2, -1, -1):
        t = times[i + 1] - times[i]
        # Gain = filtered covariance * transition' * inverse of the predicted covariance.
        a1, b1, c1 = ahead_p[i + 1, 0], ahead_p[i + 1, 1], ahead_p[i + 1, 2]
        scale = 1.0 / (a1 * c1 - b1 * b1)
        f00, f01 = p[i, 0] + t * p[i, 1], p[i, 1]
        f10, f11 = p[i, 1] + t * p[i, 2], p[i, 2]
        g00, g01 = (f00 * c1 - f01 * b1) * scale, (f01 * a1 - f00 * b1) * scale
        g10, g11 = (f10 * c1 - f11 * b1) * scale, (f11 * a1 - f10 * b1) * scale
        dx, dv = x - ahead[i + 1, 0], v - ahead[i + 1, 1]
        x, v = m[i, 0] + g00 * dx + g01 * dv, m[i, 1] + g10 * dx + g11 * dv
        da, db, dc = a - a1, b - b1, c - c1
        a = p[i, 0] + g00 * g00 * da + 2.0 * g00 * g01 * db + g01 * g01 * dc
        b = p[i, 1] + g00 * (g10 * da + g11 * db) + g01 * (g10 * db + g11 * dc)
        c = p[i, 2] + g10 * g10 * da + 2.0 * g10 * g11 * db + g11 * g11 * dc
        out[i], out_variance[i] = x, a


def smooth_result(name: Path, smoothing: Smoothing) -> int:
    """Smooth a finished result in place: NAME.trc and NAME.json.

    Frames in a gap of at most `fill_s` between two tracked ones get a pose, `filled` in NAME.json
    and deviations that grow towards the middle of the gap; their state does not change. Frames with
    a pose keep their deviations: errors of neighbouring frames are correlated, so that a mean over
    them is hardly more certain. Each smoothed frame has `velocities_m_s` by marker. Longer gaps
    divide the result: nothing is smoothed across them.

    Args:
        name: path of the result without suffix.
        smoothing: what to do.

    Returns:
        Number of frames filled.

    Raises:
        DatasetError: the result cannot be read or written; it has not changed then.
    """
    result = read_result(name)
    changed, filled = smoothed(result, smoothing)
    head, frames = open_summary(name)
    path, json_path = name.with_name(name.name + ".trc"), name.with_name(name.name + ".json")
    partial = name.with_name(f".{name.name}.smoothed")
    trc_path, journal_path = partial.with_name(f"{partial.name}.trc"), partial
    try:
        journal = Journal(journal_path)
        settings = {"cutoff_hz": smoothing.cutoff_hz, "fill_gaps_s": smoothing.fill_s}
        journal.add({**head, "smoothing": {**settings, "filled": int(filled.sum())}})
        trc = TrcStream(trc_path, result.marker_names, result.fps)
        kept = read_result(name, keep_lost=True).positions_m
        speeds = changed.velocities_m_s()
        for row, frame in enumerate(frames):
            journal.add({**frame, **_updates(changed, filled, speeds, row)})
            known = np.isfinite(changed.positions_m[row]).all()
            positions = changed.positions_m[row] if known else kept[row]
            trc.add(int(changed.stamps_ns[row]), positions, result.fps)
        trc.finish(result.fps, path.name)
        journal.compose(json_path)
        os.replace(trc_path, path)
    except OSError as error:
        raise not_written(path, error) from error
    finally:
        for left in (journal_path, trc_path):
            left.unlink(missing_ok=True)
    return int(filled.sum())


def smoothed(result: StoredResult, smoothing: Smoothing) -> tuple[StoredResult, NDArray[np.bool_]]:
    """A result with smoothed parameters, angles and positions, and which frames (n,) are filled."""
    body = result.body()
    reader = PoseAngles(body)
    parameters, sd = np.array(result.parameters), np.array(result.parameters_sd)
    angles = np.array(result.angles_deg)
    positions, positions_sd = np.array(result.positions_m), np.array(result.positions_sd_m)
    known = np.asarray(np.isfinite(parameters).all(axis=1))
    filled = np.zeros(len(result), dtype=np.bool_)
    periods = np.full(body.size, _TURN_RAD)
    periods[body.translations] = np.inf
    cutoff = FILL_CUTOFF_HZ if smoothing.cutoff_hz is None else smoothing.cutoff_hz
    for run in _runs(result.times_s, known, max(_RUN_GAP_S, smoothing.fill_s)):
        wanted = known[run] & (smoothing.cutoff_hz is not None)
        gaps = _short_gaps(result.times_s[run], known[run], smoothing.fill_s)
        filled[run] = gaps
        times, rows = result.times_s[run], np.flatnonzero(wanted | gaps) + run.start
        found, variance = _smoothed_columns(
            times, result.parameters[run], result.parameters_sd[run], periods, cutoff
        )
        inside = rows - run.start
        parameters[rows] = found[inside]
        own = np.flatnonzero(gaps)
        sd[own + run.start] = np.sqrt(variance[own])
        if angles.shape[1]:
            turns = np.full(angles.shape[1], _TURN_DEG)
            nothing = np.full_like(result.angles_deg[run], np.nan)
            angles[rows] = _smoothed_columns(times, result.angles_deg[run], nothing, turns, cutoff)[
                0
            ][inside]
        for row in rows.tolist():
            if result.angle_names == reader.names:
                angles[row] = _angles_of(reader, parameters[row], angles[row])
            positions[row] = markers(body, parameters[row])
            if filled[row]:
                positions_sd[row] = _markers_sd(body, parameters[row], sd[row])
    return (
        result.with_arrays(
            parameters=parameters,
            parameters_sd=sd,
            angles_deg=angles,
            positions_m=positions,
            positions_sd_m=positions_sd,
            filled=result.filled | filled,
        ),
        filled,
    )


def _angles_of(reader: PoseAngles, pose: FloatArray, smoothed_deg: FloatArray) -> FloatArray:
    """Angles (k,) of a smoothed pose, degrees; at a singularity those smoothed by themselves."""
    near = np.deg2rad(smoothed_deg)
    return np.rad2deg(near + reader.apart(near) * (reader.read(pose, near) - near))


def _runs(times_s: FloatArray, known: NDArray[np.bool_], gap_s: float) -> Iterator[slice]:
    """Slices that begin and end with a known frame and contain no gap longer than `gap_s`."""
    rows = np.flatnonzero(known)
    if not rows.size:
        return
    breaks = np.flatnonzero(np.diff(times_s[rows]) > gap_s + _TIME_TOLERANCE_S)
    firsts = rows[np.concatenate([[0], breaks + 1])]
    lasts = rows[np.concatenate([breaks, [rows.size - 1]])]
    for first, last in zip(firsts.tolist(), lasts.tolist(), strict=True):
        yield slice(first, last + 1)


def _short_gaps(times_s: FloatArray, known: NDArray[np.bool_], fill_s: float) -> NDArray[np.bool_]:
    """(n,) frames without a pose in gaps, between known frames, of at most `fill_s`."""
    rows = np.flatnonzero(known)
    after = np.searchsorted(rows, np.arange(known.size)).clip(1, max(rows.size - 1, 1))
    if rows.size < 2:
        return np.zeros_like(known)
    duration = times_s[rows[after]] - times_s[rows[after - 1]]
    return np.asarray(~known & (duration <= fill_s + _TIME_TOLERANCE_S))


def _smoothed_columns(
    times_s: FloatArray, values: FloatArray, sd: FloatArray, turns: FloatArray, cutoff_hz: float
) -> tuple[FloatArray, FloatArray]:
    """Smoothed values and variances (n, k) of k columns; the first and last row are known."""
    out, variance = np.empty((2, *values.shape))
    work = np.empty((len(values), 10))
    known = np.isfinite(values).all(axis=1)
    for column in range(values.shape[1]):
        line = np.array(values[:, column])
        if np.isfinite(turns[column]):
            line[known] = np.unwrap(line[known], period=turns[column])
        measured = np.where(np.isfinite(sd[:, column]), sd[:, column], np.nan) ** 2
        usual = np.nanmedian(measured) if np.isfinite(measured).any() else _UNKNOWN_SD**2
        usual = max(float(usual), 1e-12)
        weights = np.where(np.isfinite(measured), measured, usual)
        weights = weights.clip(usual / _VARIANCE_RATIO, usual * _VARIANCE_RATIO)
        density = usual * (2.0 * np.pi * cutoff_hz) ** 4
        # Measurements of variance r each period T have the spectral density r T.
        step = float(np.median(np.diff(times_s))) if len(times_s) > 1 else 1.0
        rts(times_s, line, weights, density * step, work, out[:, column], variance[:, column])
    return out, variance


def _markers_sd(body: BodyModel, pose: FloatArray, sd: FloatArray) -> FloatArray:
    """(15, 3) deviations of the markers in m from independent ones of the parameters (p,)."""
    at = markers(body, pose)
    variance = np.zeros_like(at)
    for index, deviation in enumerate(sd.tolist()):
        moved = pose.copy()
        moved[index] += _STEP
        variance += ((markers(body, moved) - at) / _STEP * deviation) ** 2
    return np.asarray(np.sqrt(variance))


def _updates(
    result: StoredResult, filled: NDArray[np.bool_], speeds: FloatArray, row: int
) -> dict[str, Any]:
    """The changed values of a frame's entry in the JSON file."""
    if not np.isfinite(result.parameters[row]).all():
        return {}
    names = result.marker_names
    entry: dict[str, Any] = {"parameters": result.parameters[row].tolist()}
    if result.angle_names and np.isfinite(result.angles_deg[row]).all():
        rounded = np.round(result.angles_deg[row], 2).tolist()
        entry["angles"] = dict(zip(result.angle_names, rounded, strict=True))
    if filled[row]:
        in_mm = np.round(result.positions_sd_m[row] * 1000.0, 2).tolist()
        entry["filled"] = True
        entry["parameters_sd"] = np.round(result.parameters_sd[row], 5).tolist()
        entry["markers_sd_mm"] = dict(zip(names, in_mm, strict=True))
    if np.isfinite(speeds[row]).all():
        rounded = np.round(speeds[row], 4).tolist()
        entry["velocities_m_s"] = dict(zip(names, rounded, strict=True))
    return entry
