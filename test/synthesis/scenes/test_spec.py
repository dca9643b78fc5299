"""Sampling of scenes: repeatable, spread as wanted."""

import json

import numpy as np
import pytest

from markerless_tracker.errors import ConfigError
from markerless_tracker.synthesis.scenes import DEVELOPMENT_SEEDS, TEST_SEEDS, sample_scene

SPECS = [sample_scene(seed) for seed in range(300)]


def share(test) -> float:
    return float(np.mean([test(spec) for spec in SPECS]))


def test_two_sets_of_forty_that_share_no_seed() -> None:
    assert len(set(DEVELOPMENT_SEEDS)) == len(set(TEST_SEEDS)) == 40
    assert not set(DEVELOPMENT_SEEDS) & set(TEST_SEEDS)


def test_a_seed_names_a_scene_and_json_holds_it() -> None:
    assert sample_scene(11) == sample_scene(11) != sample_scene(12)
    values = json.loads(json.dumps(sample_scene(11).values()))
    assert values["seed"] == 11 and len(values["cameras"]) == 4
    assert values["person"]["stature_m"] == sample_scene(11).person.stature_m


def test_small_images_show_the_same_scene() -> None:
    large, small = sample_scene(11), sample_scene(11, (160, 120))
    assert (large.person, large.paint, large.room) == (small.person, small.paint, small.room)
    assert [c.eye_m for c in large.cameras] == [c.eye_m for c in small.cameras]
    assert large.cameras[0].focal_px == pytest.approx(4.0 * small.cameras[0].focal_px)


def test_clothes_often_have_the_colour_of_the_room() -> None:
    def like(part, what, same=True):
        return share(
            lambda s: s.paint[part].like == what and (s.paint[part].ratio == 1.0 or not same)
        )

    assert 0.27 < like("lower", "floor") < 0.46
    assert 0.20 < like("upper", "wall") < 0.35
    assert 0.10 < like("shoes", "floor") < 0.35
    assert 0.02 < like("skin", "wall") < 0.15 and 0.04 < like("hair", "wall") < 0.25
    # Darker and brighter ones as well.
    assert 0.10 < like("lower", "floor", same=False) - like("lower", "floor") < 0.30
    ratios = [s.paint["lower"].ratio for s in SPECS if s.paint["lower"].like]
    assert min(ratios) < 0.7 and max(ratios) > 1.2


def test_light_noise_and_texture_have_their_ranges() -> None:
    for spec in SPECS:
        room, sensor = spec.room, spec.sensor
        assert 0.15 < room.lamps[0].share < 0.6
        assert sum(lamp.share for lamp in room.lamps) + room.ambient == pytest.approx(1.0)
        assert room.ambient > 0.05
        assert 1.0 <= sensor.noise <= 6.0 and 0.0 <= room.floor.contrast <= 25.0
        for camera in spec.cameras:
            assert 1.0 < camera.eye_m[2] < 2.7
    radii = [spec.room.lamps[0].radius_m for spec in SPECS]
    assert np.mean(np.array(radii) < 0.06) == pytest.approx(0.5, abs=0.1)
    assert max(radii) > 0.5
    assert 0.08 < share(lambda s: s.sensor.grey) < 0.25
    assert 0.3 < share(lambda s: s.sensor.drift > 0.0) < 0.7
    assert len({s.posture for s in SPECS}) == 6 and len({s.motion for s in SPECS}) == 4


def test_an_impossible_seed() -> None:
    with pytest.raises(ConfigError, match="seed of a scene is -1"):
        sample_scene(-1)
