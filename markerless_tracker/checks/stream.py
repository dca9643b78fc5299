"""Checks of live image streams: rate, jitter, stamps, sharpness, exposure, background."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.checks.finding import GREEN, RED, YELLOW, Finding, grade, worse
from markerless_tracker.checks.pictures import small_grey
from markerless_tracker.checks.recording import MOVED_PX, UNLIKE
from markerless_tracker.checks.scene import moved_px, unlike_share
from markerless_tracker.imaging import Image

JITTERS = (0.25, 1.0)
"""Limits (yellow, red) of the jitter of arrival, 95th percentile in periods. Above the second, sets
get lost."""
AGES_S = (0.2, 1.0)
"""Limits of the age of images on arrival. Above the second, the clocks disagree or images queue."""
RECORDED_S = 3600.0
"""Stamps further than this from the current time are those of a recording."""
OUT_OF_STEP = 0.35
"""Offset between the cameras' stamps, in periods, above which they are out of step. With a smaller
one synchronisation needs a tolerance."""
CLIPPED = (0.05, 0.25)
"""Limits of the share of overexposed pixels."""
DARK = (40.0, 15.0)
"""Lower limits of the mean grey level. Below the second, the image is too dark."""
BLURRED = (0.6, 0.35)
"""Lower limits of the sharpness relative to the background. Below the second, the lens is out of
focus."""
_LEAST_IMAGES = 4


@dataclass(frozen=True, eq=False)
class CameraStream:
    """The images received from one camera.

    Attributes:
        topic: topic of its images.
        stamps_ns: stamps of the images received, in order of arrival.
        arrivals_s: times of arrival, of a monotonic clock.
        ages_s: time from each stamp to its arrival, by this machine's clock.
        images: some of the images, of one size.
        refused: number of unusable images.
        trouble: why the last unusable image was refused; empty if all were usable.
    """

    topic: str
    stamps_ns: Sequence[int]
    arrivals_s: Sequence[float]
    ages_s: Sequence[float]
    images: Sequence[Image]
    refused: int = 0
    trouble: str = ""


def check_streams(
    streams: Mapping[str, CameraStream],
    backgrounds: Mapping[str, Image],
    *,
    listened_s: float,
) -> list[Finding]:
    """Check every camera, and whether they run in step.

    Args:
        streams: by camera.
        backgrounds: empty scene of some of the cameras.
        listened_s: duration of listening.
    """
    found: list[Finding] = []
    heard = {name: stream for name, stream in streams.items() if stream.stamps_ns}
    for name, stream in streams.items():
        found.append(_rate(name, stream, listened_s))
        if stream.refused:
            found.append(
                Finding(
                    "images",
                    RED,
                    name,
                    f"{stream.refused} unusable: {stream.trouble}",
                    "make the driver send what the calibration and the background expect",
                )  # fmt: skip
            )
        if name not in heard:
            continue
        if len(stream.stamps_ns) >= _LEAST_IMAGES:
            found.append(_jitter(name, stream))
        found.append(_age(name, stream))
        if stream.images:
            found += _pictures(name, stream.images, backgrounds.get(name))
    found += _in_step(heard)
    return found


def _rate(name: str, stream: CameraStream, listened_s: float) -> Finding:
    count = len(stream.stamps_ns)
    if count < 2:
        what = "no image" if count == 0 else "one image"
        return Finding(
            "rate", RED, name, f"{what} on {stream.topic} in {listened_s:g} s",
            "start the camera's driver; compare the topic's name (`ros2 topic list`, image_topic) "
            "and ROS_DOMAIN_ID",
        )  # fmt: skip
    span_s = stream.arrivals_s[-1] - stream.arrivals_s[0]
    rate = (count - 1) / span_s if span_s > 0.0 else 0.0
    by_stamps = _period_s(stream)
    text = f"{rate:.1f} images/s"
    if by_stamps > 0.0:
        sent = 1.0 / by_stamps
        text += f", {sent:.1f} by their stamps"
        if rate < 0.9 * sent:
            return Finding(
                "rate", YELLOW, name, f"{text}: images get lost or are played slowly",
                "see `profile`, `socket buffers` and the load of both machines",
            )  # fmt: skip
    return Finding("rate", GREEN, name, text)


def _period_s(stream: CameraStream) -> float:
    """Median interval between stamps, s; 0 if it is unknown."""
    steps = np.diff(np.array(stream.stamps_ns, dtype=np.int64))
    return float(np.median(steps)) / 1e9 if len(steps) else 0.0


def _jitter(name: str, stream: CameraStream) -> Finding:
    period_s = _period_s(stream)
    if period_s <= 0.0:
        return Finding(
            "jitter", RED, name, "stamps repeat or run backwards",
            "the driver must stamp each image with its time of capture",
        )  # fmt: skip
    delays = np.diff(stream.arrivals_s) - np.diff(np.array(stream.stamps_ns)) / 1e9
    late = float(np.percentile(np.abs(delays), 95)) / period_s
    text = f"arrival varies by {1e3 * late * period_s:.1f} ms (95 %)"
    state = grade(late, JITTERS)
    if state == GREEN:
        return Finding("jitter", GREEN, name, text)
    return Finding(
        "jitter", state, name, f"{text}, images come every {1e3 * period_s:.1f} ms",
        "less load, a wired network, or compressed images; the tracker skips what comes late",
    )  # fmt: skip


def _age(name: str, stream: CameraStream) -> Finding:
    age_s = float(np.median(stream.ages_s))
    if abs(age_s) > RECORDED_S:
        return Finding("stamps", GREEN, name, "of a recording")
    text = f"{1e3 * age_s:.0f} ms old on arrival"
    state = grade(max(age_s, -10.0 * age_s), AGES_S)
    if state == GREEN:
        return Finding("stamps", GREEN, name, text)
    return Finding(
        "stamps", state, name, text,
        "make the machines' clocks agree (chrony, PTP); stamp images when they are captured",
    )  # fmt: skip


def _in_step(heard: Mapping[str, CameraStream]) -> list[Finding]:
    """Offset of each camera's stamps from the nearest ones of the first camera."""
    if len(heard) < 2:
        return []
    first = next(iter(heard))
    reference = np.array(heard[first].stamps_ns, dtype=np.int64)
    period_s = _period_s(heard[first])
    found = []
    for name, stream in heard.items():
        if name == first:
            continue
        nearest_s = _nearest_s(np.array(stream.stamps_ns, dtype=np.int64), reference, period_s)
        offset_s, apart_s = float(np.median(nearest_s)), np.abs(nearest_s)
        text = f"stamps {1e3 * offset_s:+.2f} ms from those of {first}"
        if apart_s.max() == 0.0:
            found.append(Finding("in step", GREEN, name, f"equal stamps to {first}"))
            continue
        if period_s <= 0.0 or abs(offset_s) >= OUT_OF_STEP * period_s:
            state = RED
            advice = "trigger the cameras together, or correct the stamps (`stamp_offsets`)"
        else:
            state, need_s = YELLOW, 1.2 * float(apart_s.max())
            advice = f"sync_tolerance:={max(need_s, 1e-4):.4f}, or `stamp_offsets`"
        found.append(Finding("in step", state, name, text, advice))
    return found


def _nearest_s(
    stamps_ns: NDArray[np.int64], reference_ns: NDArray[np.int64], period_s: float
) -> NDArray[np.float64]:
    """Time from the nearest reference stamp to each stamp, s.

    Left out are stamps whose counterpart was lost, or came before the first one that was received:
    they are more than half a period from any, and from the usual time.
    """
    apart = stamps_ns[:, None] - reference_ns[None, :]
    nearest_s = apart[np.arange(len(apart)), np.abs(apart).argmin(axis=1)] / 1e9
    most_s = max(0.5 * period_s, float(np.median(np.abs(nearest_s))))
    return np.asarray(nearest_s[np.abs(nearest_s) <= most_s])


def _pictures(name: str, images: Sequence[Image], background: Image | None) -> list[Finding]:
    """Checks exposure, sharpness and background on some images."""
    small = [small_grey(image) for image in images]
    scene = np.median(np.array(small, dtype=np.float32), axis=0).astype(np.float64)
    found = [_exposure(name, small)]
    if background is None:
        text = f"{_sharpness(small[-1]):.1f} (no background to compare with)"
        return [*found, Finding("sharpness", GREEN, name, text)]
    empty = small_grey(background)
    if empty.shape != scene.shape:
        return [
            *found,
            Finding(
                "background", RED, name,
                f"of {background.shape[1]}x{background.shape[0]} px, images of "
                f"{images[-1].shape[1]}x{images[-1].shape[0]}",
                "take the empty-scene image anew with this camera",
            ),
        ]  # fmt: skip
    return [*found, _focus(name, small, empty), _background(name, scene, empty)]


def _exposure(name: str, small: Sequence[NDArray[np.uint8]]) -> Finding:
    last = small[-1]
    mean, clipped = float(last.mean()), float((last >= 250).mean())
    text = f"mean {mean:.0f}, {clipped:.0%} overexposed"
    dark = GREEN if mean >= DARK[0] else YELLOW if mean >= DARK[1] else RED
    state = worse(dark, grade(clipped, CLIPPED))
    if state == GREEN:
        return Finding("exposure", GREEN, name, text)
    return Finding("exposure", state, name, text, "correct and then fix exposure time and gain")


def _sharpness(grey: NDArray[np.uint8]) -> float:
    """Strength of fine detail: 90th percentile of the Laplacian, grey levels."""
    detail = np.abs(cv2.Laplacian(cv2.GaussianBlur(grey, (3, 3), 0), cv2.CV_32F))
    return float(np.percentile(detail, 90))


def _focus(name: str, small: Sequence[NDArray[np.uint8]], empty: NDArray[np.uint8]) -> Finding:
    ratio = float(np.median([_sharpness(image) for image in small])) / max(_sharpness(empty), 1e-3)
    text = f"{ratio:.2f} of the background's"
    state = GREEN if ratio >= BLURRED[0] else YELLOW if ratio >= BLURRED[1] else RED
    if state == GREEN:
        return Finding("sharpness", GREEN, name, text)
    return Finding("sharpness", state, name, text, "focus the lens, clean it, see what covers it")


def _background(name: str, scene: NDArray[np.float64], empty: NDArray[np.uint8]) -> Finding:
    base = empty.astype(np.float64)
    usable = (base > 20.0) & (base < 240.0)
    gain = float(np.median(scene[usable] / base[usable])) if usable.any() else 1.0
    share, moved = unlike_share(scene, gain * base), moved_px(scene, base)
    text = f"{share:.0%} of the scene differs from it, shifted by {moved:.1f} px, light x{gain:.2f}"
    state = worse(grade(share, UNLIKE), grade(moved, MOVED_PX))
    if state == GREEN:
        return Finding("background", GREEN, name, text)
    return Finding(
        "background", state, name, text,
        "learn it anew (~/learn_background, or new empty-scene images); if the camera was moved, "
        "calibrate anew, too",
    )  # fmt: skip
