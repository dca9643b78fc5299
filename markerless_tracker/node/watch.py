"""Receives the `state` of a running tracker in another process."""

from typing import Any

from markerless_tracker.node.ros.process import Listener, require_ros


class StateWatch(Listener):
    """Receives the `state` of the tracker in one ROS domain; a context manager.

    Args:
        domain_id: the ROS domain, 0..101.

    Raises:
        RosMissingError: ROS 2 is not installed.
    """

    def __init__(self, domain_id: int) -> None:
        require_ros()
        super().__init__("state_watch", domain_id)
        self._values: dict[str, str] = {}

    def _subscribe_all(self) -> None:
        from diagnostic_msgs.msg import DiagnosticArray

        from markerless_tracker.node.ros.qos import latched_qos

        self._node.create_subscription(DiagnosticArray, "state", self._on_state, latched_qos())

    def listen(self, seconds: float) -> dict[str, str]:
        """Wait at most `seconds` for a message; returns the last values, {} before the first."""
        self._executor.spin_once(timeout_sec=seconds)
        return self._values

    def _on_state(self, message: Any) -> None:
        if message.status:
            self._values = {entry.key: entry.value for entry in message.status[0].values}
