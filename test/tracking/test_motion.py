"""Prediction, widening and region margin of the motion model, without images."""

import numpy as np
import pytest

from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.motion import (
    LEAST_NS,
    LIMB_ACCELERATION_M_S2,
    LIMB_SPEED_M_S,
    MotionModel,
)

FRAME_NS = 16_666_667
FREE = np.array([[-np.inf] * 3, [np.inf] * 3])


@pytest.fixture
def motion() -> MotionModel:
    config = TrackerConfig.from_mapping(
        {"prediction": 0.5, "sigma.rate_max": 6.0, "region.margin_m": 0.2}
    )
    return MotionModel(np.array([1.0, 2.0, 3.0]), config)


def moved(motion, by: float, stamp_ns: int, **changes) -> None:
    motion.update(motion.pose + by, stamp_ns, **{"tracked": True, **changes})


def test_before_the_first_frame_the_start_is_predicted(motion):
    assert motion.predict(10**12, FREE) is motion.start
    assert motion.widening(10**12) == 1.0
    assert motion.region_margin_m(10**12) is None


def test_the_prediction_moves_on_by_a_fraction_of_the_last_change(motion):
    moved(motion, 9.0, 0)
    np.testing.assert_array_equal(motion.velocity_per_ns, 0.0)
    moved(motion, 0.1, FRAME_NS)
    predicted = motion.predict(3 * FRAME_NS, FREE) - motion.pose
    np.testing.assert_allclose(predicted, 0.5 * 0.1 * 2, rtol=1e-12)


def test_frames_that_are_very_close_keep_the_velocity(motion):
    """Two buffered images: a millimetre of noise would be a speed of metres a second."""
    moved(motion, 0.0, 0)
    moved(motion, 0.02, FRAME_NS)
    before = motion.velocity_per_ns.copy()
    moved(motion, 0.001, FRAME_NS + LEAST_NS // 4)
    np.testing.assert_array_equal(motion.velocity_per_ns, before)
    moved(motion, 0.001, FRAME_NS + LEAST_NS // 2, jumped=np.array([1]))
    assert motion.velocity_per_ns[1] == 0.0 and motion.velocity_per_ns[0] == before[0]


def test_predictions_keep_the_limits(motion):
    moved(motion, 0.0, 0)
    moved(motion, 1.0, FRAME_NS)
    limits = np.array([[-9.0] * 3, [2.1, 9.0, 9.0]])
    np.testing.assert_allclose(motion.predict(2 * FRAME_NS, limits), [2.1, 3.5, 4.5])


def test_what_did_not_move_there_has_no_velocity(motion):
    moved(motion, 0.0, 0)
    moved(motion, 0.1, FRAME_NS, jumped=np.array([1]))
    assert motion.velocity_per_ns[1] == 0.0 and motion.velocity_per_ns[0] > 0.0
    moved(motion, 0.1, 2 * FRAME_NS, tracked=False)
    np.testing.assert_array_equal(motion.velocity_per_ns, 0.0)
    moved(motion, 0.1, 3 * FRAME_NS)
    motion.lose()
    np.testing.assert_array_equal(motion.velocity_per_ns, 0.0)


@pytest.mark.parametrize(
    ("elapsed_s", "factor"), [(1 / 60, 1.0), (3 / 60, 3.0), (0.5 / 60, 0.5), (9.0, 6.0), (-1.0, 1)]
)
def test_sigma_widens_with_the_time_up_to_a_bound(motion, elapsed_s, factor):
    moved(motion, 0.0, 5 * 10**9)
    stamp_ns = 5 * 10**9 + round(elapsed_s * 1e9)
    assert motion.widening(stamp_ns) == pytest.approx(factor, rel=1e-6)


def test_the_region_grows_with_the_time_while_tracked(motion):
    moved(motion, 0.0, 0)
    assert motion.region_margin_m(10**9) == pytest.approx(0.2 + LIMB_SPEED_M_S)
    assert motion.region_margin_m(0) is None
    motion.lose()
    assert motion.region_margin_m(10**9) is None


def test_in_a_short_time_the_region_grows_as_a_limb_can_accelerate(motion):
    moved(motion, 0.0, 0)
    short_s = 0.02
    grown_m = motion.region_margin_m(round(short_s * 1e9)) - 0.2
    assert grown_m == pytest.approx(0.5 * LIMB_ACCELERATION_M_S2 * short_s**2)
    assert grown_m < LIMB_SPEED_M_S * short_s


def test_a_shift_keeps_limits_and_velocity(motion):
    moved(motion, 0.0, 0)
    moved(motion, 0.1, FRAME_NS)
    before = motion.velocity_per_ns.copy()
    motion.shift(np.full(3, 0.5), np.array([[-9.0] * 3, [1.2, 9.0, 9.0]]))
    np.testing.assert_allclose(motion.pose, [1.2, 2.6, 3.6])
    np.testing.assert_array_equal(motion.velocity_per_ns, before)


def test_reset_is_the_beginning(motion):
    moved(motion, 0.5, 0)
    moved(motion, 0.5, FRAME_NS)
    motion.reset()
    assert motion.predict(2 * FRAME_NS, FREE) is motion.start
    assert motion.stamp_ns is None


def test_what_can_be_reached_grows_with_the_time_since_a_tracked_pose(motion):
    speeds = np.array([np.inf, 10.0, 10.0])
    limits = np.array([[-np.inf, -np.inf, -np.inf], [np.inf, np.inf, 3.05]])
    moved(motion, 0.0, 0)
    low, high = motion.reachable(10_000_000, limits, speeds)
    np.testing.assert_allclose(low, [-np.inf, 1.9, 2.9])
    np.testing.assert_allclose(high, [np.inf, 2.1, 3.05])
    # At rest in time, and while the person is lost, there is no bound but the limits.
    np.testing.assert_array_equal(motion.reachable(0, limits, speeds), limits)
    moved(motion, 0.0, 10_000_000, tracked=False)
    np.testing.assert_array_equal(motion.reachable(20_000_000, limits, speeds), limits)
