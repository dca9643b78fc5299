"""Pausing, resuming and stepping a player by service."""

import time
from typing import Any

from std_srvs.srv import Trigger

from markerless_tracker.node.player.spin import Spin

_CHECK_S = 0.05
"""Time between two checks whether a paused player may continue."""


class Control:
    """The services `~/pause`, `~/resume` and `~/step` (std_srvs/Trigger) of a player.

    Args:
        node: creates the services.
        paused: whether the player begins paused.
    """

    def __init__(self, node: Any, *, paused: bool) -> None:
        self._paused = paused
        self._steps = 0
        for name, callback in (
            ("pause", self._on_pause),
            ("resume", self._on_resume),
            ("step", self._on_step),
        ):
            node.create_service(Trigger, f"~/{name}", callback)

    def hold(self, spin: Spin) -> float | None:
        """Wait while the player is paused and no step is requested.

        Args:
            spin: lets the node's callbacks run.

        Returns:
            Duration of the wait in s; None when it is time to end.
        """
        if not self._paused:
            return 0.0
        began_s = time.monotonic()
        while self._paused and not self._steps:
            if not spin(_CHECK_S, lambda: not self._paused or self._steps > 0):
                return None
        if self._paused:
            self._steps -= 1
        return time.monotonic() - began_s

    def _on_pause(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._paused, self._steps = True, 0
        return _answer(response, "paused")

    def _on_resume(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._paused, self._steps = False, 0
        return _answer(response, "playing")

    def _on_step(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if not self._paused:
            response.success, response.message = False, "playing, expected ~/pause first"
            return response
        self._steps += 1
        return _answer(response, "the next set is sent")


def _answer(response: Trigger.Response, message: str) -> Trigger.Response:
    response.success, response.message = True, message
    return response
