"""Subscription to the `state` of a running tracker from another process."""

import os
from types import TracebackType
from typing import Any

from markerless_tracker.node.ros.process import require_ros


class StateWatch:
    """Receives the `state` of the tracker in one ROS domain; a context manager.

    Args:
        domain_id: the ROS domain, 0..101.

    Raises:
        RosMissingError: ROS 2 is not installed.
    """

    def __init__(self, domain_id: int) -> None:
        require_ros()
        self._domain_id = domain_id
        self._values: dict[str, str] = {}

    def __enter__(self) -> "StateWatch":
        import rclpy
        from diagnostic_msgs.msg import DiagnosticArray
        from rclpy.executors import SingleThreadedExecutor

        from markerless_tracker.node.ros.qos import latched_qos

        self._context = rclpy.Context()
        rclpy.init(args=[], context=self._context, domain_id=self._domain_id)
        self._node = rclpy.create_node(
            f"state_watch_{os.getpid()}", context=self._context, start_parameter_services=False
        )
        self._node.create_subscription(DiagnosticArray, "state", self._hear, latched_qos())
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._executor.shutdown(timeout_sec=0)
        self._node.destroy_node()
        self._context.try_shutdown()

    def listen(self, seconds: float) -> dict[str, str]:
        """Wait up to that many seconds for a message; the last values, {} before the first."""
        self._executor.spin_once(timeout_sec=seconds)
        return self._values

    def forget(self) -> None:
        """Discard the values of a tracker that has ended."""
        self._values = {}

    def _hear(self, message: Any) -> None:
        if message.status:
            self._values = {entry.key: entry.value for entry in message.status[0].values}
