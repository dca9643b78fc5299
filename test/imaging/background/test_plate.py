from pathlib import Path

import cv2
import numpy as np
import pytest

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging import background_plate

SIZE = (180, 240)


def empty_room() -> np.ndarray:
    rng = np.random.default_rng(11)
    image = np.zeros((SIZE[1], SIZE[0], 3), np.float32)
    for cells in (4, 12, 40):
        grid = rng.uniform(20, 235, (cells * 4 // 3 + 1, cells, 3)).astype(np.float32)
        image += cv2.resize(grid, SIZE, interpolation=cv2.INTER_CUBIC)
    return np.clip(image / 3.0, 0, 255).astype(np.uint8)


def stand(image: np.ndarray, at: tuple[float, float], *, seed: int = 0) -> np.ndarray:
    """A textured person centred there."""
    rng = np.random.default_rng(seed)
    texture = cv2.resize(rng.integers(0, 256, (18, 8, 3)).astype(np.uint8), (32, 72))
    stamp = np.zeros((72, 32), np.uint8)
    cv2.ellipse(stamp, (16, 36), (14, 34), 0, 0, 360, 255, -1)
    moved = np.array([[1.0, 0.0, at[0] - 16.0], [0.0, 1.0, at[1] - 36.0]])
    mask = cv2.warpAffine(stamp, moved, SIZE) > 127
    result = image.copy()
    result[mask] = cv2.warpAffine(texture, moved, SIZE)[mask]
    return result


def clip(room: np.ndarray, *, sway: float = 12.0, count: int = 30) -> list[np.ndarray]:
    """A person sways on the spot and never uncovers the middle."""
    rng = np.random.default_rng(3)
    frames = []
    for t in range(count):
        frame = stand(room, (100.0 + sway * np.sin(0.45 * t), 130.0 + 3.0 * np.cos(0.7 * t)))
        frames.append(
            np.clip(np.rint(frame + rng.normal(0, 1.5, frame.shape)), 0, 255).astype(np.uint8)
        )
    return frames


def wrong(image: np.ndarray, room: np.ndarray) -> float:
    """Fraction of the pixels that are not the room's."""
    blurred = cv2.GaussianBlur(image, (3, 3), 0).astype(float)
    truth = cv2.GaussianBlur(room, (3, 3), 0)
    return float((np.abs(blurred - truth).max(axis=2) > 25).mean())


def test_a_still_with_the_person_elsewhere_uncovers_what_the_clip_never_shows() -> None:
    room = empty_room()
    still = stand(room, (40.0, 60.0), seed=5)
    cv2.line(still, (40, 40), (40, 80), (0, 0, 255), 3)
    frames = clip(room, sway=6.0)
    plate = background_plate([frames], [still])
    assert wrong(plate.image, room) < 0.003
    assert wrong(background_plate([frames]).image, room) > 0.01
    assert "1 still" in plate.note and not plate.image.flags.writeable


def test_a_still_of_another_exposure_and_size() -> None:
    room = empty_room()
    still = stand(room, (150.0, 190.0), seed=5)
    still = np.clip(still * np.array([0.93, 1.02, 1.06]) + 5.0, 0, 255).astype(np.uint8)
    still = cv2.resize(still, (190, 240), interpolation=cv2.INTER_CUBIC)
    plate = background_plate({"first": iter(clip(room))}, [still])
    assert plate.image.shape == room.shape
    assert wrong(plate.image, room) < 0.01


def test_two_people_in_the_same_place_at_different_times() -> None:
    """The still's person stands partly behind the place that the clip's person leaves."""
    room = empty_room()
    still = stand(room, (122.0, 118.0), seed=5)
    frames = clip(room, sway=26.0)
    plate = background_plate([frames], [still])
    assert wrong(plate.image, room) < 0.02


def test_grey_images_stay_grey() -> None:
    room = cv2.cvtColor(empty_room(), cv2.COLOR_BGR2GRAY)
    frames = [cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY) for frame in clip(empty_room())]
    plate = background_plate([frames], [room])
    assert plate.image.shape == room.shape
    assert (np.abs(plate.image.astype(int) - room) > 20).mean() < 0.01


def test_a_clip_alone_keeps_what_is_uncovered_now_and_then() -> None:
    room = empty_room()
    frames = [stand(room, (20.0 + 5.0 * t, 120.0)) for t in range(30)]
    plate = background_plate([frames])
    assert wrong(plate.image, room) < 0.003
    assert "no still" in plate.note


def test_several_clips_uncover_each_other() -> None:
    room = empty_room()
    other = [np.clip(f * 1.04 + 2, 0, 255).astype(np.uint8) for f in [stand(room, (40, 60))] * 15]
    third = [stand(room, (150.0, 80.0), seed=8)] * 15
    plate = background_plate([clip(room), other, third])
    assert wrong(plate.image, room) < 0.01


def test_stills_alone() -> None:
    room = empty_room()
    stills = [stand(room, at, seed=5) for at in ((40.0, 60.0), (100.0, 150.0), (150.0, 80.0))]
    assert wrong(background_plate(stills=stills).image, room) < 0.003
    two = background_plate(stills=stills[:2])
    assert (two.image == stills[0]).all() and two.unsure.any() and "two stills" in two.note
    one = background_plate(stills=stills[:1])
    assert (one.image == stills[0]).all() and not one.unsure.any()


def test_input_is_not_changed_and_answers_repeat() -> None:
    room = empty_room()
    frames, still = clip(room), stand(room, (40.0, 60.0), seed=5)
    before = [frame.copy() for frame in frames], still.copy()
    first = background_plate([frames], [still])
    again = background_plate([iter(frames)], [still])
    assert (first.image == again.image).all() and (first.unsure == again.unsure).all()
    assert all((a == b).all() for a, b in zip(frames, before[0], strict=True))
    assert (still == before[1]).all()


def test_bad_input_names_the_camera_and_the_source() -> None:
    room = empty_room()
    with pytest.raises(ImageError, match="cam03: neither a clip nor a still"):
        background_plate([[]], camera="cam03")
    with pytest.raises(ImageError, match="cam03: clip 0, frame 1"):
        background_plate([[room, room[:-1]]], camera="cam03")
    with pytest.raises(ImageError, match="cam03: still 0"):
        background_plate([[room]], [room.astype(float)], camera="cam03")
    with pytest.raises(ImageError, match="cam03: still 0"):
        background_plate([[room, room]], [room[:, :, 0]], camera="cam03")


def test_the_real_recording_needs_its_stills(balance_real: Path) -> None:
    """Without stills the median or mode of 1.7 s shows the person: the note must say so."""
    video = cv2.VideoCapture(str(balance_real / "cam03.mp4"))
    frames = []
    for _ in range(60):
        there, frame = video.read()
        assert there
        frames.append(cv2.resize(frame, None, fx=0.125, fy=0.125, interpolation=cv2.INTER_AREA))
    assert "show the person" in background_plate([frames]).note
