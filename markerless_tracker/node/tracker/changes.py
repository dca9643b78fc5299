"""Changes of settings while the tracker runs: checked when set, used from the next set on."""

from collections.abc import Callable, Mapping
from threading import Lock
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraRig
from markerless_tracker.errors import ConfigError
from markerless_tracker.imaging import BackgroundModel
from markerless_tracker.records import TrackResult
from markerless_tracker.tracking import Tracker, TrackerConfig
from markerless_tracker.tracking.config import live_settings
from markerless_tracker.tracking.processes.tracker_process import TrackerProcess
from markerless_tracker.tracking.stages.frame import frame_stages
from markerless_tracker.tracking.start.required import require_parts_of_a_start

LIVE = live_settings()
"""Parameters that may be set while the tracker runs."""


class SettableTracker:
    """A tracker whose settings other threads may change between two steps.

    Args:
        tracker: the tracker.
        changed: called in the thread of the steps with new settings and the stamp of their first
            set.
    """

    def __init__(
        self,
        tracker: Tracker | TrackerProcess,
        changed: Callable[[int, TrackerConfig], None] = lambda *_: None,
    ) -> None:
        self._tracker = tracker
        self._changed = changed
        self._lock = Lock()
        self._next: TrackerConfig | None = None

    @property
    def body(self) -> BodyModel:
        """As `Tracker.body`."""
        return self._tracker.body

    @property
    def rig(self) -> CameraRig:
        """As `Tracker.rig`."""
        return self._tracker.rig

    def check(self, config: TrackerConfig) -> None:
        """Check that settings can be used.

        Raises:
            ConfigError: their budget cannot be spent, or the body lacks what `search_again` takes.
        """
        body = self._tracker.body
        frame_stages(body, config, body.neutral, body.sigma)
        if config.search_again:
            require_parts_of_a_start(body)

    def configure(self, config: TrackerConfig) -> None:
        """Use checked settings from the next step on."""
        with self._lock:
            self._next = config

    def warm_up(self) -> None:
        """As `Tracker.warm_up`."""
        self._tracker.warm_up()

    def prepare(self, views: Mapping[str, Any], stamp_ns: int) -> Any:
        """As `Tracker.prepare`."""
        return self._tracker.prepare(views, stamp_ns)

    def step(self, views: Any, stamp_ns: int, effort: float = 1.0) -> TrackResult:
        """As `Tracker.step`, with the latest settings."""
        with self._lock:
            config, self._next = self._next, None
        if config is not None:
            self._tracker.configure(config)
            self._changed(stamp_ns, config)
        return self._tracker.step(views, stamp_ns, effort)

    def reset(self) -> None:
        """As `Tracker.reset`."""
        self._tracker.reset()

    def take_backgrounds(self, backgrounds: Mapping[str, BackgroundModel]) -> None:
        """As `Tracker.take_backgrounds`."""
        self._tracker.take_backgrounds(backgrounds)


class LiveSettings:
    """The parameters of a node that change its tracker's settings.

    A setting whose default depends on another setting, such as `evaluations` on `optimizer`,
    changes with it unless it was given.

    Args:
        node: its parameters are declared already.
        given: the tracker's settings that the user gave, by name.
        config: the settings in effect.
        inform: called with a line about a change.

    Attributes:
        record: the changes, in order: stamp of the first set, ns, and values by name.
    """

    def __init__(
        self,
        node: Any,
        given: Mapping[str, Any],
        config: TrackerConfig,
        inform: Callable[[str], None],
    ) -> None:
        self._given, self._config, self._inform = dict(given), config, inform
        self._used = config
        self._asked: dict[str, Any] = {}
        self._tracker: SettableTracker | None = None
        self.record: list[dict[str, Any]] = []
        node.add_pre_set_parameters_callback(self._complete)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)

    def settable(self, tracker: Tracker | TrackerProcess) -> SettableTracker:
        """A tracker whose settings the parameters change from now on."""
        self._tracker = SettableTracker(tracker, self._changed)
        return self._tracker

    def _complete(self, parameters: list[Parameter]) -> list[Parameter]:
        """Add the settings that depend on the given ones."""
        self._asked = {p.name: p.value for p in parameters if p.name in LIVE}
        try:
            config = self._asked_config()
        except ConfigError:
            return parameters  # `_check` refuses them.
        follows = set(_differences(self._config, config)) & LIVE - {p.name for p in parameters}
        values = config.by_name()
        return parameters + [Parameter(name, value=values[name]) for name in sorted(follows)]

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        if not any(p.name in LIVE for p in parameters):
            return SetParametersResult(successful=True)
        try:
            if self._tracker is None:
                raise ConfigError("the tracker is starting; settings can change once it is ready")
            config = self._asked_config()
            fixed = sorted(set(_differences(self._config, config)) - LIVE)
            if fixed:
                raise ConfigError(
                    f"{', '.join(fixed)} would change, too, and cannot while the tracker runs; "
                    "start it with these parameters"
                )
            self._tracker.check(config)
        except ConfigError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: list[Parameter]) -> None:
        if self._tracker is None or not self._asked:
            return
        self._given |= self._asked
        config = self._asked_config()
        changed = _differences(self._config, config)
        self._config = config
        if changed:
            self._tracker.configure(config)
            listed = ", ".join(f"{name} is {value}" for name, value in changed.items())
            self._inform(f"from the next set on: {listed}")

    def _asked_config(self) -> TrackerConfig:
        unset = [name for name, value in self._asked.items() if value is None]
        if unset:
            raise ConfigError(f"{', '.join(unset)}: no value, expected one")
        return TrackerConfig.from_mapping(self._given | self._asked)

    def _changed(self, stamp_ns: int, config: TrackerConfig) -> None:
        self.record.append({"stamp_ns": stamp_ns, **_differences(self._used, config)})
        self._used = config


def _differences(before: TrackerConfig, after: TrackerConfig) -> dict[str, Any]:
    """Settings that differ, with their new values."""
    old = before.by_name()
    return {name: value for name, value in after.by_name().items() if value != old[name]}
