"""What the tracker node gives besides its messages: result files, pictures for those who look."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from sensor_msgs.msg import Image

from markerless_tracker.camera import CameraRig
from markerless_tracker.datasets import tidy_fps
from markerless_tracker.drawing import draw_overlay
from markerless_tracker.drawing.steps import draw_steps
from markerless_tracker.imaging import Image as Picture
from markerless_tracker.node.ros.images import fill_image
from markerless_tracker.node.ros.messages import header, optical_frame
from markerless_tracker.node.ros.qos import output_qos
from markerless_tracker.node.tracker.worker import TrackedSet
from markerless_tracker.records import TrackResult
from markerless_tracker.results.result import ResultWriter
from markerless_tracker.tracking import Tracker

_LONE_RESULT_FPS = 60.0


class ResultFile:
    """NAME.trc and NAME.json, written when the node ends; nothing if there is no NAME.

    The rate of a live stream is known at its end only. Safe to use from several threads.

    Args:
        name: path without suffix, None for no files.
    """

    def __init__(self, name: Path | None) -> None:
        self._name = name
        self._lock = Lock()
        self._tracker: Tracker | None = None
        self._results: list[TrackResult] = []

    def open(self, tracker: Tracker) -> None:
        """Find out at once whether the files can be written.

        Raises:
            DatasetError: they cannot.
        """
        if self._name is not None:
            ResultWriter(self._name, tracker.body, tracker.config, fps=_LONE_RESULT_FPS)
            self._tracker = tracker

    def add(self, result: TrackResult) -> None:
        """Take a result; too late after `close`."""
        with self._lock:
            if self._tracker is not None:
                # The evidence would fill the memory.
                self._results.append(replace(result, observations={}))

    def close(self, notes: Mapping[str, Any]) -> None:
        """Write the files, once, with notes such as counts of skipped sets.

        Raises:
            DatasetError: they cannot be written.
        """
        with self._lock:
            tracker, self._tracker = self._tracker, None
            if tracker is None or self._name is None:
                return
            steps_ns = np.diff([result.stamp_ns for result in self._results])
            forward_ns = steps_ns[steps_ns > 0]
            fps = 1e9 / float(np.median(forward_ns)) if forward_ns.size else _LONE_RESULT_FPS
            writer = ResultWriter(
                self._name, tracker.body, tracker.config, fps=tidy_fps(fps), source="live"
            )
            for result in self._results:
                writer.add(result)
            writer.note(notes)
            writer.close()


class Pictures:
    """Pictures of each camera, drawn only while subscribed.

    ``debug/NAME/overlay`` is the body over the image; ``debug/NAME/evidence`` the image, its
    background, foreground (white) and shadow (grey), silhouette, edges and the body, side by side.

    Args:
        node: creates the publishers.
        rig: the cameras of the images that the tracker sees.
    """

    def __init__(self, node: Any, rig: CameraRig) -> None:
        self._rig = rig
        self._publishers = {
            (name, kind): node.create_publisher(Image, f"debug/{name}/{kind}", output_qos())
            for name in rig.names
            for kind in ("overlay", "evidence")
        }

    def publish(self, fitted: TrackedSet, tracker: Tracker) -> None:
        """Draw and publish those that somebody wants to see."""
        for (name, kind), publisher in self._publishers.items():
            if not publisher.get_subscription_count() or name not in fitted.images:
                continue
            draw = self._overlay if kind == "overlay" else self._evidence
            picture = draw(name, fitted, tracker)
            if picture is not None:
                message = Image(header=header(fitted.result.stamp_ns, optical_frame(name)))
                publisher.publish(fill_image(message, picture, f"debug/{name}/{kind}"))

    def _overlay(self, name: str, fitted: TrackedSet, tracker: Tracker) -> Picture:
        image = fitted.images[name]
        if fitted.result.pose is None:
            return image
        return draw_overlay(image, self._rig[name], tracker.body, fitted.result.pose)

    def _evidence(self, name: str, fitted: TrackedSet, tracker: Tracker) -> Picture | None:
        """None where nothing was made of the image."""
        observation = fitted.result.observations.get(name)
        if observation is None:
            return None
        return draw_steps(
            fitted.images[name], observation, self._rig[name], tracker.body, fitted.result.pose,
            tracker.segmenter(name),
        )  # fmt: skip
