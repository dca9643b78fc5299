"""Generated people: sizes, surface, cloth that hangs."""

import dataclasses

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, load_body, markers
from markerless_tracker.synthesis.people import ACTIONS, Action, Person, sample_person
from markerless_tracker.synthesis.people.person import PARTS

PEOPLE = [sample_person(np.random.default_rng(seed)) for seed in range(200)]
PERSON = Person(PEOPLE[0])


def test_people_differ_as_adults_do() -> None:
    men = np.array([p.stature_m for p in PEOPLE if p.sex == "male"])
    women = np.array([p.stature_m for p in PEOPLE if p.sex == "female"])
    assert min(len(men), len(women)) > 70
    assert men.mean() == pytest.approx(1.77, abs=0.03) and 0.05 < men.std() < 0.09
    assert women.mean() == pytest.approx(1.64, abs=0.03) and 0.04 < women.std() < 0.08
    thighs = np.array([[p.lengths_m[f"{s}_thigh"] / p.stature_m for s in "lr"] for p in PEOPLE])
    assert 0.03 < thighs.mean(axis=1).std() / thighs.mean() < 0.05
    assert 0.001 < np.abs(thighs[:, 0] / thighs[:, 1] - 1.0).mean() < 0.02
    for kind in ("hair", "lower", "upper"):
        assert len({getattr(p, kind) for p in PEOPLE}) >= 2


def test_a_person_stands_as_tall_as_said() -> None:
    for spec in PEOPLE[:6]:
        person = Person(dataclasses.replace(spec, hair="none"))
        vertices = person.posed(person.body.neutral).vertices
        height = vertices[:, 2].max() - vertices[:, 2].min() - spec.sole_m
        # Segments scatter on their own about the stature.
        assert height == pytest.approx(spec.stature_m, rel=0.08)


def test_joints_lie_inside_the_body() -> None:
    """Seen from the front and from the side, some vertex lies on every side of each joint."""
    for spec in PEOPLE[:6]:
        person = Person(spec)
        pose = Action(person, "walk", 3).pose(0.4)
        vertices = person.posed(pose).vertices
        for name, joint in zip(MARKER_NAMES, markers(person.body, pose), strict=True):
            if name == "Head":
                continue
            near = vertices[np.linalg.norm(vertices - joint, axis=1) < 0.16] - joint
            for direction in (0, 1):
                assert (near[:, direction] > 0.01).any() and (near[:, direction] < -0.01).any()


def test_the_surface_is_closed() -> None:
    edges = np.concatenate([PERSON.triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    there = {tuple(edge) for edge in edges.tolist()}
    assert len(there) == len(edges)
    assert all((b, a) in there for a, b in there)


def test_normals_point_out_of_limbs() -> None:
    posed = PERSON.posed(PERSON.body.neutral)
    a, b, c = posed.vertices[posed.triangles].transpose(1, 0, 2)
    shoes = (posed.part == PARTS.index("shoes"))[posed.triangles[:, 0]]
    volume = np.einsum("ni,ni->n", a, np.cross(b, c))[shoes].sum() / 6.0
    assert 0.001 < volume < 0.01


def test_sections_are_no_cones_of_a_tracker() -> None:
    """A square-ish section sticks out of the ellipse with the same axes."""
    spec = dataclasses.replace(PEOPLE[0], exponent=3.2)
    round_spec = dataclasses.replace(PEOPLE[0], exponent=2.0)
    outer, inner = (Person(s).posed(PERSON.body.neutral).vertices for s in (spec, round_spec))
    radius = np.linalg.norm(outer[:, :2], axis=1) - np.linalg.norm(inner[:, :2], axis=1)
    assert radius.max() > 0.008


def test_loose_sleeves_hang_below_a_raised_arm() -> None:
    loose = dataclasses.replace(PEOPLE[0], sleeve=0.97, sleeve_ease_m=0.03, wrinkle_m=0.0)
    tight = dataclasses.replace(loose, sleeve_ease_m=0.0)
    lowest = {}
    for name, spec in (("loose", loose), ("tight", tight)):
        person = Person(spec)
        action = Action(person, "wide", 1)
        pose = action.pose(0.0)
        joints = dict(zip(MARKER_NAMES, markers(person.body, pose), strict=True))
        middle = 0.5 * (joints["LElbow"] + joints["LWrist"])
        posed = person.posed(pose)
        near = np.linalg.norm(posed.vertices[:, :2] - middle[:2], axis=1) < 0.05
        sleeve = posed.vertices[near & (posed.part == PARTS.index("upper")), 2] - middle[2]
        lowest[name] = (sleeve.min(), sleeve.max())
    drop = lowest["tight"][0] - lowest["loose"][0]
    rise = lowest["loose"][1] - lowest["tight"][1]
    assert drop > 0.025 and rise < 0.015 and drop > rise + 0.02


@pytest.mark.parametrize("kind", ACTIONS)
def test_soles_stay_on_the_floor_and_joints_within_their_limits(kind) -> None:
    for seed in range(3):
        person = Person(PEOPLE[seed])
        action = Action(person, kind, seed)
        low = [person.lowest_m(action.pose(t)) for t in np.arange(0.0, 2.0, 0.1)]
        assert min(low) > -0.03 and max(low) < 0.04
        track = np.array([action.pose(t) for t in np.arange(0.0, 2.0, 1 / 60)])
        assert np.abs(np.diff(track, axis=0)).max() < 0.35
        low_limits, high_limits = person.body.limits
        assert (track > low_limits).all() and (track < high_limits).all()


def joints_of(kind, seed=0):
    person = Person(PEOPLE[seed])
    pose = Action(person, kind, seed).pose(0.3)
    pose[person.body.index("pelvis_rz")] = 0.0
    found = dict(zip(MARKER_NAMES, markers(person.body, pose), strict=True))
    return found, person.spec.stature_m


@pytest.mark.parametrize("seed", range(4))
def test_postures_are_what_they_are_called(seed) -> None:
    squat, s = joints_of("squat", seed)
    assert squat["Pelvis"][2] < 0.40 * s and squat["LKnee"][0] > squat["LAnkle"][0]
    bent, s = joints_of("bent", seed)
    assert bent["Neck"][2] < bent["Pelvis"][2] + 0.12 * s and bent["Neck"][0] > bent["Pelvis"][0]
    seated, s = joints_of("seated", seed)
    assert abs(seated["LKnee"][2] - seated["LHip"][2]) < 0.08 * s
    assert seated["LKnee"][0] - seated["LHip"][0] > 0.18 * s
    raised, s = joints_of("raised", seed)
    assert min(raised["LWrist"][2], raised["RWrist"][2]) > raised["Neck"][2] + 0.1 * s
    wide, s = joints_of("wide", seed)
    assert wide["LWrist"][1] - wide["RWrist"][1] > 0.74 * s
    crossed, _ = joints_of("crossed", seed)
    assert crossed["LWrist"][1] < crossed["RWrist"][1]
    for side in "LR":
        assert crossed[f"{side}Wrist"][0] > crossed["Neck"][0]
        assert crossed["Pelvis"][2] < crossed[f"{side}Wrist"][2] < crossed["Neck"][2]


def test_the_spine_bends_where_no_tracker_bends() -> None:
    tracker = load_body("person35")
    assert set(PERSON.body.parameter_names) - set(tracker.parameter_names) == {"spine_x", "spine_y"}
    straight, bent = PERSON.body.neutral.copy(), PERSON.body.neutral.copy()
    bent[PERSON.body.index("spine_y")] = 0.6
    trunk = [
        np.linalg.norm(np.subtract(*markers(PERSON.body, pose)[[0, 1]]))
        for pose in (straight, bent)
    ]
    assert trunk[1] < trunk[0] - 0.005
