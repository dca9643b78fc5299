"""All checks of a recording: findings and advice."""

from collections.abc import Callable, Mapping

import numpy as np

from markerless_tracker.camera import CameraModel, CameraRig, project_camera
from markerless_tracker.camera.doubts import calibration_doubts
from markerless_tracker.checks.finding import GREEN, RED, YELLOW, Finding, grade, worse
from markerless_tracker.checks.in_step import find_offsets
from markerless_tracker.checks.scene import moved_px, unlike_share
from markerless_tracker.checks.signals import CameraSignals, read_signals
from markerless_tracker.datasets import Recording
from markerless_tracker.geometry import FloatArray

OUT_OF_STEP = (0.8, 1.6)
"""Limits (yellow, red) of a camera's offset in frames. Above the second, it is out of step."""
GAINED = 0.06
"""An offset counts if it raises the correlation by more than this."""
UNLIKE = (0.12, 0.30)
"""Limits of the share of pixels beside the person that differ from the empty scene."""
MOVED_PX = (0.6, 1.5)
"""Limits of the shift of the scene against its background, at the size checked."""
GAINS = (0.12, 0.45)
"""Limits of the relative range of brightness over the recording."""
HEIGHTS_PX = (150.0, 80.0)
"""Lower limits of the height of the person in an image. Below the second, it is too small."""
STATURE_M = 1.8
LEAST_CAMERAS = 3


def check_recording(
    recording: Recording, *, progress: Callable[[int, int | None], None] | None = None
) -> list[Finding]:
    """Check a recording before tracking.

    Raises:
        DatasetError, ImageError: images or backgrounds cannot be read.
    """
    found = [
        Finding("calibration", RED, "", doubt.removeprefix("calibration: "),
                "correct calibration.toml, or make it anew with `calibrate`")
        for doubt in calibration_doubts(recording.rig)
    ]  # fmt: skip
    if len(recording.rig) == 1:
        found.append(
            Finding("calibration", RED, "", "one camera",
                    "add cameras: a person is found from two on, at best with four")
        )  # fmt: skip
    if not found:
        found.append(Finding("calibration", GREEN, "", f"{len(recording.rig)} cameras, plausible"))
        found.append(_middle(recording.rig))
    signals = read_signals(recording, progress=progress)
    found += [
        Finding("recording", YELLOW, "", text, "see whether the files are whole")
        for text in recording.warnings
    ]
    found += _steps(signals, recording.fps)
    for name, signal in signals.items():
        found.append(_background(name, signals))
        found.append(_light(name, signal))
        found.append(_height(name, signal))
    return found


def _middle(rig: CameraRig) -> Finding:
    """Counts the cameras that see a person standing in the middle of the floor."""
    middle = floor_middle(rig)
    missing = [camera.name for camera in rig if not _sees_person(camera, middle)]
    seeing = len(rig) - len(missing)
    where = f"({middle[0]:.2f}, {middle[1]:.2f}) m"
    text = f"{seeing} of {len(rig)} cameras see a person of {STATURE_M:g} m at {where}"
    if seeing >= min(LEAST_CAMERAS, len(rig)) and seeing >= 2:
        return Finding("views", GREEN, "", text)
    return Finding(
        "views", RED, ", ".join(missing), text,
        f"aim the cameras at one place, from farther away: {LEAST_CAMERAS} or more must see the "
        "whole person there",
    )  # fmt: skip


def floor_middle(rig: CameraRig) -> FloatArray:
    """Middle of the floor (3,), m, world frame.

    The point nearest to all optical axes, projected onto the floor.
    """
    normal, right = np.zeros((3, 3)), np.zeros(3)
    for camera in rig:
        placed = camera.T_world_cam
        across = np.eye(3) - np.outer(placed[:3, 2], placed[:3, 2])
        normal += across
        right += across @ placed[:3, 3]
    point = np.linalg.lstsq(normal, right, rcond=None)[0]
    return np.array([point[0], point[1], 0.0])


def _sees_person(camera: CameraModel, foot_m: FloatArray) -> bool:
    ends = foot_m + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, STATURE_M]])
    pixels = project_camera(ends, camera)
    inside = (pixels >= 0.0) & (pixels < np.array(camera.size_px))
    return bool(np.isfinite(pixels).all() and inside.all())


def _steps(signals: Mapping[str, CameraSignals], fps: float) -> list[Finding]:
    if len(signals) < 2:
        return []
    offsets = find_offsets({name: signal.motion for name, signal in signals.items()}, fps)
    found = []
    for name in signals:
        if name not in offsets.frames:
            found.append(
                Finding(
                    "in step",
                    YELLOW,
                    name,
                    "its motion resembles that of no other camera: not decided",
                    "record a few seconds in which the person moves briskly",
                )  # fmt: skip
            )
            continue
        late, agree = offsets.frames[name], offsets.correlation[name]
        state = grade(abs(late), OUT_OF_STEP) if offsets.gained[name] > GAINED else GREEN
        if state == GREEN:
            text = f"in step with the others (correlation {agree:.2f})"
            found.append(Finding("in step", GREEN, name, text))
            continue
        best = round(late)
        every = [best, *sorted(set(offsets.others[name]) - {0, best}, key=abs)]
        listed = " or ".join(f"{frames:+d}" for frames in every[:3])
        found.append(
            Finding(
                "in step",
                state,
                name,
                f"shows the motion {listed} frames late (correlation {agree:.2f})",
                f"start the cameras together, or track with --time-offsets {name}="
                f"{-every[0] / fps:.3f}",
            )  # fmt: skip
        )
    return found


def _background(name: str, signals: Mapping[str, CameraSignals]) -> Finding:
    signal = signals[name]
    if len(signal.kinds) > 1:
        return Finding(
            "background", RED, name, "its images and its background are partly grey, partly in "
            "colour", "store all of them in colour, or all as grey images",
        )  # fmt: skip
    if signal.background is None:
        return Finding(
            "background", YELLOW, name, "no empty-scene image",
            f"put an image of the scene without the person at background/{name}.png",
        )  # fmt: skip
    gain = float(np.median(signal.gain))
    share = unlike_share(signal.scene, gain * signal.background)
    for other, theirs in signals.items():
        if other == name or theirs.background is None or share < UNLIKE[0]:
            continue
        if theirs.background.shape == signal.scene.shape:
            exchanged = unlike_share(signal.scene, theirs.background)
            if exchanged < 0.5 * share:
                return Finding(
                    "background", RED, name, f"its scene is that of {other}'s background",
                    "exchange the files in background/",
                )  # fmt: skip
    moved = moved_px(signal.scene, signal.background)
    state = worse(grade(share, UNLIKE), grade(moved, MOVED_PX))
    text = f"{share:.0%} of the scene differs from it, shifted by {moved:.1f} px"
    if state == GREEN:
        return Finding("background", GREEN, name, text)
    return Finding(
        "background", state, name, text + f" (at {signal.scene.shape[1]} px width)",
        "take the empty-scene image anew: camera, furniture and lamps as in the recording",
    )  # fmt: skip


def _light(name: str, signal: CameraSignals) -> Finding:
    low, high = np.quantile(signal.gain, [0.02, 0.98])
    change = float(high / max(low, 1e-3) - 1.0)
    text = f"brightness varies by {change:.0%}"
    state = grade(change, GAINS)
    if state == GREEN:
        return Finding("light", GREEN, name, text)
    return Finding(
        "light", state, name, text, "fix exposure, gain and white balance; keep clouds out"
    )


def _height(name: str, signal: CameraSignals) -> Finding:
    seen = signal.height_px[signal.height_px > 0.0]
    if len(seen) < 0.2 * len(signal.height_px):
        return Finding(
            "person", YELLOW, name, "nobody is seen in most frames",
            "look whether the person is in view, and whether the background is without them",
        )  # fmt: skip
    height = float(np.median(seen))
    text = f"about {height:.0f} px tall"
    if height >= HEIGHTS_PX[0]:
        return Finding("person", GREEN, name, text)
    state = YELLOW if height >= HEIGHTS_PX[1] else RED
    return Finding(
        "person", state, name, text,
        f"expected {HEIGHTS_PX[0]:.0f} or more: larger images, or the camera nearer",
    )  # fmt: skip
