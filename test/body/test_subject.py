"""A person's sizes: from a stature, from markers, from a file."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from markerless_tracker.body import (
    MARKER_NAMES,
    Subject,
    load_body,
    load_description,
    markers,
    read_subject,
    subject_from_markers,
    subject_from_stature,
    write_subject,
)
from markerless_tracker.body.subject import measured_lengths
from markerless_tracker.errors import BodyModelError

DESCRIPTION = load_description("balan31")
LENGTHS = sorted(DESCRIPTION.lengths)


def named(points):
    return dict(zip(MARKER_NAMES, points, strict=True))


# --- stature ---------------------------------------------------------------------------------


def test_fractions_of_stature() -> None:
    """Drillis and Contini, for a person of 2 m."""
    lengths = subject_from_stature(DESCRIPTION, 2.0).lengths_m
    fractions = {
        "upper_arm": 0.186, "forearm": 0.146, "thigh": 0.245, "calf": 0.246,
        "clavicle": 0.129, "hip_offset": 0.0955,
    }  # fmt: skip
    expected = {f"{side}_{k}": 2.0 * v for k, v in fractions.items() for side in "lr"}
    expected |= {"torso": 2.0 * 0.288, "head": 2.0 * 0.182}
    assert lengths == pytest.approx(expected)


@pytest.mark.parametrize("stature", [0.0, -1.7, 172.0, np.nan, np.inf])
def test_impossible_stature(stature) -> None:
    with pytest.raises(BodyModelError, match="stature is .* expected between 0.5 and 2.6"):
        subject_from_stature(DESCRIPTION, stature)


# --- markers ---------------------------------------------------------------------------------


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_lengths_are_measured_between_markers_of_any_pose(seed) -> None:
    rng = np.random.default_rng(seed)
    sizes = Subject("random", {name: float(rng.uniform(0.1, 0.6)) for name in LENGTHS})
    body = load_body("balan31", sizes)
    points = markers(body, rng.uniform(-2, 2, body.size))
    measured = measured_lengths(DESCRIPTION, named(points))
    assert measured == pytest.approx(sizes.lengths_m)
    alike = subject_from_markers(DESCRIPTION, named(points)).lengths_m
    for name, length in sizes.lengths_m.items():
        other = {"l_": "r_", "r_": "l_"}.get(name[:2], name[:2]) + name[2:]
        assert alike[name] == pytest.approx((length + sizes.lengths_m[other]) / 2.0)


def test_lengths_without_markers_follow_from_the_others() -> None:
    points = named(markers(load_body("balan31", 1.9), np.zeros(31)))
    for name in ("Pelvis", "Head", "LWrist", "RAnkle"):
        del points[name]
    points["RWrist"] = np.array([np.nan, 0, 0])
    measured = subject_from_markers(DESCRIPTION, points)
    assert measured.lengths_m == pytest.approx(subject_from_stature(DESCRIPTION, 1.9).lengths_m)


def test_missing_pelvis_is_the_middle_of_the_hips() -> None:
    points = {"LHip": np.array([0, 0.1, 0]), "RHip": np.array([0, -0.3, 0])}
    points |= {name: np.array([0, 0, 1.0 + i / 9]) for i, name in enumerate(MARKER_NAMES[1:9])}
    measured = subject_from_markers(DESCRIPTION, points)
    assert measured.lengths_m["l_hip_offset"] == pytest.approx(0.2)
    assert measured.lengths_m["torso"] == pytest.approx(np.hypot(1.0, 0.1))


def test_too_few_markers() -> None:
    points = {"LHip": np.zeros(3), "LKnee": np.ones(3) * 0.2, "RHip": np.ones(3) * 0.1}
    with pytest.raises(BodyModelError, match="3 of 14 segment lengths .* LHip, LKnee, .* half"):
        subject_from_markers(DESCRIPTION, points)


def test_no_markers() -> None:
    with pytest.raises(BodyModelError, match="0 of 14 .* markers none"):
        subject_from_markers(DESCRIPTION, {})


def test_markers_in_another_unit_are_refused() -> None:
    points = {
        name: point * 1000
        for name, point in named(markers(load_body("balan31"), np.zeros(31))).items()
    }
    with pytest.raises(BodyModelError, match="expected metres between 0 and 3"):
        subject_from_markers(DESCRIPTION, points)


# --- files -----------------------------------------------------------------------------------

shapes = st.lists(
    st.tuples(st.floats(1e-3, 1), st.floats(1e-3, 1), st.floats(-1, 1), st.floats(-1, 1)),
    min_size=2, max_size=2,
)  # fmt: skip


@settings(
    max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    name=st.text(st.characters(codec="utf-8", exclude_categories=("C", "Z")), min_size=1),
    lengths=st.fixed_dictionaries({k: st.floats(0.01, 2.9) for k in LENGTHS}),
    cones=st.dictionaries(st.sampled_from(["torso", "l_calf", "head"]), shapes),
)
def test_a_subject_file_is_read_back_exactly(tmp_path, name, lengths, cones) -> None:
    cones = {key: np.array(value) for key, value in cones.items()}
    file = tmp_path / "subject.yaml"
    write_subject(file, Subject(name, lengths, cones))
    back = read_subject(file)
    assert back.name == name and back.lengths_m == lengths and set(back.cones_m) == set(cones)
    for key, value in cones.items():
        np.testing.assert_array_equal(back.cones_m[key], value)


def test_a_subjects_own_cones_replace_the_ratios() -> None:
    shape = np.array([[0.1, 0.2, 0.01, 0], [0.3, 0.4, 0, -0.02]])
    lengths = subject_from_stature(DESCRIPTION, 1.7).lengths_m
    body = load_body("balan31", Subject("own", lengths, {"torso": shape}))
    torso = body.cone_names.index("torso")
    np.testing.assert_array_equal(body.cone_shape[torso], shape)
    others = np.arange(len(body.cone_names)) != torso
    np.testing.assert_array_equal(
        body.cone_shape[others], load_body("balan31", 1.7).cone_shape[others]
    )


GOOD = "name: one\nlengths_m: {torso: 0.5, head: 0.3}\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "cannot read the subject"),
        ("[" * 5000, "cannot read the subject"),
        ("", "expected name, lengths_m and optionally cones_m"),
        ("name: one", "expected name, lengths_m"),
        ("lengths_m: [1]", "expected name, lengths_m"),
        (GOOD + "weight: 80", "unknown entry weight"),
        ("lengths_m: {torso: tall}", "length torso is 'tall', expected metres between 0 and 3"),
        ("lengths_m: {torso: -0.5}", "length torso is -0.5"),
        ("lengths_m: {torso: 500}", "length torso is 500"),
        ("lengths_m: {torso: 1%s}" % ("0" * 20), "length torso is 10{20}, expected metres"),
        ("lengths_m: {torso: 1%s}" % ("0" * 400), "length torso is 10{400}, expected metres"),
        ("lengths_m: {torso: 2020-99-99}", "cannot read the subject: month must be in 1..12"),
        (GOOD + "cones_m: {torso: [[1, 1, 0, 0], [1, 1, 0, 1%s]]}" % ("0" * 400), "cones_m must"),
        ("lengths_m: {torso: .nan}", "length torso is nan"),
        ("lengths_m: {torso: true}", "length torso is True"),
        ("lengths_m: {torso: null}", "length torso is None"),
        (GOOD + "cones_m: 3", "cones_m must map cones to two rows of four numbers"),
        (GOOD + "cones_m: {torso: wide}", "cones_m must map"),
        (GOOD + "cones_m: {torso: [[1, 2], [3]]}", "cones_m must map"),
        (GOOD + "cones_m: {torso: [1, 2]}", "cone torso is .*expected two rows"),
        (GOOD + "cones_m: {torso: [[1, 1, 0, 0], [1, 1, 0, .inf]]}", "torso is .*inf.* two rows"),
        (GOOD + "cones_m: {torso: [[1, 1, 0, 0], [1, 0, 0, 0]]}", "cone torso has a radius"),
    ],
)
def test_malformed_subject_files_name_file_and_key(tmp_path, text, words) -> None:
    file = tmp_path / "subject.yaml"
    file.write_text(text)
    with pytest.raises(BodyModelError, match=words) as error:
        read_subject(file)
    assert str(file) in str(error.value) and "\n" not in str(error.value)


def test_missing_and_binary_subject_files(tmp_path) -> None:
    with pytest.raises(BodyModelError, match="nowhere.yaml"):
        read_subject(tmp_path / "nowhere.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(BodyModelError, match="binary.yaml"):
        read_subject(tmp_path / "binary.yaml")


# --- subject and body ------------------------------------------------------------------------


def test_a_subject_fits_every_shipped_body() -> None:
    """Hands and feet that a smaller body lacks come from the stature, and may be to spare."""
    small, large = (load_description(name) for name in ("balan31", "person31"))
    person = subject_from_stature(large, 1.9)
    assert load_body("person31", person).lengths_m == person.lengths_m
    known = {name: person.lengths_m[name] for name in small.lengths}
    assert load_body("balan31", person).lengths_m == known
    from_small = load_body("person31", Subject("short of hands", known)).lengths_m
    assert from_small == pytest.approx(person.lengths_m)


def test_a_missing_length_comes_from_the_stature_of_the_others() -> None:
    lengths = dict(subject_from_stature(DESCRIPTION, 1.5).lengths_m)
    del lengths["l_thigh"]
    lengths["head"] = 0.5  # one odd length does not sway the median
    body = load_body("balan31", Subject("one", lengths))
    assert body.lengths_m["l_thigh"] == pytest.approx(1.5 * 0.245)
    assert body.lengths_m["head"] == 0.5


def test_a_misspelt_length_is_named() -> None:
    lengths = {**subject_from_stature(DESCRIPTION, 1.7).lengths_m, "l_thihg": 0.5}
    with pytest.raises(BodyModelError, match="subject one: no body has a length l_thihg, balan31"):
        load_body("balan31", Subject("one", lengths))


def test_too_few_lengths_are_named() -> None:
    with pytest.raises(BodyModelError, match="subject one: lengths head, .* at least half"):
        load_body("balan31", Subject("one", {"torso": 0.5, "l_thigh": 0.4}))


def test_a_cone_of_another_body_is_named() -> None:
    lengths = subject_from_stature(DESCRIPTION, 1.7).lengths_m
    with pytest.raises(BodyModelError, match="subject one: body balan31 has no cone tail"):
        load_body("balan31", Subject("one", lengths, {"tail": np.ones((2, 4))}))


# --- measured or not -------------------------------------------------------------------------


@pytest.mark.parametrize("measured", [True, False])
def test_a_file_states_whether_its_lengths_were_measured(tmp_path, measured) -> None:
    lengths = subject_from_stature(DESCRIPTION, 1.7).lengths_m
    subject = Subject("one", lengths, measured=measured)
    write_subject(tmp_path / "one.yaml", subject)
    assert ("measured" in (tmp_path / "one.yaml").read_text()) is not measured
    assert read_subject(tmp_path / "one.yaml").measured is measured


def test_measured_is_true_or_false(tmp_path) -> None:
    (tmp_path / "odd.yaml").write_text("lengths_m: {thigh: 0.4}\nmeasured: maybe\n")
    with pytest.raises(BodyModelError, match=r"odd.yaml: measured is 'maybe', expected true"):
        read_subject(tmp_path / "odd.yaml")


def test_a_bodys_lengths_are_measured_or_of_a_stature() -> None:
    assert not load_body("person31", 1.7).measured
    points = named(markers(load_body("balan31", 1.7), load_body("balan31", 1.7).neutral))
    assert subject_from_markers(DESCRIPTION, points).measured
