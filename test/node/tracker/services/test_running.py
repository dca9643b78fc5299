"""What can be asked of a running tracker: settings and services, over the real middleware."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

# ruff: noqa: E402
rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from markerless_tracker.body import read_subject
from markerless_tracker.camera.calibration import read_calibration
from markerless_tracker.node.tracker.changes import LIVE
from markerless_tracker.node.tracker.parameters import parameter_names


@pytest.fixture(scope="module")
def running(world: Any, tmp_path_factory: Any, tools: Any, scenes: Any) -> Iterator[Any]:
    folder = tmp_path_factory.mktemp("running")
    context = rclpy.Context()
    rclpy.init(context=context, args=[])
    peer = tools.Peer(context)
    given = {"result_file": folder / "live", "save_dir": folder / "saved"}
    process = tools.Process("tracker", folder / "tracker.log", {**world.parameters(), **given})
    try:
        live = scenes.Live(peer, process, world)
        live.folder = folder
        yield live
    finally:
        process.stop()
        peer.close()
        context.try_shutdown()


def call(running: Any, kind: Any, name: str, request: Any) -> Any:
    client = running.peer.node.create_client(kind, f"tracker/{name}")
    running.until(client.service_is_ready, name)
    future = client.call_async(request)
    running.until(future.done, f"the answer of {name}")
    running.peer.node.destroy_client(client)
    return future.result()


def put(running: Any, **values: Any) -> list[Any]:
    """Set parameters one by one; a double underscore stands for the dot of a group."""
    messages = [
        Parameter(name.replace("__", "."), value=value).to_parameter_msg()
        for name, value in values.items()
    ]
    return list(call(running, SetParameters, "set_parameters", SetParameters.Request(
        parameters=messages)).results)  # fmt: skip


def value(running: Any, name: str) -> Any:
    (found,) = call(running, GetParameters, "get_parameters", GetParameters.Request(
        names=[name])).values  # fmt: skip
    return rclpy.parameter.parameter_value_to_python(found)


def trigger(running: Any, name: str) -> tuple[bool, str]:
    answer = call(running, Trigger, name, Trigger.Request())
    return answer.success, answer.message


def test_sizes_cannot_be_saved_before_somebody_was_tracked(running: Any) -> None:
    assert trigger(running, "save_subject") == (
        False, "nobody was tracked, so no sizes are known",
    )  # fmt: skip


def test_what_follows_from_a_setting_follows_it_unless_it_was_given(running: Any) -> None:
    for optimizer, evaluations in (("pso", 3600), ("sppso", 1000)):
        (done,) = put(running, optimizer=optimizer)
        assert done.successful, done.reason
        assert value(running, "optimizer") == optimizer
        assert value(running, "evaluations") == evaluations
        running.track()
        assert running.value("state") == "TRACKING"


def test_settings_of_the_search_take_effect_with_the_next_set(running: Any) -> None:
    running.track()
    running.track()  # swarms search the first frame in any case
    few = int(running.value("evaluations"))
    (done,) = put(running, refine__swarms="always")
    assert done.successful and done.reason == ""
    running.track()
    more = int(running.value("evaluations"))
    assert more > few
    assert all(result.successful for result in put(running, evaluations=2000))
    running.track()
    assert int(running.value("evaluations")) > more
    assert value(running, "evaluations") == 2000
    running.until(
        lambda: "from the next set on: evaluations is 2000" in running.process.output, "the line"
    )
    assert running.value("state") == "TRACKING"
    (done,) = put(running, optimizer="pso")
    assert not done.successful and "2000, which pso cannot spend exactly" in done.reason


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"evaluations": 7}, "evaluations"),
        ({"evaluations": 0}, "evaluations"),
        ({"optimizer": "magic"}, "optimizer: got 'magic', expected one of sppso"),
        ({"refine__prior": -1.0}, "refine.prior"),
        ({"smoothing": 3}, "Wrong parameter type, expected 'Type.STRING'"),
        ({"body": "person31"}, "read-only"),
        ({"scale": 0.5}, "read-only"),
    ],
)
def test_what_cannot_be_is_refused_with_the_reason(
    running: Any, values: dict[str, Any], says: str
) -> None:
    names = [name.replace("__", ".") for name in values]
    before = [value(running, name) for name in names]
    (done,) = put(running, **values)
    assert not done.successful and says in done.reason and "\n" not in done.reason
    assert [value(running, name) for name in names] == before


def test_descriptors_say_what_may_be_set(running: Any) -> None:
    names = list(parameter_names())
    described = call(
        running, DescribeParameters, "describe_parameters", DescribeParameters.Request(names=names)
    ).descriptors
    assert {d.name for d in described if not d.read_only} == set(LIVE)
    for descriptor in described:
        fixed = "fixed while the node runs" in descriptor.additional_constraints
        assert fixed == descriptor.read_only, descriptor.name


def test_the_sizes_and_the_cameras_are_saved(running: Any) -> None:
    running.track()
    path = running.folder / "saved" / "subject.yaml"
    done, message = trigger(running, "save_subject")
    assert done and message.startswith(f"{path}: sizes")
    saved, given = read_subject(path), running.world.scene.subject()
    assert dict(saved.lengths_m) == pytest.approx(dict(given.lengths_m))
    assert saved.cones_m
    assert trigger(running, "save_subject") == (
        False, f"save_dir: {path} exists, and `overwrite` is false",
    )  # fmt: skip
    done, message = trigger(running, "save_calibration")
    path = running.folder / "saved" / "calibration.toml"
    assert done and message.startswith(f"{path}: calibration of cam01, cam02")
    rig = read_calibration(path)
    assert rig.names == running.world.scene.rig.names
    assert rig["cam02"].size_px == running.world.scene.rig["cam02"].size_px


def test_changes_are_part_of_the_result(running: Any) -> None:
    running.track()
    for smoothing in ("one_euro", "none"):
        assert all(done.successful for done in put(running, smoothing=smoothing))
        index = running.track()
    running.process.stop()
    result = json.loads(Path(running.folder / "live.json").read_text())
    changed = result["changed"]
    told = [{name: v for name, v in entry.items() if name != "stamp_ns"} for entry in changed]
    # Tests before this one, if any ran on the same tracker, changed other settings.
    assert told[-2:] == [{"smoothing": "one_euro"}, {"smoothing": "none"}]
    stamps = [entry["stamp_ns"] for entry in changed]
    assert stamps == sorted(stamps) and stamps[-1] <= running.camera.scene.stamp_ns(index)
    assert result["settings"]["evaluations"] == 1000
