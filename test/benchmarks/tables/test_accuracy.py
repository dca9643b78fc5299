"""Tables of accuracy: evidence, continued runs, rows computed from known runs."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from markerless_tracker.benchmarks.tables import accuracy
from markerless_tracker.benchmarks.tables.accuracy import Plan, make_table, summarise
from markerless_tracker.benchmarks.tables.evidence import make_evidence
from markerless_tracker.benchmarks.tables.fingerprint import recording_key, run_key
from markerless_tracker.benchmarks.tables.runs import Run, disturbed_start, execute, longest_run
from markerless_tracker.benchmarks.tables.truth import TruthScore
from markerless_tracker.body import pose_from_markers
from markerless_tracker.cli.synthesize import synthesize
from markerless_tracker.datasets import MarkerTrack, open_recording, read_trc
from markerless_tracker.errors import BodyModelError, ConfigError, DatasetError, TrackerError
from markerless_tracker.results.run import recording_backgrounds, track_recording
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig, build_tracker

FRAMES = 5
SWARM = TrackerConfig.from_mapping({"refinement": "none", "evaluations": 200, "threads": 1})


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A made-up walk of a few small frames."""
    scene = SyntheticScene(body="person31", cameras=3, size_px=(200, 152), samples=1)
    folder = tmp_path_factory.mktemp("made") / "walk"
    synthesize(folder, scene, frames=FRAMES, lossless=True)
    return folder


@pytest.fixture(scope="module")
def evidence(walk, tmp_path_factory):
    folder = tmp_path_factory.mktemp("evidence")
    return make_evidence(open_recording(walk), SWARM, folder)


def test_evidence_equals_that_of_the_tracker(walk, evidence) -> None:
    recording = open_recording(walk)
    start = walk / "ground_truth.trc"
    live = build_tracker(
        recording.rig,
        SWARM,
        backgrounds=recording_backgrounds(recording, SWARM),
        start_file=start,
    )
    ready = build_tracker(recording.rig, SWARM, start_file=start).tracker
    tracked = list(track_recording(recording, live))
    stored = list(evidence.frames(every=1))
    assert len(tracked) == len(stored) == FRAMES
    for (stamp_ns, views), one in zip(stored, tracked, strict=True):
        result = ready.step(views, stamp_ns)
        assert stamp_ns == one.result.stamp_ns
        assert any(seen.undecided is not None for seen in views.values())
        assert result.pose.tobytes() == one.result.pose.tobytes()


def test_evidence_of_every_second_frame(walk, evidence, tmp_path) -> None:
    stamps = [stamp for stamp, _ in evidence.frames(every=2)]
    assert stamps == list(evidence.stamps_ns[::2]) and len(stamps) == 3
    thinned = make_evidence(open_recording(walk), SWARM, tmp_path, start=1, every=2, frames=3)
    assert thinned.stamps_ns == evidence.stamps_ns[1:4:2]
    with pytest.raises(DatasetError, match="every 3th frame requested, expected a multiple of 2"):
        next(thinned.frames(every=3))


def test_a_run_scores_what_it_tracked(walk, evidence) -> None:
    figures = execute(Run(SWARM, 2, walk / "ground_truth.trc", truth_score=True), evidence)
    assert (figures["frames"], figures["reference_frames"]) == (3, FRAMES)
    assert (figures["evaluations"], figures["refinements"]) == (200, 0)
    assert 0 < figures["mean_mm"] <= figures["max_mm"] <= figures["worst_joint_mm"] < 150
    assert figures["last_joint_mm"] <= figures["worst_joint_mm"] and figures["lost_run"] == 0
    assert abs(figures["truth_difference"]) < 0.2
    json.dumps(figures, allow_nan=False)


def test_truth_score_is_zero_at_the_truth_and_positive_elsewhere(walk, evidence) -> None:
    truth = walk / "ground_truth.trc"
    reference = read_trc(truth)
    tracker = build_tracker(evidence.rig, SWARM, start_file=truth).tracker
    (stamp_ns, views), *_ = evidence.frames(every=1)
    result = tracker.step(views, stamp_ns)
    row = dict(zip(reference.names, reference.positions_m[0], strict=True))
    pose = pose_from_markers(tracker.body, row)
    beside = pose.copy()
    beside[tracker.body.root[:3]] += 0.2
    compared = TruthScore(tracker, reference, np.array(evidence.stamps_ns))
    compared.add(replace(result, pose=pose))
    assert compared.mean == 0.0
    compared.add(replace(result, pose=beside))
    assert compared.differences[1] > 0.1
    compared.add(replace(result, stamp_ns=10**12))
    compared.add(replace(result, pose=None, markers_m=None))
    assert len(compared.differences) == 2


def test_truth_score_needs_hips_and_neck(walk, evidence) -> None:
    reference = read_trc(walk / "ground_truth.trc")
    tracker = build_tracker(evidence.rig, SWARM, start_file=walk / "ground_truth.trc").tracker
    without = reference.selected([name for name in reference.names if name != "Neck"])
    with pytest.raises(DatasetError, match="no marker Neck"):
        TruthScore(tracker, without, np.array(evidence.stamps_ns))


def test_start_noise_is_keyed_by_seed_and_scaled(walk) -> None:
    reference = read_trc(walk / "ground_truth.trc")
    a, b, other = (disturbed_start(reference, 10.0, seed) for seed in (1, 1, 2))
    assert len(a) == 1 and a.stamps_ns[0] == reference.stamps_ns[0]
    assert a.positions_m.tobytes() == b.positions_m.tobytes() != other.positions_m.tobytes()
    offset = a.positions_m[0] - reference.positions_m[0]
    twice = disturbed_start(reference, 20.0, 1).positions_m[0] - reference.positions_m[0]
    assert twice == pytest.approx(2 * offset)
    drawn = [disturbed_start(reference, 10.0, s).positions_m[0] for s in range(40)]
    assert np.std(np.array(drawn) - reference.positions_m[0]) == pytest.approx(0.010, rel=0.1)


def test_start_noise_affects_pose_and_lengths(walk, evidence) -> None:
    truth = walk / "ground_truth.trc"
    fixed = replace(SWARM, fit_shape=False)
    clean = execute(Run(fixed, 1, truth), evidence)
    noisy = execute(Run(fixed, 1, truth, start_noise_mm=40.0), evidence)
    assert noisy["mean_mm"] > clean["mean_mm"]


def test_start_noise_needs_a_row() -> None:
    blank = MarkerTrack(("Head",), np.array([0]), np.full((1, 1, 3), np.nan))
    with pytest.raises(DatasetError, match="no marker in any row"):
        disturbed_start(blank, 1.0, 0)


@given(st.lists(st.booleans(), max_size=30))
def test_longest_run(flags) -> None:
    groups = "".join("x" if flag else " " for flag in flags).split()
    assert longest_run(np.array(flags, dtype=bool)) == max(map(len, groups), default=0)


def figures(**changed) -> dict:
    return {
        "mean_mm": 10.0, "max_mm": 20.0, "worst_joint_mm": 50.0, "limbs_mm": 12.0,
        "last_joint_mm": 30.0, "lost_run": 0, "lost_frames": 0, "evaluations": 200.0,
        "refinements": 8.0, "frames_per_s": 30.0, "frames": 7, "truth_difference": None,
        "joints": {"Head": 5.0, "Nose": None}, "stamps_s": [0.0, 0.5], "frame_mm": [4.0, 16.0],
        **changed,
    }  # fmt: skip


def test_a_row_of_known_runs() -> None:
    row = summarise(
        [
            figures(),
            figures(mean_mm=14.0, max_mm=90.0, lost_run=4, frames_per_s=20.0, truth_difference=0.5),
            figures(mean_mm=12.0, last_joint_mm=60.0, joints={"Head": 8.0, "Nose": None}),
        ]
    )
    assert (row["mean_mm"], row["sd_mm"], row["seeds"]) == (12.0, 2.0, 3)
    assert (row["limbs_mm"], row["limbs_sd_mm"]) == (12.0, 0.0)
    assert (row["max_mm"], row["lost_run"], row["last_joint_mm"]) == (90.0, 4, 60.0)
    assert row["frames_per_s"] == 30.0 and row["runs"] == [10.0, 14.0, 12.0]
    assert row["joints"] == {"Head": 6.0} and row["truth_difference"] == 0.5
    assert summarise([figures(limbs_mm=None)])["limbs_mm"] is None
    assert summarise([figures()])["sd_mm"] is None


def test_joints_are_means_over_the_seeds_that_have_them() -> None:
    joints = ({"Head": 5.0}, {"Head": None, "Nose": 3.0}, {"Head": 8.0, "Nose": 4.0, "Neck": None})
    row = summarise([figures(joints=one) for one in joints])
    assert row["joints"] == {"Head": 6.5, "Nose": 3.5}


def test_a_background_that_follows_the_light_is_made_for_each_rate(walk) -> None:
    rates = (60.0, 20.0)
    groups = accuracy._Piece(walk, Plan(configs=(SWARM,), rates=rates, seeds=2), None).groups()
    assert [*groups] == [[0, 1, 2, 3]]
    following = TrackerConfig.from_mapping({"background.follow_s": 1.0})
    groups = accuracy._Piece(walk, Plan(configs=(following,), rates=rates, seeds=2), None).groups()
    assert [*groups] == [[0, 1], [2, 3]]


def test_time_per_evaluation_is_stated_without_refinement_only() -> None:
    assert summarise([figures(refinements=0.0)])["ms_per_evaluation"] == pytest.approx(1 / 6)
    assert summarise([figures()])["ms_per_evaluation"] is None


def test_error_over_time_covers_the_frames_of_all_seeds() -> None:
    row = summarise([figures(), figures(stamps_s=[0.5, 1.0], frame_mm=[20.0, 99.0])])
    assert row["curve"] == {"s": [0.5], "mean_mm": [18.0]}


def test_an_interrupted_table_resumes(walk, tmp_path, monkeypatch) -> None:
    plan = Plan(configs=(SWARM,), rates=(60.0,), seeds=1, frames=2)
    first = make_table([walk], plan, store=tmp_path)
    counted = []
    real = accuracy.run_all

    def counting(runs, evidence, *, processes):
        counted.extend(run.config.seed for run in runs)
        yield from real(runs, evidence, processes=processes)

    monkeypatch.setattr(accuracy, "run_all", counting)
    assert make_table([walk], plan, store=tmp_path) == first and not counted
    more = make_table([walk], replace(plan, seeds=2), store=tmp_path)
    assert counted == [1] and more[0]["runs"][0] == first[0]["runs"][0]
    # A file that was cut short, and whatever else the figures depend on.
    (cut,) = (f for f in (tmp_path / "runs").iterdir() if '"seed": 1' in f.read_text())
    cut.write_text(cut.read_text()[:100])
    make_table([walk], replace(plan, seeds=2), store=tmp_path)
    for other in (
        replace(plan, start_noise_mm=5.0),
        replace(plan, frames=3),
        replace(plan, configs=(replace(SWARM, edge_weight=0.25),)),
    ):
        make_table([walk], other, store=tmp_path)
    assert counted == [1, 1, 0, 0, 0]


def test_processes_do_not_change_the_figures(walk) -> None:
    plan = Plan(configs=(SWARM,), rates=(60.0,), seeds=2, frames=2)
    alone, together = (make_table([walk], replace(plan, jobs=jobs)) for jobs in (1, 2))
    for row in (*alone, *together):
        row.pop("frames_per_s"), row.pop("ms_per_evaluation")
    assert alone == together


def test_rates_a_recording_has(walk) -> None:
    assert accuracy._rates(60.0, ()) == (60.0, 20.0)
    assert accuracy._rates(120.0, ()) == (60.0, 20.0)
    assert accuracy._rates(60000 / 1001, ()) == (60.0, 20.0)
    assert accuracy._rates(240000 / 1001, ()) == (60.0, 20.0)
    assert accuracy._rates(25.0, ()) == (25.0,)
    assert accuracy._rates(20.0, ()) == (20.0,)
    with pytest.raises(ConfigError, match="keeping every k-th"):
        make_table([walk], Plan(configs=(SWARM,), rates=(25.0,)))


def test_a_recording_that_cannot_be_scored_is_an_error(walk, make_recording) -> None:
    plan = Plan(configs=(SWARM,), seeds=1)
    with pytest.raises(DatasetError, match=r"small: no ground_truth\.trc"):
        make_table([make_recording()], plan)
    with pytest.raises(BodyModelError, match="missing"):
        make_table([walk], replace(plan, configs=(replace(SWARM, body="missing"),)))
    # The same from another process, where the run itself finds out.
    impossible = replace(plan, configs=(replace(SWARM, evaluations=7),), seeds=2, frames=1)
    for jobs in (1, 2):
        with pytest.raises(TrackerError, match="evaluations is 7"):
            make_table([walk], replace(impossible, jobs=jobs))


def test_runs_can_be_stored_in_a_folder_of_the_recording_but_not_in_itself(
    walk, tmp_path, monkeypatch
) -> None:
    recording = tmp_path / "walk"
    shutil.copytree(walk, recording)
    plan = Plan(configs=(SWARM,), rates=(60.0,), seeds=1, frames=1)
    first = make_table([recording], plan, store=recording / "out")
    monkeypatch.setattr(accuracy, "run_all", None)
    assert make_table([recording], plan, store=recording / "out") == first
    with pytest.raises(ConfigError, match="walk: the recording itself, expected another folder"):
        make_table([recording], plan, store=recording)


def test_keys_depend_on_their_content(walk, tmp_path) -> None:
    assert run_key({"a": 1}) == run_key({"a": 1}) != run_key({"a": 2})
    copy = tmp_path / "copy"
    copy.mkdir()
    (copy / "a.txt").write_text("one")
    before = recording_key(copy)
    assert recording_key(copy) == before
    (copy / "b.txt").write_text("two")
    assert recording_key(copy) != before
