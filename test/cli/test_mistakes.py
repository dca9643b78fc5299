"""Common mistakes: what `track` says, its exit status, and that nothing false is written.

The table in `docs/mistakes.md` says what is expected; `MISTAKES` has a recording for each line.
"""

import json
import re
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, Subject, load_body, write_subject
from markerless_tracker.camera import CameraModel, CameraRig, project_camera
from markerless_tracker.cli.main import main
from markerless_tracker.datasets import MarkerTrack, new_recording, read_trc, write_trc
from markerless_tracker.geometry import inverse, rotation_from_rodrigues, transform
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.synthesis.rooms.chair import chair

BODY, SIZE_PX, FPS, FRAMES = "person32", (256, 192), 30.0, 12
FEW = 4
"""Frames of most recordings: a start takes as long as many frames."""
WHOLE = {
    "no background", "one background missing", "a chair that the backgrounds lack",
    "one camera late by a third of a second", "a subject a sixth too small",
}  # fmt: skip
"""Mistakes that show over some time."""
DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "mistakes.md"

Images = dict[str, Any]


@dataclass
class Case:
    """A recording to be made, and the options of `track`."""

    rig: CameraRig
    frames: list[Images]
    masks: list[Images]
    backgrounds: dict[str, list[Any]]
    scene: SyntheticScene
    folder: Path
    words: tuple[object, ...] = ()
    after: Callable[[Path], None] | None = None

    def place(self, move: np.ndarray) -> None:
        """Move the world: `move` (4, 4) takes points of the right world to the new one."""
        back = inverse(move)
        self.rig = CameraRig(tuple(replace(c, T_cam_world=c.T_cam_world @ back) for c in self.rig))

    def scale(self, factor: float) -> None:
        """Multiply all translations."""
        cameras = []
        for camera in self.rig:
            T = camera.T_cam_world.copy()
            T[:3, 3] *= factor
            cameras.append(replace(camera, T_cam_world=T))
        self.rig = CameraRig(tuple(cameras))

    def edit(self, name: str, change: Callable[[int, Any], Any]) -> None:
        """Change one camera's images by frame."""
        for index, images in enumerate(self.frames):
            images[name] = change(index, images[name])

    def write(self) -> Path:
        """The recording's folder."""
        folder = self.folder / "recording"
        with new_recording(folder, self.rig, FPS, lossless=True) as recording:
            for name, images in self.backgrounds.items():
                recording.write_background(name, images)
            for frame in self.frames:
                recording.write(frame)
        return folder


def _turned(x: float) -> np.ndarray:
    return transform(rotation_from_rodrigues(np.array([x, 0.0, 0.0])), [0.0, 0.0, 0.0])


def _raised(z: float) -> np.ndarray:
    return transform(np.eye(3), [0.0, 0.0, z])


def _to_world(case: Case) -> None:
    case.rig = CameraRig(tuple(replace(c, T_cam_world=c.T_world_cam) for c in case.rig))
    case.frames = case.frames[:1]


def _exchanged(case: Case) -> None:
    a, b, *others = case.rig.cameras
    case.rig = CameraRig((replace(b, name=a.name), replace(a, name=b.name), *others))


def _larger(case: Case) -> None:
    def change(folder: Path) -> None:
        path = folder / "calibration.toml"
        text = path.read_text(encoding="utf-8")
        path.write_text(re.sub(r"size = \[256, 192\]", "size = [512, 384]", text), encoding="utf-8")

    case.after = change


def _chair(case: Case) -> None:
    scene = case.scene
    body, pose = scene.start()
    at, heading = pose[[body.index("pelvis_tx"), body.index("pelvis_ty")]], 0.0
    vertices, triangles = chair(0.45, (float(at[0]) + 0.35, float(at[1])), heading)
    for camera in case.rig:
        pixels = project_camera(vertices, camera)
        shown = np.zeros(SIZE_PX[::-1], dtype=np.uint8)
        for corners in triangles:
            cv2.fillConvexPoly(shown, np.round(pixels[corners]).astype(np.int32), 1)
        for images, masks in zip(case.frames, case.masks, strict=True):
            picture = images[camera.name].copy()
            picture[(shown > 0) & (masks[camera.name] == 0)] = (40, 60, 90)
            images[camera.name] = picture


def _legs_only(case: Case) -> None:
    """Cut the images off above the knees; cameras that see so little."""
    height = SIZE_PX[1]
    knees = MARKER_NAMES.index("LKnee"), MARKER_NAMES.index("RKnee")
    points = case.scene.markers(0)[list(knees)]
    rows = [project_camera(points, camera)[:, 1].min() for camera in case.rig]
    top = int(min(rows))
    cameras = []
    for camera in case.rig:
        K = camera.matrix.copy()
        K[1, 2] -= top
        cameras.append(CameraModel(
            camera.name, (SIZE_PX[0], height - top), K, camera.distortion, camera.T_cam_world
        ))  # fmt: skip
    case.rig = CameraRig(tuple(cameras))
    for images in case.frames:
        for name in images:
            images[name] = images[name][top:]
    case.backgrounds = {n: [b[0][top:]] for n, b in case.backgrounds.items()}


def _nobody(case: Case) -> None:
    case.frames = [{n: b[i] for n, b in case.backgrounds.items()} for i in range(3, 6)]
    case.backgrounds = {n: b[:3] for n, b in case.backgrounds.items()}


def _subject(case: Case) -> None:
    path = case.folder / "another.yaml"
    write_subject(path, Subject("another", load_body(BODY, 1.45).lengths_m))
    case.words = ("--subject", path)


def _small_subject(case: Case) -> None:
    path = case.folder / "small.yaml"
    lengths = {name: 5 / 6 * value for name, value in case.scene.body.lengths_m.items()}
    write_subject(path, Subject("small", lengths))
    case.words = ("--subject", path)


def _start(case: Case, positions_m: np.ndarray) -> None:
    path = case.folder / "start.trc"
    write_trc(path, MarkerTrack(MARKER_NAMES, np.array([0]), positions_m[None]), FPS)
    case.words = ("--start", path)


def _inverted(case: Case) -> None:
    for index, masks in enumerate(case.masks):
        for name, mask in masks.items():
            path = case.folder / "masks" / name / f"{index:06d}.png"
            path.parent.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(path), np.where(mask, 0, 255).astype(np.uint8))
    case.words = ("--masks", case.folder / "masks")


def _set(**values: Any) -> Callable[[Case], None]:
    def make(case: Case) -> None:
        for name, value in values.items():
            setattr(case, name, value)

    return make


MISTAKES: Mapping[str, Callable[[Case], None]] = {
    "calibration in millimetres": lambda case: case.scale(1000.0),
    "calibration in centimetres": lambda case: case.scale(100.0),
    "calibration with y up": lambda case: case.place(_turned(-0.5 * np.pi)),
    "calibration in the first camera's world": lambda case: case.place(
        case.rig.cameras[0].T_cam_world
    ),
    "calibration with z down": lambda case: case.place(_turned(np.pi)),
    "origin of the world 1 m below the floor": lambda case: case.place(_raised(1.0)),
    "origin of the world 0.2 m below the floor": lambda case: case.place(_raised(0.2)),
    "origin of the world 0.15 m above the floor": lambda case: case.place(_raised(-0.15)),
    "origin of the world 3 m above the floor": lambda case: case.place(_raised(-3.0)),
    "camera poses from the camera to the world": _to_world,
    "checkerboard squares stated too small": lambda case: case.scale(0.6),
    "calibration of larger images": _larger,
    "two cameras exchanged": _exchanged,
    "one camera with another's background": lambda case: case.backgrounds.update(
        cam01=case.backgrounds["cam03"]
    ),
    "no background": lambda case: case.backgrounds.clear(),
    "one background missing": lambda case: case.backgrounds.pop("cam01") and None,
    "the person in one camera's background": lambda case: case.backgrounds.update(
        cam02=[case.frames[5]["cam02"]]
    ),
    "a chair that the backgrounds lack": _chair,
    "another person's subject": _subject,
    "a subject a sixth too small": lambda case: _small_subject(case),
    "stature in centimetres": _set(words=("--stature", 172)),
    "start in millimetres": lambda case: _start(case, 1000.0 * case.scene.markers(0)),
    "start of another recording": lambda case: _start(case, case.scene.markers(0) + [0.7, 0.7, 0]),
    "a person in view up to the knees only": _legs_only,
    "nobody there": _nobody,
    "one camera dark": lambda case: case.edit("cam02", lambda _, image: np.zeros_like(image)),
    "one camera late by a third of a second": lambda case: _late(case),
    "a rate that is not the recording's": _set(words=("--fps", 25)),
    "silhouettes inverted": _inverted,
}


def _late(case: Case) -> None:
    shown = [images["cam02"] for images in case.frames]
    case.edit("cam02", lambda index, _: shown[max(0, index - 10)])


def table() -> dict[str, tuple[str, int]]:
    """Mistake -> what is said, exit status."""
    lines = DOCUMENT.read_text(encoding="utf-8").splitlines()
    rows = [re.fullmatch(r"\| ([^|`]+) \| `([^`]+)` \| (\d) \|", line) for line in lines]
    return {row[1]: (row[2], int(row[3])) for row in rows if row}


@pytest.fixture(scope="module")
def made() -> tuple[SyntheticScene, list[Images], list[Images], dict[str, list[Any]]]:
    """A scene, its images and masks by frame, and images of the empty room."""
    scene = SyntheticScene(body=BODY, size_px=SIZE_PX, fps=FPS, seed=4, noise=2.0)
    frames = [scene.frame(index)[:2] for index in range(FRAMES)]
    return scene, [f[0] for f in frames], [f[1] for f in frames], scene.backgrounds(6)


@pytest.fixture
def case(made: Any, tmp_path: Path) -> Case:
    scene, frames, masks, backgrounds = made
    return Case(
        scene.rig, [dict(images) for images in frames], masks, dict(backgrounds), scene, tmp_path
    )


def track(case: Case, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """Exit status, and all that is said."""
    source = case.write()
    if case.after is not None:
        case.after(source)
    words = ["track", source, "-o", case.folder / "out", "--threads", 1, *case.words]
    status = main([str(word) for word in words])
    return status, "\n".join(capsys.readouterr())


def nothing_false_is_written(folder: Path, status: int) -> None:
    """No pose without a doubt about it, no person where nobody was found."""
    if status == 1:
        assert not list(folder.glob("out.*"))
        return
    track = read_trc(folder / "out.trc")
    verdict = json.loads((folder / "out.json").read_text(encoding="utf-8"))["verdict"]
    if status == 3:
        assert not track.tracked.any() and not (folder / "out.subject.yaml").exists()
        assert verdict["tracked"] == 0 and verdict["causes"] + verdict["doubts"]
    else:
        assert verdict["tracked"] == track.tracked.sum() > 0 and verdict["doubts"]


def test_every_line_of_the_document_is_a_test() -> None:
    assert set(table()) == set(MISTAKES) and len(MISTAKES) >= 20


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named_and_nothing_false_is_written(
    mistake: str, case: Case, capsys: pytest.CaptureFixture[str]
) -> None:
    MISTAKES[mistake](case)
    if mistake not in WHOLE:
        case.frames = case.frames[:FEW]
    said, expected = table()[mistake]
    status, output = track(case, capsys)
    assert status == expected, output
    assert said in output, output
    nothing_false_is_written(case.folder, status)


def test_without_a_mistake_nothing_is_doubted(case: Case, capsys: Any) -> None:
    status, output = track(case, capsys)
    verdict = json.loads((case.folder / "out.json").read_text(encoding="utf-8"))["verdict"]
    assert status == 0 and verdict["doubts"] == verdict["causes"] == [], output
    assert 1.6 < verdict["stature_m"] < 1.85 and verdict["stature_plausible"]
    assert min(verdict["overlap"].values()) > 0.85
    shutil.rmtree(case.folder)
