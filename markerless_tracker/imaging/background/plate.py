"""An image of the empty scene, composed of clips and photographs in which people appear."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging.background.align import align_exposure, align_geometry
from markerless_tracker.imaging.background.steady import (
    ALONE_SHARE,
    matching_frames,
    motion,
    steady_image,
    thinned,
)
from markerless_tracker.imaging.images import FloatImage, Image, check_image
from markerless_tracker.imaging.masks import SOLID
from markerless_tracker.records import locked

BoolImage = NDArray[np.bool_]

# Number of frames kept of all clips together: enough for a mode, and within memory.
_FRAMES = 36
# Largest difference of pictures that show the same object, grey levels.
_TOLERANCE = 14.0
# Larger changes from frame to frame are due to a body, smaller ones may be due to light; grey
# levels.
_ABRUPT = 28.0
# A pixel that is covered for a larger fraction of the time shows the person in the steady image.
_RESTLESS = 0.15
# A frame is calm around a pixel if less than this fraction of the known pixels there differs.
_CALM = 0.05
# A value belongs to the scene if it appears in this fraction of the frames calm around the pixel.
_OFTEN = 0.35
# Size of the neighbourhood of a pixel, relative to the image's longer side.
_WINDOW = 0.03
# Values seen in a smaller fraction of the frames are discarded.
_SEEN_SHARE = 0.05


@dataclass(frozen=True, eq=False)
class Plate:
    """The empty scene.

    Attributes:
        image: (h, w) or (h, w, 3) uint8, in the geometry and exposure of the first clip (or still).
        unsure: (h, w) bool, pixels known from one source only, while others disagree.
        note: the sources, and what they imply.
    """

    image: Image
    unsure: BoolImage
    note: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "image", locked(self.image, np.uint8))
        object.__setattr__(self, "unsure", locked(self.unsure, np.bool_))


def background_plate(
    clips: Sequence[Iterable[Image]] | Mapping[str, Iterable[Image]] = (),
    stills: Sequence[Image] = (),
    *,
    camera: str = "background",
) -> Plate:
    """Compose the empty scene of one camera from clips and stills in which people appear.

    Where nothing moves in the clips, they show the scene: an object that never moves is furniture.
    Where something moves, the scene is
    (a) the value of a still that the clips show at some time;
    (b) else the value of the clips while everything around it is known to be scene;
    (c) else the value of a still: the person never uncovers it in the clips;
    (d) without stills, the steadiest value of the clips.
    A still may differ in size, exposure and, slightly, in alignment. People in it have no effect
    where the clips are calm or uncover the floor.

    Args:
        clips: frames of each clip, all of one camera; the first clip defines size and exposure.
        stills: photographs of the scene.
        camera: name for error messages.

    Raises:
        ImageError: neither clips nor stills, or frames of different sizes or channels.
    """
    sequences = list(clips.values()) if isinstance(clips, Mapping) else list(clips)
    frames = _clip_frames(sequences, camera)
    for number, still in enumerate(stills):
        check_image(still, f"{camera}: still {number}")
    if not frames and not stills:
        raise ImageError(f"{camera}: neither a clip nor a still came, expected at least one frame")
    reference = frames[0][0] if frames else stills[0]
    for number, still in enumerate(stills):
        if still.ndim != reference.ndim:
            raise ImageError(
                f"{camera}: still {number} is {still.shape}, expected channels as in "
                f"{reference.shape}"
            )
    if not frames:
        return _from_stills(stills)
    stack = _stack(frames)
    alone = len(frames) == 1 and not stills
    steady, _ = steady_image(stack, share=ALONE_SHARE) if alone else steady_image(stack)
    guide = np.clip(np.rint(steady), 0, 255).astype(np.uint8).reshape(reference.shape)
    pictures = [align_exposure(_float(align_geometry(still, guide)), steady) for still in stills]
    if not pictures:
        note = (
            f"{len(stack)} frames of {len(frames)} clip(s), no still: places that the "
            "person covers for most of the time show the person"
        )
        return _finish(steady, np.zeros(steady.shape[:2], dtype=bool), reference, note)
    filled, unsure = _fill(stack, steady, pictures)
    note = (
        f"{len(stack)} frames of {len(frames)} clip(s) and {len(stills)} still(s); "
        f"{float(unsure.mean()):.1%} of the image is known from a still alone"
    )
    return _finish(filled, unsure, reference, note)


def _clip_frames(sequences: Sequence[Iterable[Image]], camera: str) -> list[list[Image]]:
    """A few evenly spread frames of each clip that has any; raises as `background_plate`."""
    frames: list[list[Image]] = []
    share = max(2, _FRAMES // max(1, len(sequences)))
    for number, sequence in enumerate(sequences):
        chosen: list[Image] = []
        for index, frame in thinned(sequence, share):
            what = f"{camera}: clip {number}, frame {index}"
            check_image(frame, what)
            first = frames[0][0] if frames else chosen[0] if chosen else frame
            if frame.shape != first.shape:
                raise ImageError(
                    f"{what}: got an image of {frame.shape}, the first was {first.shape}"
                )
            chosen.append(frame)
        if chosen:
            frames.append(chosen)
    return frames


def _float(image: Image) -> FloatImage:
    """The image as (h, w, c) float32."""
    return image.reshape(image.shape[0], image.shape[1], -1).astype(np.float32)


def _stack(frames: list[list[Image]]) -> Image:
    """(n, h, w, c): all clips, adjusted to the exposure of the first."""
    parts = [np.stack(clip).reshape(len(clip), *clip[0].shape[:2], -1) for clip in frames]
    if len(parts) == 1:
        return np.asarray(parts[0])
    base, _ = steady_image(parts[0])
    for index in range(1, len(parts)):
        own, _ = steady_image(parts[index])
        shift = align_exposure(own, base) - own
        parts[index] = np.clip(np.rint(parts[index] + shift), 0, 255).astype(np.uint8)
    return np.concatenate(parts)


def _covered(
    share: FloatImage, jump: FloatImage, steady: FloatImage, picture: FloatImage
) -> BoolImage:
    """Pixels where the clips show a person and the still does not: they differ, and the clips move.

    Motion is averaged over the neighbourhood that differs: plain clothes show motion at their
    outline only, and an arm that briefly passes over a person in the still has little weight.
    """
    apart = np.abs(picture - steady).max(axis=2)
    differ = (apart > _TOLERANCE).astype(np.uint8)
    differ = np.asarray(cv2.morphologyEx(differ, cv2.MORPH_OPEN, SOLID))
    weight = differ.astype(np.float32)
    sigma = _WINDOW * max(differ.shape)
    restless = share * (jump > _ABRUPT) * weight
    blurred = cv2.GaussianBlur(restless, (0, 0), sigma)
    mass = cv2.GaussianBlur(weight, (0, 0), sigma)
    covered = ((differ > 0) & (blurred > _RESTLESS * mass)).astype(np.uint8)
    # The blurred border of a person differs less than the person.
    return np.asarray(
        (cv2.dilate(covered, np.ones((5, 5), np.uint8)) > 0) & (apart > 0.5 * _TOLERANCE)
    )


def _fill(
    stack: Image, steady: FloatImage, pictures: list[FloatImage]
) -> tuple[FloatImage, BoolImage]:
    """Replace moving people by the stills; returns the plate, and pixels known from stills only."""
    share, jump = motion(stack, steady, _TOLERANCE)
    least = max(2.0, _SEEN_SHARE * len(stack))
    filled = steady.copy()
    best = np.zeros(steady.shape[:2])
    covered = np.zeros(steady.shape[:2], dtype=bool)
    doubtful = covered.copy()
    for index, picture in enumerate(pictures):
        matches, mean = matching_frames(stack, picture, _TOLERANCE)
        others = sum(
            (np.abs(picture - other).max(axis=2) <= _TOLERANCE).astype(float)
            for place, other in enumerate(pictures)
            if place != index
        )
        seen = matches >= least
        here = _covered(share, jump, steady, picture)
        score = 0.1 + np.where(seen, matches, 0.0) + 0.5 * least * others
        better = here & (score > best)
        filled[better] = np.where(seen[:, :, None], mean, picture)[better]
        best[better] = score[better]
        covered |= here
        doubtful |= (np.abs(picture - steady).max(axis=2) > 2.0 * _TOLERANCE) & ~here
    if not covered.any():
        return filled, covered
    return _grow(stack, filled, steady, covered, doubtful)


def _grow(
    stack: Image, filled: FloatImage, steady: FloatImage, covered: BoolImage, doubtful: BoolImage
) -> tuple[FloatImage, BoolImage]:
    """Grow the known area inward, using frames in which all known pixels around are scene.

    Such frames confirm the still, or overrule it next to people in the still (``doubtful``), since
    a person in the still may stand behind the person in the clips.

    Returns:
        The plate, and the pixels where the clips neither confirmed nor overruled the still.
    """
    longer = max(covered.shape)
    side = max(5, round(0.25 * _WINDOW * longer) | 1)
    # Islands inside a covered area agree by chance only.
    brush = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * side + 1, 2 * side + 1))
    closed = cv2.morphologyEx(covered.astype(np.uint8), cv2.MORPH_CLOSE, brush)
    v, u = np.nonzero(closed)
    box = (
        slice(max(int(v.min()) - 3 * side, 0), int(v.max()) + 3 * side + 1),
        slice(max(int(u.min()) - 3 * side, 0), int(u.max()) + 3 * side + 1),
    )
    plate, unknown = filled[box].copy(), closed[box] > 0
    frames, doubt = stack[:, box[0], box[1]], doubtful[box].copy()
    person = steady[box]
    far = np.stack([np.abs(frame - plate).max(axis=2) > _TOLERANCE for frame in frames])
    wide = 2 * side + 1
    square = np.ones((side, side), dtype=np.uint8)
    for _ in range(4 * max(unknown.shape) // side):
        known = (~unknown).astype(np.float32)
        front = np.nonzero(unknown & (cv2.boxFilter(known, -1, (side, side)) > 0.3))
        if not front[0].size:
            break
        mass = cv2.boxFilter(known, -1, (wide, wide))[front]
        calm = np.stack(
            [cv2.boxFilter(known * wrong, -1, (wide, wide))[front] < _CALM * mass for wrong in far]
        )
        agreeing = calm & ~far[:, front[0], front[1]]
        values = frames[:, front[0], front[1]].astype(np.float32)
        count, agreed_count = calm.sum(axis=0), agreeing.sum(axis=0)
        shown, same = _mean(values, calm), _mean(values, agreeing)
        # The steadiest value of the clips may be a person. It overrules a still only if it appears
        # often while everything around is scene, or if the shown value differs from it.
        apart = np.abs(shown - person[front]).max(axis=1) > 2.0 * _TOLERANCE
        suspect = cv2.dilate(doubt.astype(np.uint8), square)[front] > 0
        agreed = (agreed_count >= 2) & (agreed_count >= 0.5 * count)
        overruled = ~agreed & suspect & (count >= 2) & (apart | (count > _OFTEN * len(stack)))
        settled = agreed | overruled
        if not settled.any():
            break
        where = (front[0][settled], front[1][settled])
        plate[where] = np.where(agreed[:, None], same, shown)[settled]
        far[:, where[0], where[1]] = (
            np.abs(values[:, settled] - plate[where]).max(axis=2) > _TOLERANCE
        )
        doubt[front[0][overruled], front[1][overruled]] = True
        unknown[where] = False
    filled = filled.copy()
    filled[box] = np.where(covered[box][:, :, None], plate, filled[box])
    unsure = np.zeros_like(covered)
    unsure[box] = unknown & covered[box]
    return filled, unsure


def _mean(values: FloatImage, chosen: BoolImage) -> FloatImage:
    """Mean over chosen frames per pixel: values (n, k, c), chosen (n, k); 0 if none is chosen."""
    total = np.einsum("nkc,nk->kc", values, chosen.astype(np.float32))
    return np.asarray(total / np.maximum(chosen.sum(axis=0), 1)[:, None], dtype=np.float32)


def _from_stills(stills: Sequence[Image]) -> Plate:
    """The median of the stills; the first of two, with their differences marked as unsure."""
    reference = stills[0]
    base = _float(reference)
    if len(stills) == 1:
        unsure = np.zeros(base.shape[:2], dtype=bool)
        return Plate(reference.copy(), unsure, "one still, unchanged: people in it remain")
    aligned = [base] + [
        align_exposure(_float(align_geometry(still, reference)), base) for still in stills[1:]
    ]
    apart = (
        np.abs(np.stack([picture - base for picture in aligned[1:]])).max(axis=(0, 3)) > _TOLERANCE
    )
    if len(stills) == 2:
        note = "two stills, the first unchanged: where they differ, either may show a person"
        return Plate(reference.copy(), apart, note)
    median = np.median(np.stack(aligned), axis=0).astype(np.float32)
    note = f"median of {len(stills)} stills: a person at one place in half of them remains"
    return _finish(median, np.zeros_like(apart), reference, note)


def _finish(filled: FloatImage, unsure: BoolImage, reference: Image, note: str) -> Plate:
    image = np.clip(np.rint(filled), 0, 255).astype(np.uint8).reshape(reference.shape)
    return Plate(image, unsure, note)
