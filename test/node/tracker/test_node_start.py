"""Starting and ending the node: parameters and files that cannot work, signals, clocks."""

import signal
import sys
import time
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from rclpy.parameter import Parameter

from markerless_tracker.errors import TrackerError

READY_S = 600.0  # the first start compiles


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"sede": 1}, "'sede' is unknown, did you mean 'seed'"),
        ({"scale": 0.0}, "scale: got 0.0"),
        ({"optimizer": "magic"}, "optimizer"),
        ({"calibration_file": "nowhere.toml"}, "calibration_file: nowhere.toml"),
        ({"calibration_file": ""}, "calibration_file: not given"),
        ({"calibration_file": "", "cameras": ["cam01"]}, "tf2_msgs"),
        ({"cameras": ["cam01", "cam09"]}, "cameras: .*cam09"),
        ({"stamp_offsets": [0.1, 0.2]}, "stamp_offsets: got 2 values, expected .* cam01, cam02"),
        ({"cameras": []}, "cameras: an empty list"),
        ({"tf": "all"}, "tf: got 'all', expected one of links, root, none"),
        ({"background_dir": ""}, "background_dir: not given"),
        ({"background_dir": "{empty}"}, "background_dir: .*nothing for cam01, cam02"),
        ({"start_file": "nowhere.yaml"}, "start_file: no start pose: nowhere.yaml"),
        ({"start_file": __file__}, "start_file: no start pose: .*test_node_start.py"),
        ({"subject_file": ""}, "start_file: .* sizes, expected subject_file or stature"),
        ({"subject_file": "nowhere.yaml"}, "subject_file: nowhere.yaml"),
        ({"result_file": "/proc/nowhere/name"}, "result_file: /proc/nowhere"),
    ],
)
def test_what_cannot_work_is_one_line(
    change: dict[str, Any],
    says: str,
    world: Any,
    tmp_path: Path,
    ros_context: Any,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from markerless_tracker.node.tracker.node import TrackerNode

    monkeypatch.setitem(sys.modules, "tf2_msgs", None)
    given = {key: str(value) for key, value in world.parameters().items()}
    for key, value in change.items():
        given[key] = value.format(empty=tmp_path) if isinstance(value, str) else value
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    if change == {"cameras": []}:
        overrides = [p for p in overrides if p.name != "cameras"]
        overrides.append(Parameter("cameras", Parameter.Type.NOT_SET))
    with pytest.raises(TrackerError, match=says) as error:
        node = TrackerNode(context=ros_context, parameter_overrides=overrides)
        end_s = time.monotonic() + 120.0
        while node.fatal is None and time.monotonic() < end_s:
            time.sleep(0.05)
        node.close()
        node.destroy_node()
        raise TrackerError(str(node.fatal))
    assert "\n" not in str(error.value)


def test_an_unknown_parameter_ends_the_process(world: Any, start: Any) -> None:
    process = start("tracker", **world.parameters(), evaluatoins=10)
    assert process.wait() == 1
    (line,) = process.output.splitlines()
    assert line.startswith(
        "tracker: parameter 'evaluatoins' is unknown, did you mean 'evaluations'? `tracker --help`"
    )


def test_an_empty_list_ends_the_process_with_one_line(world: Any, start: Any) -> None:
    process = start("tracker", **world.parameters(), cameras="[]")
    assert process.wait() == 1
    (line,) = process.output.splitlines()
    assert line.startswith("tracker: cameras: an empty list")


def test_a_file_that_cannot_be_used_ends_the_process_with_one_line(world: Any, start: Any) -> None:
    process = start("tracker", **{**world.parameters(), "background_dir": "/nowhere"})
    assert process.wait() == 1
    assert process.output.splitlines()[-1].startswith("tracker: background_dir: /nowhere")
    assert "Traceback" not in process.output


def test_arguments_outside_ros_args_are_refused() -> None:
    from markerless_tracker.node.ros.process import init_context

    with pytest.raises(TrackerError, match="'seed:=1' is not understood.*--ros-args -p"):
        init_context(["seed:=1"])
    with pytest.raises(TrackerError, match="ROS arguments: "):
        init_context(["--ros-args", "-p", "seed"])


def test_the_report_is_compiled_before_the_node_is_ready(
    world: Any, ros_context: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from markerless_tracker.node.tracker.node import TrackerNode
    from markerless_tracker.results.verdict.static_silhouette import StaticSilhouette

    warmed: list[str] = []
    monkeypatch.setattr(StaticSilhouette, "warm_up", lambda _, body: warmed.append(body.name))
    given = {key: str(value) for key, value in world.parameters().items()} | {"threads": 1}
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    node = TrackerNode(context=ros_context, parameter_overrides=overrides)
    try:
        end_s = time.monotonic() + READY_S
        while not node._status.ready and node.fatal is None and time.monotonic() < end_s:
            time.sleep(0.05)
        assert node.fatal is None and node._status.ready
        assert warmed == ["balan31"]
    finally:
        node.close()
        node.destroy_node()


def test_a_signal_while_compiling_leaves_nothing_in_shared_memory(
    world: Any, other_domain: None, start: Any, tmp_path: Path
) -> None:
    environment = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    process = start("tracker", environment=environment, **world.parameters())
    end_s = time.monotonic() + 120.0
    while "compiling" not in process.output:
        assert process.running and time.monotonic() < end_s, process.output
        time.sleep(0.05)
    used = process.shared_memory()
    assert used and all(path.exists() for path in used)
    process.signal(signal.SIGINT)
    assert process.wait() == 0, process.output
    # It ended although the compiler was at work.
    assert "ready" not in process.output and "Traceback" not in process.output
    assert not [path for path in used if path.exists()]


def test_without_a_clock_simulated_time_is_named_and_tracking_works(begin: Any) -> None:
    live = begin(use_sim_time=True)
    live.until(
        lambda: "use_sim_time is set and no /clock is received" in live.message, "the reason"
    )
    live.track()
    assert live.value("state") == "TRACKING"


def test_cameras_that_are_not_used_may_have_backgrounds(begin: Any) -> None:
    live = begin(cameras="[cam01, cam02]")
    live.track()
    assert live.value("state") == "TRACKING" and "iou/cam03" not in live.values


def test_a_camera_that_never_sends_is_left_out(begin: Any) -> None:
    live = begin()
    line = "cam04/image_raw: no usable image"
    live.send_until(lambda: line in live.process.output, "the line", cam04=None)
    live.send_until(
        lambda: "tracking without cam04" in live.message, "tracking without cam04", cam04=None
    )
    assert live.value("state") == "TRACKING"


def test_best_effort_cameras_and_infos_are_heard(begin: Any) -> None:
    live = begin(reliable=False)

    def heard() -> bool:
        live.camera.send_infos()
        return not live.value("missing") and live.value("state") == "TRACKING"

    live.send_until(heard, "everything")
    assert "cam02/camera_info is best effort" in live.process.output
