"""Every file of every format, damaged: one line that names it, or a recording without it."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml

from markerless_tracker.datasets import open_recording
from markerless_tracker.errors import TrackerError

from . import (
    test_anipose,
    test_bodytrack,
    test_human36m,
    test_humaneva,
    test_opencv,
    test_panoptic,
    test_projects,
    test_public_sets,
)
from .conftest import picture
from .test_opencv import NAMES, of_opencv, of_ros, storage, write_extrinsics
from .test_panoptic import write_bodies
from .test_public_sets import write_positions

# Fixtures: the complete recordings of the readers' own tests.
anipose = test_anipose.session
bodytrack = test_bodytrack.sequence
human36m, cdf = test_human36m.subject, test_human36m.write_cdf
humaneva = test_humaneva.subject
videos = test_opencv.folder
panoptic = test_panoptic.sequence
caliscope, freemocap = test_projects.caliscope, test_projects.freemocap
mpi_inf_3dhp, totalcapture = test_public_sets.mpi, test_public_sets.take

VIDEOS = (".avi", ".mkv")
NUMBERS = ("nan", "-7", "0", "1e30", "[]", "x", "")
MOST_PLACES = 12
"""Numbers of a file that are replaced, evenly spread."""


def complete(kind: str, path: Path, request: pytest.FixtureRequest) -> Path:
    """Add the optional files of a format; returns the folder above all of its files."""
    if kind == "humaneva":
        from scipy.io import savemat

        cells = np.empty((1, 1), dtype=object)
        cells[0, 0] = picture(9, 0) / 255.0
        file = path / "Background" / "Background_(C2).mat"
        savemat(file, {"bg_means": cells, "bg_vars": cells})
    elif kind == "bodytrack":
        for name, count in (("InitialPose", 31), ("BodyShapeParameters", 58)):
            numbers = " ".join(map(str, range(count)))
            (path / f"{name}.txt").write_text(numbers, encoding="ascii")
    elif kind == "panoptic":
        write_bodies(path, 0, {0: np.ones((19, 3))})
    elif kind == "totalcapture":
        write_positions(path)
        return path.parents[2]
    elif kind == "human36m":
        positions = path / "MyPoseFeatures" / "D3_Positions" / "Walking 1.cdf"
        request.getfixturevalue("cdf")(positions, np.ones((3, 96)))
        return path.parent
    elif kind == "caliscope":
        rows = ["cam_id,frame_time", *(f"{c},{9.0 + f / 30:.3f}" for f in range(3) for c in (0, 1))]
        (path / "timestamps.csv").write_text("\n".join(rows), encoding="utf-8")
        return path.parents[1]
    return path.parent if kind == "anipose" else path


@pytest.fixture
def opencv(videos: Path, make_rig) -> Path:
    left, right = make_rig(*NAMES)
    storage(videos / "left.yaml", of_opencv(left))
    (videos / "right.yaml").write_text(yaml.safe_dump(of_ros(right)), encoding="utf-8")
    write_extrinsics(videos / "extrinsics.yaml", make_rig(*NAMES))
    return videos


def read_all(path: Path, kind: str) -> None:
    recording = open_recording(path, format=kind, input_fps=30.0)
    assert sum(1 for _ in recording.frames()) > 0
    for model in recording.rig:
        assert np.isfinite(model.matrix).all() and np.isfinite(model.T_cam_world).all()
    recording.ground_truth()
    recording.background_frames()
    recording.background_models()
    if kind == "bodytrack":
        recording.initial_pose()
        recording.body_shape()


def damages(content: bytes, file: Path) -> Iterator[bytes]:
    """The file empty, cut, no text, other text; numbers of a text replaced."""
    yield from (b"", content[: len(content) // 2], b"\xff\xfe\x80" + content, b"abc def\n")
    if file.suffix in (".mat", ".cdf", ".c3d"):
        return
    text = content.decode("ascii")
    found = list(re.finditer(r"(?<![\w.])-?\d+\.?\d*(?:[eE][-+]?\d+)?", text))
    for place in found[:: max(1, len(found) // MOST_PLACES)]:
        for number in NUMBERS:
            yield (text[: place.start()] + number + text[place.end() :]).encode("ascii")


@pytest.mark.parametrize(
    "kind",
    [
        "anipose", "bodytrack", "caliscope", "freemocap", "human36m", "humaneva", "mpi_inf_3dhp",
        "opencv", "panoptic", "totalcapture",
    ],
)  # fmt: skip
def test_every_damaged_file(kind: str, request: pytest.FixtureRequest) -> None:
    path = request.getfixturevalue(kind)
    root = complete(kind, path, request)
    read_all(path, kind)
    files = [file for file in sorted(root.rglob("*")) if file.is_file()]
    tried = refused = 0

    def attempt(file: Path) -> None:
        nonlocal tried, refused
        tried += 1
        try:
            read_all(path, kind)
        except TrackerError as error:
            refused += 1
            assert "\n" not in str(error) and str(root) in str(error), error

    for file in files:
        if file.suffix in (*VIDEOS, ".png", ".bmp"):
            continue
        content = file.read_bytes()
        for damaged in damages(content, file):
            file.write_bytes(damaged)
            attempt(file)
        file.unlink()
        attempt(file)
        file.mkdir()
        attempt(file)
        file.rmdir()
        file.write_bytes(content)
    for image in (next((f for f in files if f.suffix in VIDEOS), None) or files[-1],):
        content = image.read_bytes()
        for damaged in (b"", b"no image"):
            image.write_bytes(damaged)
            attempt(image)
        image.write_bytes(content)
    read_all(path, kind)
    assert refused > tried / 4
