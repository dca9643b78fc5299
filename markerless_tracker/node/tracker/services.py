"""Services of a running tracker."""

import time
from collections.abc import Callable, Generator, Sequence
from pathlib import Path
from types import coroutine
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from std_srvs.srv import Trigger

from markerless_tracker.body import BodyModel, Subject, write_subject
from markerless_tracker.camera import CameraRig
from markerless_tracker.camera.calibration import write_calibration
from markerless_tracker.errors import ConfigError, TrackerError
from markerless_tracker.node.tracker.learning import Learning
from markerless_tracker.node.tracker.parameters import NodeSettings
from markerless_tracker.node.tracker.worker import TrackWorker

SUBJECT_FILE, CALIBRATION_FILE = "subject.yaml", "calibration.toml"
"""Names of the saved files."""
_POLL_S = 0.002


class Services:
    """``~/reset``, ``~/learn_background``, ``~/save_subject`` and ``~/save_calibration``.

    Args:
        node: offers the services.
        worker: answers the requests that need images.
        settings: of the node.
        cameras: the cameras whose backgrounds are learned.
        rig: the cameras of full-size images; None while they are not known.
        person: the tracked body; None before a person was tracked.
        clock: monotonic time in s.
        inform: called with a line about each saved file and each answer to learn_background.
    """

    def __init__(
        self,
        node: Any,
        worker: TrackWorker,
        settings: NodeSettings,
        *,
        cameras: Sequence[str],
        rig: Callable[[], CameraRig | None],
        person: Callable[[], BodyModel | None],
        clock: Callable[[], float],
        inform: Callable[[str], None],
    ) -> None:
        self._worker, self._settings = worker, settings
        self._cameras, self._rig, self._person = cameras, rig, person
        self._clock, self._inform = clock, inform
        node.create_service(Trigger, "~/reset", self._on_reset)
        # In its own callback group: images must be received while the request is answered.
        node.create_service(
            Trigger,
            "~/learn_background",
            self._on_learn,
            callback_group=ReentrantCallbackGroup(),
        )
        node.create_service(
            Trigger, "~/save_subject", lambda _, answer: self._answer(answer, self.save_subject)
        )
        node.create_service(
            Trigger,
            "~/save_calibration",
            lambda _, answer: self._answer(answer, self.save_calibration),
        )

    def save_subject(self) -> str:
        """Write the tracked person's sizes to `SUBJECT_FILE`; returns a description of them.

        Raises:
            ConfigError: nobody was tracked, or the file exists or cannot be written.
        """
        body = self._person()
        if body is None:
            raise ConfigError("nobody was tracked, so no sizes are known")
        cones = dict(zip(body.cone_names, body.cone_shape, strict=True))
        subject = Subject("tracked", dict(body.lengths_m), cones, body.measured)
        path = self._target(SUBJECT_FILE)
        try:
            write_subject(path, subject)
        except OSError as error:
            raise ConfigError(f"save_dir: {path}: cannot be written: {error.strerror}") from error
        return f"{path}: sizes of the tracked person written (subject_file)"

    def save_calibration(self) -> str:
        """Write the cameras in use to `CALIBRATION_FILE`; returns a description of them.

        Raises:
            TrackerError: the cameras are not known, or the file exists or cannot be written.
        """
        rig = self._rig()
        if rig is None:
            raise ConfigError("the cameras are not known: camera infos or transforms are missing")
        path = self._target(CALIBRATION_FILE)
        write_calibration(path, rig)
        return f"{path}: calibration of {', '.join(rig.names)} written (calibration_file)"

    def _target(self, name: str) -> Path:
        path = (self._settings.save_dir / name).absolute()
        try:
            if path.exists() and not self._settings.overwrite:
                raise ConfigError(f"save_dir: {path} exists, and `overwrite` is false")
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigError(f"save_dir: {path.parent}: {error.strerror}") from error
        return path

    def _answer(self, response: Any, save: Callable[[], str]) -> Any:
        try:
            response.success, response.message = True, save()
            self._inform(response.message)
        except TrackerError as error:
            response.success, response.message = False, str(error)
        return response

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._worker.reset()
        response.success = True
        response.message = "the next set of images is tracked as if it were the first"
        return response

    async def _on_learn(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        settings = self._settings
        if not self._cameras:
            response.success = False
            response.message = "nothing learned: every camera's segmenter has its background"
            return response
        learning = Learning(
            self._cameras,
            settings.learn_background_sets,
            settings.config,
            settings.background_dir,
            clock=self._clock,
        )
        self._worker.learn(learning)
        while not learning.answered:
            # The executor polls a waiting coroutine after every callback, without a pause.
            time.sleep(_POLL_S)
            await _yield_to_executor()
        self._inform(f"learn_background: {learning.message}")
        return learning.answer(response)


@coroutine
def _yield_to_executor() -> Generator[None, None, None]:
    """Return to the executor."""
    yield
