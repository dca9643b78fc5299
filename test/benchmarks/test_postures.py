"""Starts of generated people in postures."""

import pytest

from markerless_tracker.benchmarks.postures import POSTURES, measure_postures, posture_of
from markerless_tracker.benchmarks.starts import StartPlan
from markerless_tracker.cli.main import main
from markerless_tracker.errors import ConfigError
from markerless_tracker.synthesis.scenes import DEVELOPMENT_SEEDS, TEST_SEEDS
from markerless_tracker.tracking import TrackerConfig


def test_two_hundred_starts_differ_and_keep_to_their_set() -> None:
    starts = [posture_of(number) for number in range(200)]
    assert len(set(starts)) == 200
    assert {seed for seed, _ in starts} == set(DEVELOPMENT_SEEDS)
    assert {posture for _, posture in starts[:5]} == set(POSTURES)
    assert posture_of(0, "test")[0] in TEST_SEEDS


def test_a_squatting_person_of_another_shape_is_found() -> None:
    plan = StartPlan(TrackerConfig(threads=1), frames=2)
    figures = measure_postures(plan, 1, exact=True)
    (start,) = figures["starts"]
    assert start["posture"] == "squat" and start["seed"] == DEVELOPMENT_SEEDS[0]
    assert figures["succeeded"] == figures["postures"]["squat"] == 1.0
    assert figures["worst_mm"] < 60.0 and figures["wrong_heading"] == 0.0


def test_unknown_sets_are_refused() -> None:
    with pytest.raises(ConfigError, match="'other', expected one of development, test"):
        measure_postures(StartPlan(TrackerConfig()), 1, which="other")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "expected recordings or --postures N, and not both"),
        (["somewhere", "--postures", "2"], "expected recordings or --postures N, and not both"),
        (["somewhere", "--exact"], "--exact and --set need --postures"),
        (
            ["--postures", "2", "--scale", "0.5"],
            "expected no --stature, --scale, --every or --seeds",
        ),
        (
            ["--postures", "2", "--every", "10"],
            "expected no --stature, --scale, --every or --seeds",
        ),
        (["--postures", "2", "--seeds", "1"], "expected no --stature, --scale, --every or --seeds"),
    ],
)
def test_options_that_do_not_go_together_are_refused(words, message, capsys) -> None:
    assert main(["benchmark", "start", *words]) == 1
    assert message in capsys.readouterr().err
