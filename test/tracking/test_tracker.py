"""`Tracker.step` on a made-up person: accuracy, same bytes each time, views that are missing."""

import numpy as np
import pytest

from markerless_tracker.errors import ConfigError
from markerless_tracker.imaging import Segmenter
from markerless_tracker.records import Observation, TrackState
from markerless_tracker.tracking import Tracker, TrackerConfig
from markerless_tracker.tracking.stages import effort


def errors_mm(result, frame):
    return 1e3 * np.linalg.norm(result.markers_m - frame.markers_m, axis=1)


def track(tracker: Tracker, frames) -> bytes:
    """All poses, as bytes; every frame has another one."""
    poses = [tracker.step(f.images, f.stamp_ns).pose.tobytes() for f in frames]
    assert len(set(poses)) == len(poses)
    return b"".join(poses)


@pytest.fixture
def settings(request):
    return request.getfixturevalue(request.param)


class TestFollowing:
    @pytest.mark.parametrize("settings", ["swarm_settings", "refined_settings"], indirect=True)
    def test_a_made_up_person_is_followed_nearly_exactly(self, make_tracker, frames, settings):
        tracker = make_tracker(settings, threads=2)
        for frame in frames:
            result = tracker.step(frame.images, frame.stamp_ns)
            gap = errors_mm(result, frame)
            assert gap.mean() < 20.0
            assert gap.max() < 60.0
            assert result.state is TrackState.TRACKING
            assert result.stamp_ns == frame.stamp_ns
            assert set(result.iou) == set(frame.images)
            assert min(result.iou.values()) > 0.8
            assert 0.0 < result.fitness <= 2.0
            assert set(result.observations) == set(frame.images)

    def test_the_start_need_not_be_exact(self, make_tracker, frames, swarm_settings, scene):
        start = scene.pose(0)
        start[scene.body.index("pelvis_tx")] += 0.02
        start[scene.body.index("l_knee")] -= 0.1
        tracker = make_tracker(swarm_settings, start_pose=start)
        results = [tracker.step(frames[0].images, i) for i in range(3)]
        assert errors_mm(results[-1], frames[0]).mean() < 15.0

    def test_the_swarm_alone_spends_its_budget_exactly(self, make_tracker, frames, swarm_settings):
        for evaluations in (1000, 200):
            tracker = make_tracker(swarm_settings, evaluations=evaluations)
            result = tracker.step(frames[0].observations, 0)
            assert (result.evaluations, result.refinements) == (evaluations, 0)

    def test_refinement_says_what_it_spent(self, make_tracker, frames, refined_settings):
        result = make_tracker(refined_settings).step(frames[0].observations, 0)
        assert (result.evaluations, result.refinements) == (200 + 4 * 24, 6)

    @pytest.mark.parametrize("update", ["iteration", "particle"])
    def test_both_updates_track(self, make_tracker, frames, swarm_settings, update):
        tracker = make_tracker(swarm_settings, **{"sppso.update": update})
        results = [tracker.step(frame.observations, frame.stamp_ns) for frame in frames]
        # The start pose held would be 54 mm off.
        assert errors_mm(results[-1], frames[-1]).mean() < 20.0
        assert results[0].evaluations == 1000

    def test_estimates_keep_the_limits_and_do_not_inter_penetrate(
        self, make_tracker, frames, swarm_settings
    ):
        tracker = make_tracker(swarm_settings, **{"sigma.scale": 3.0})
        for frame in frames[:3]:
            pose = tracker.step(frame.images, frame.stamp_ns).pose
            assert tracker._searcher.feasible(pose[None])[0]

    def test_the_body_is_fitted_once_to_the_first_frame(
        self, make_tracker, frames, refined_settings, swarm_settings
    ):
        tracker = make_tracker(refined_settings)
        shapes = [tracker.body.cone_shape]
        for frame in frames[:2]:
            tracker.step(frame.observations, frame.stamp_ns)
            shapes.append(tracker.body.cone_shape)
        assert not np.array_equal(shapes[0], shapes[1])
        np.testing.assert_array_equal(shapes[1], shapes[2])
        tracker.reset()
        np.testing.assert_array_equal(tracker.body.cone_shape, shapes[0])
        held = make_tracker(swarm_settings)
        held.step(frames[0].observations, 0)
        np.testing.assert_array_equal(held.body.cone_shape, shapes[0])


class TestSameBytes:
    @pytest.mark.parametrize("settings", ["swarm_settings", "refined_settings"], indirect=True)
    def test_with_one_thread_two_and_more_than_there_are(self, make_tracker, frames, settings):
        tracks = [track(make_tracker(settings, threads=n), frames[:3]) for n in (1, 2, 64)]
        assert tracks[0] == tracks[1] == tracks[2]

    @pytest.mark.parametrize("settings", ["swarm_settings", "refined_settings"], indirect=True)
    def test_after_reset_whatever_came_before(self, make_tracker, frames, settings):
        fresh = track(make_tracker(settings), [frames[0], frames[3]])
        tracker = make_tracker(settings)
        track(tracker, frames[:2])
        tracker.reset()
        assert tracker.state is TrackState.SEARCHING
        assert track(tracker, [frames[0], frames[3]]) == fresh

    @pytest.mark.parametrize("settings", ["swarm_settings", "refined_settings"], indirect=True)
    def test_warming_up_changes_nothing(self, make_tracker, frames, settings):
        warm = make_tracker(settings)
        warm.warm_up()
        assert warm.state is TrackState.SEARCHING
        assert track(warm, frames[:2]) == track(make_tracker(settings), frames[:2])

    def test_another_seed_draws_otherwise(self, make_tracker, frames, swarm_settings):
        a, b = (track(make_tracker(swarm_settings, seed=seed), frames[:1]) for seed in (0, 1))
        assert a != b

    def test_skipped_frames_do_not_shift_the_draws(
        self, make_tracker, frames, swarm_settings, monkeypatch
    ):
        """Frame 3 after 0 draws what frame 3 after 0, 1, 2 draws."""
        drawn: dict[tuple[int, str], set[float]] = {}
        search = pytest.importorskip("markerless_tracker.tracking.search")
        real = search.keyed_generator

        def spy(seed, stamp_ns, stage):
            drawn.setdefault((stamp_ns, stage), set()).add(real(seed, stamp_ns, stage).random())
            return real(seed, stamp_ns, stage)

        monkeypatch.setattr(search, "keyed_generator", spy)
        track(make_tracker(swarm_settings), frames[:4])
        track(make_tracker(swarm_settings), [frames[0], frames[3]])
        assert len(drawn) == 8
        assert all(len(draws) == 1 for draws in drawn.values())
        assert len(set.union(*drawn.values())) == 8

    def test_from_images_and_from_observations_made_elsewhere(
        self, make_tracker, frames, backgrounds, swarm_settings, scene
    ):
        config = TrackerConfig.from_mapping(swarm_settings)
        remote = {name: Segmenter(name, model, config) for name, model in backgrounds.items()}
        here = make_tracker(swarm_settings)
        there = Tracker(scene.rig, scene.body, config, start_pose=scene.pose(0))
        for frame in frames[:2]:
            sent = {
                name: remote[name].observe(image, frame.stamp_ns)
                for name, image in frame.images.items()
            }
            a = here.step(frame.images, frame.stamp_ns)
            b = there.step(sent, frame.stamp_ns)
            assert a.pose.tobytes() == b.pose.tobytes()
            assert (a.fitness, a.iou) == (b.fitness, b.iou)

    def test_the_order_of_the_views_does_not_matter(self, make_tracker, frames, swarm_settings):
        frame = frames[0]
        backwards = dict(reversed(frame.images.items()))
        a = make_tracker(swarm_settings).step(frame.images, 0)
        b = make_tracker(swarm_settings).step(backwards, 0)
        assert a.pose.tobytes() == b.pose.tobytes()


class TestTime:
    @pytest.fixture
    def spreads(self, monkeypatch):
        """The spread of the search in every frame, relative to the published one."""
        seen: list[float] = []
        real = effort.frame_stages

        def spy(body, config, centre, sigma):
            seen.append(float(np.median(sigma / body.sigma)))
            return real(body, config, centre, sigma)

        monkeypatch.setattr(effort, "frame_stages", spy)
        return seen

    def test_spreads_follow_the_time_between_frames(
        self, make_tracker, frames, swarm_settings, spreads
    ):
        tracker = make_tracker(swarm_settings, evaluations=100, **{"sigma.rate_max": 6.0})
        spreads.clear()
        stamps_s = [5.0, 5.0 + 1 / 60, 5.0 + 4 / 60, 5.0 + 4.5 / 60, 6.0, 1e5, 1e5, 3.0]
        for stamp_s in stamps_s:
            tracker.step(frames[0].observations, round(stamp_s * 1e9))
        # First frame; 1/60 s; 3/60 s; half; capped at six; capped; same time; back in time.
        expected = [1.0, 1.0, 3.0, 0.5, 6.0, 6.0, 1.0, 1.0]
        np.testing.assert_allclose(spreads, expected, rtol=1e-6)
        tracker.reset()
        tracker.step(frames[0].observations, round(9e9))
        assert spreads[-1] == 1.0

    def test_the_cap_is_a_setting(self, make_tracker, frames, swarm_settings, spreads):
        tracker = make_tracker(swarm_settings, evaluations=100, **{"sigma.rate_max": 2.0})
        for stamp_s in (0.0, 1.0):
            tracker.step(frames[0].observations, round(stamp_s * 1e9))
        assert spreads[-1] == 2.0

    def test_prediction_moves_on_by_its_share_of_the_last_change(
        self, make_tracker, frames, swarm_settings, monkeypatch
    ):
        centres = []
        real = effort.frame_stages

        def spy(body, config, centre, sigma):
            centres.append(centre.copy())
            return real(body, config, centre, sigma)

        monkeypatch.setattr(effort, "frame_stages", spy)
        for prediction in (0.0, 0.5):
            tracker = make_tracker(swarm_settings, prediction=prediction)
            centres.clear()
            poses = [tracker.step(f.observations, f.stamp_ns).pose for f in frames[:3]]
            steps = np.diff([f.stamp_ns for f in frames[:3]])
            moved = poses[1] + prediction * (poses[1] - poses[0]) * steps[1] / steps[0]
            np.testing.assert_allclose(centres[2], moved, atol=1e-12)
            # Nothing is known of the speed yet.
            np.testing.assert_array_equal(centres[0], tracker._motion.start)


class TestViews:
    def test_a_camera_may_be_missing(self, make_tracker, frames, swarm_settings):
        tracker = make_tracker(swarm_settings)
        for number, frame in enumerate(frames[:4]):
            views = dict(frame.images)
            missing = list(views)[number]
            del views[missing]
            result = tracker.step(views, frame.stamp_ns)
            assert result.state is TrackState.TRACKING
            assert set(result.iou) == set(views)
            assert errors_mm(result, frame).mean() < 30.0

    def test_who_stops_and_comes_back_is_named(self, make_tracker, frames, refined_settings):
        tracker = make_tracker(refined_settings)
        said = []
        for number, frame in enumerate(frames):
            seen = frame.observations
            if number in (2, 3):
                del seen["cam02"]
            result = tracker.step(seen, frame.stamp_ns)
            assert result.state is TrackState.TRACKING and set(result.iou) == set(seen)
            assert errors_mm(result, frame).mean() < 30.0
            said.append(tuple(note for note in result.warnings if "cam02" in note))
        assert said == [(), (), ("cam02: left out, no image",), (), ("cam02: taken back",)]

    def test_one_view_is_enough_to_go_on(self, make_tracker, frames, refined_settings):
        result = make_tracker(refined_settings).step({"cam02": frames[0].images["cam02"]}, 0)
        assert set(result.iou) == {"cam02"}
        assert np.isfinite(result.pose).all()

    def test_images_and_observations_may_be_mixed(self, make_tracker, frames, swarm_settings):
        frame = frames[0]
        views = {**frame.images, "cam03": frame.observations["cam03"]}
        result = make_tracker(swarm_settings).step(views, 0)
        assert result.observations["cam03"] is views["cam03"]

    @pytest.mark.parametrize(("side_px", "told"), [(10, True), (3, False)])
    def test_blobs_are_left_out(self, make_tracker, frames, swarm_settings, side_px, told):
        frame = frames[0]
        views = frame.observations
        mask = views["cam01"].mask.copy()
        assert not mask[:14, :14].any()
        mask[2 : 2 + side_px, 2 : 2 + side_px] = True
        views["cam01"] = Observation.from_mask("cam01", 0, mask, views["cam01"].edges)
        result = make_tracker(swarm_settings).step(views, 0)
        said = [text for text in result.warnings if f"cam01: {side_px**2} px of silh" in text]
        assert len(result.warnings) == len(said) == told
        clean = make_tracker(swarm_settings).step(frame.observations, 0)
        assert clean.warnings == ()
        assert result.pose.tobytes() == clean.pose.tobytes()

    @pytest.mark.parametrize("settings", ["swarm_settings", "refined_settings"], indirect=True)
    def test_black_views_lose_the_person_and_good_ones_bring_them_back(
        self, make_tracker, frames, settings
    ):
        tracker = make_tracker(settings)
        assert tracker.step(frames[0].images, 0).state is TrackState.TRACKING
        black = {
            name: Observation.from_mask(name, 1, np.zeros_like(mask), np.zeros(mask.shape, "u1"))
            for name, mask in frames[0].masks.items()
        }
        for stamp_ns in (16_666_667, 33_333_333):
            lost = tracker.step(black, stamp_ns)
            assert lost.state is TrackState.LOST
            assert lost.pose is None
            assert set(lost.iou.values()) == {0.0}
        back = [tracker.step(frames[4].images, 50_000_000 + i * 16_666_667) for i in range(3)]
        assert back[-1].state is TrackState.TRACKING
        # The start pose held would be 54 mm off.
        assert errors_mm(back[-1], frames[4]).mean() < 40.0

    def test_results_cannot_be_changed(self, make_tracker, frames, swarm_settings):
        result = make_tracker(swarm_settings, evaluations=100).step(frames[0].observations, 0)
        for array in (result.pose, result.markers_m):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 0.0


@pytest.mark.parametrize(
    ("optimizer", "evaluations"),
    [("sppso", 1000), ("apf", 1000), ("hmcpso", 3600), ("hmcpso", 7200), ("hmcpso", 10800)],
)
def test_the_preset_paper_spends_the_papers_counts_to_the_unit(
    make_tracker, frames, optimizer, evaluations
):
    settings = {"preset": "paper", "optimizer": optimizer, "evaluations": evaluations, "threads": 1}
    result = make_tracker(settings).step(frames[0].observations, frames[0].stamp_ns)
    assert (result.evaluations, result.refinements) == (evaluations, 0)


def test_settings_of_the_search_change_between_two_steps(make_tracker, frames, swarm_settings):
    tracker = make_tracker(swarm_settings, evaluations=1000)
    steps = iter(frames)

    def spent(**changes):
        if changes:
            values = tracker.config.as_mapping() | changes
            tracker.configure(TrackerConfig.from_mapping(values))
        frame = next(steps)
        result = tracker.step(frame.observations, frame.stamp_ns)
        assert result.state is TrackState.TRACKING
        return result.evaluations, errors_mm(result, frame).mean()

    assert spent()[0] == 1000
    assert spent(evaluations=200)[0] == 200
    with pytest.raises(ConfigError, match="evaluations is 7"):
        tracker.configure(
            TrackerConfig.from_mapping(tracker.config.as_mapping() | {"evaluations": 7})
        )
    assert spent()[0] == 200
    evaluations, error = spent(optimizer="pso", evaluations=1080)
    assert evaluations == 1080 and error < 40.0
    tracker.reset()
    assert tracker.config.optimizer == "pso"


def test_smoothing_begins_and_ends_between_two_steps(make_tracker, frames, refined_settings):
    plain, changed = (make_tracker(refined_settings) for _ in range(2))
    same = []
    for index, frame in enumerate(frames[:5]):
        smoothing = "one_euro" if index in (1, 2, 3) else "none"
        changed.configure(
            TrackerConfig.from_mapping(changed.config.as_mapping() | {"smoothing": smoothing})
        )
        poses = [t.step(frame.observations, frame.stamp_ns).pose for t in (plain, changed)]
        same.append(np.array_equal(*poses))
    # The filter begins with the pose that it is first given.
    assert same == [True, True, False, False, True]
