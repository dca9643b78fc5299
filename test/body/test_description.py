"""Body descriptions: valid files, and the errors of malformed ones."""

import copy

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from markerless_tracker.body import load_body, load_description
from markerless_tracker.body.description import parse_chain
from markerless_tracker.body.schema import check_description
from markerless_tracker.errors import BodyModelError
from markerless_tracker.resources import config_dir

SHIPPED = sorted((config_dir() / "bodies").glob("*.yaml"))
GOOD = yaml.safe_load((config_dir() / "bodies" / "balan31.yaml").read_text())
GONE = object()


def paths(data, above=()):
    """Where values stand in nested mappings and lists."""
    for key, value in data.items() if isinstance(data, dict) else enumerate(data):
        yield (*above, key)
        if isinstance(value, (dict, list)):
            yield from paths(value, (*above, key))


def changed(path, value):
    """The good description with one value replaced, or taken away."""
    data = copy.deepcopy(GOOD)
    place = data
    for key in path[:-1]:
        place = place[key]
    if value is GONE:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return data


def load(tmp_path, data):
    file = tmp_path / "body.yaml"
    file.write_text(data if isinstance(data, str) else yaml.safe_dump(data, sort_keys=False))
    return load_body(file), file


@pytest.mark.parametrize("path", SHIPPED, ids=lambda p: p.stem)
def test_shipped_bodies_load_by_name_and_by_file(path) -> None:
    by_name, by_file = load_body(path.stem), load_body(path)
    assert by_name.name == by_file.name == path.stem
    assert by_name.parameter_names == by_file.parameter_names


def test_an_unknown_body_lists_the_shipped_ones() -> None:
    with pytest.raises(BodyModelError, match="body 'spider' is unknown, expected balan31, .*yaml"):
        load_description("spider")


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (("markers",), GONE, "markers missing"),
        (("extra",), {}, "extra unknown, expected name, lengths"),
        ((7,), {}, "7 unknown"),
        (("name",), 31, "name is 31, expected text"),
        (("lengths", "torso"), 0.5, "lengths: torso is 0.5, expected a mapping"),
        (
            ("lengths", "torso", "stature"),
            "big",
            "lengths: torso: stature is 'big', expected a number",
        ),
        (("lengths", "torso"), GONE, "frame thorax: 'torso' is neither a parameter nor a length"),
        (("parameters", "l_knee", "sigma"), GONE, "parameters: l_knee: sigma missing"),
        (("parameters", "l_knee", "sigma"), 0.0, "l_knee: sigma is 0.0, expected a number above 0"),
        pytest.param(
            ("parameters", "l_knee", "sigma"), 10**400, "sigma is 10{400}, expected", id="too large"
        ),
        (("parameters", "l_knee", "limits"), [5, -155], "l_knee: limits is .* lower one first"),
        (("parameters", "l_knee", "walking"), [1], "l_knee: walking is .* two numbers"),
        (("parameters", "l_knee", "free"), True, "l_knee: free unknown, expected sigma, neutral"),
        (("parameters", "l_toe"), {"sigma": 1.0}, "no frame is moved by parameter l_toe"),
        (("frames", "l_knee", "parent"), "l_toe", "frame l_knee: 'l_toe' is not defined"),
        (("frames", "pelvis", "parent"), "head", "frame pelvis: 'head' is not defined"),
        (("frames", "l_knee", "chain"), "tz(l_thigh) spin(3)", "frame l_knee: chain .* 'spin"),
        (("frames", "l_knee", "chain"), "ry(l_thigh)", "rotates by the length 'l_thigh'"),
        (("root",), "tail", "root is 'tail', expected the name of a frame"),
        (("markers", "LToe"), {"frame": "l_knee"}, "markers must be exactly Pelvis, Neck"),
        (("markers", "Neck"), GONE, "markers must be exactly"),
        (("markers", "Neck", "frame"), "nape", "marker Neck: 'nape' is not defined"),
        (("cones", "torso", "start"), [0.1, 0, 0, 0], "cones: torso: start is .* positive radii"),
        (("cones", "torso", "edges"), ["bottom"], "cones: torso: edges is .* 'sides' and 'top'"),
        (("cones", "torso", "length"), "spine", "cone torso: 'spine' is not defined"),
        (("collisions", 0), ["torso"], "collisions is .* expected a list of pairs"),
        (("collisions", 0), ["torso", "tail"], "collisions: 'tail' is not defined"),
        (("subspaces", "root"), GONE, "subspaces: root needs six parameters"),
        (("hierarchies", "six"), [], r"hierarchies: six is \[\], expected steps"),
        (("hierarchies", "six"), ["root"], "hierarchies: six is .* expected steps"),
        (("hierarchies", "six"), [["tail"]], "hierarchies: six: subspace 'tail' is not defined"),
        (("subspaces", "l_leg"), ["l_toe"], "subspace l_leg: 'l_toe' is not defined"),
    ],
)
def test_malformed_descriptions_name_file_and_key(tmp_path, path, value, words) -> None:
    with pytest.raises(BodyModelError, match=words) as error:
        load(tmp_path, changed(path, value))
    assert str(tmp_path / "body.yaml") in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    "text", ["{", "", "- 1", "12", "[" * 5000, "a: !!python/object:os.system {}"]
)
def test_files_that_are_no_descriptions(tmp_path, text) -> None:
    with pytest.raises(BodyModelError, match=r"body\.yaml"):
        load(tmp_path, text)


def test_missing_and_binary_files(tmp_path) -> None:
    with pytest.raises(BodyModelError, match="nowhere.yaml"):
        load_body(tmp_path / "nowhere.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(BodyModelError, match="binary.yaml"):
        load_body(tmp_path / "binary.yaml")


@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    path=st.sampled_from(sorted(paths(GOOD), key=str)),
    value=st.sampled_from(
        [GONE, None, "x", "rx(zz)", 1, -1.0, float("nan"), True, [], {}, [1, 2], ["x"], {"x": 1}]
    ),
)
def test_any_single_change_loads_or_is_an_error(tmp_path, path, value) -> None:
    try:
        load(tmp_path, changed(path, value))
    except BodyModelError as error:
        assert str(tmp_path / "body.yaml") in str(error)
        assert "\n" not in str(error)


json = st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(max_size=3),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.text(max_size=3) | st.sampled_from(sorted(GOOD)), inner, max_size=9)
    ),
    max_leaves=15,
)


@settings(max_examples=200, deadline=None)
@given(data=json)
def test_anything_else_is_no_description(data) -> None:
    with pytest.raises(BodyModelError, match="file"):
        check_description(data, "file")


# --- chains ----------------------------------------------------------------------------------


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["rx", "ry", "rz", "tx", "ty", "tz"]),
            st.sampled_from(["", "+", "-"]),
            st.sampled_from(["", "0.4*", ".5 * ", "2*"]),
            st.sampled_from(["l_hip_y", "torso", "90", "0.25", ".5", "3."]),
        )
    )
)
def test_chains_are_parsed(moves) -> None:
    text = " ".join(f"{kind}({sign}{factor}{value})" for kind, sign, factor, value in moves)
    parsed = parse_chain(text, "here")
    assert len(parsed) == len(moves)
    for move, (kind, sign, factor, value) in zip(parsed, moves, strict=True):
        assert move.kind == kind
        scale = float(factor.strip(" *") or 1.0)
        assert move.factor == (-scale if sign == "-" else scale)
        assert move.argument == (value if value[0].isalpha() else float(value))


@pytest.mark.parametrize("text", ["rx", "rx()", "rx(1e3)", "rx(90", "qx(90)", "rx(--a)", "rx(a b)"])
def test_text_that_is_no_move_is_an_error(text) -> None:
    with pytest.raises(BodyModelError, match="here: chain .*, expected moves such as"):
        parse_chain(f"ty(1) {text}", "here")
