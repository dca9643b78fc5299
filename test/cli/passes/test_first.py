"""Two passes: the second one tracks with the body that fits the whole recording."""

import numpy as np
import pytest

from markerless_tracker.body import load_description, read_subject
from markerless_tracker.body.subject import subject_from_stature
from markerless_tracker.cli.main import main, parser_of
from markerless_tracker.cli.synthesize import synthesize
from markerless_tracker.cli.terminal.notices import Notices
from markerless_tracker.cli.track import track_source
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking.start.two_headings import SETTLING_FRAMES

FRAMES = SETTLING_FRAMES + 3
"""Too few for a fit of the lengths in one pass, other than that of the start."""


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made-up") / "walk"
    scene = SyntheticScene(body="person31", motion="walk", size_px=(192, 144), seed=2, noise=2.0)
    synthesize(folder, scene, frames=FRAMES, lossless=True)
    return folder


def track(source, name, *words) -> int:
    given = ["track", source, "-o", name, "--body", "person31", "--threads", 1, *words]
    return main([str(word) for word in given])


def test_the_second_pass_has_fitted_lengths_from_its_first_frame_on(walk, tmp_path) -> None:
    assert track(walk, tmp_path / "one", "--stature", 1.65) == 0
    assert track(walk, tmp_path / "two", "--stature", 1.65, "--passes", 2) == 0
    description = load_description("person31")
    names = tuple(description.lengths)
    generic, true = subject_from_stature(description, 1.65), read_subject(walk / "subject.yaml")
    one, two = (read_subject(tmp_path / f"{name}.subject.yaml") for name in ("one", "two"))
    lengths = [np.log([s.lengths_m[n] for n in names]) for s in (generic, one, two, true)]
    # Those of one pass are fitted to the frames of the start.
    assert np.abs(lengths[2] - lengths[1]).max() > 1e-3
    off = [np.abs(each - lengths[3]).mean() for each in lengths[:3]]
    assert off[2] < off[0]
    assert not two.measured


class Seen(Notices):
    """Keeps the total and the last step of each part."""

    def __init__(self) -> None:
        self.parts: dict[str, list[int | None]] = {}

    def begin(self, part: str, total: int | None = None) -> None:
        self.part = part
        self.parts[part] = [total, 0]

    def step(self, done: int, total: int | None = None) -> None:
        self.parts[self.part][1] = done


def test_both_passes_have_a_bar_with_their_frames(walk, tmp_path) -> None:
    words = f"{walk} -o {tmp_path / 'out'} --body person31 --threads 1 --passes 2".split()
    seen = Seen()
    track_source(parser_of("track").parse_args(words), seen)
    assert seen.parts["first pass"] == seen.parts["tracking walk"] == [FRAMES, FRAMES]


@pytest.mark.parametrize("given", ["--subject", "--start"])
def test_a_known_person_is_refused(walk, tmp_path, capsys, given) -> None:
    file = walk / ("subject.yaml" if given == "--subject" else "ground_truth.trc")
    assert track(walk, tmp_path / "out", given, file, "--passes", 2) == 1
    assert "--passes 2" in capsys.readouterr().err
