"""Result files and debug images of the tracker node."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from threading import Lock
from typing import Any

from sensor_msgs.msg import Image

from markerless_tracker.body import BodyModel
from markerless_tracker.camera.ros_fields import optical_frame
from markerless_tracker.drawing import draw_overlay
from markerless_tracker.drawing.evidence import class_picture
from markerless_tracker.drawing.steps import draw_steps
from markerless_tracker.errors import DatasetError
from markerless_tracker.imaging import Image as Picture
from markerless_tracker.imaging import Segmenter
from markerless_tracker.node.ros.images import fill_image
from markerless_tracker.node.ros.messages import header
from markerless_tracker.node.ros.qos import output_qos
from markerless_tracker.node.tracker.handle import TrackedSet
from markerless_tracker.records import Observation, TrackResult
from markerless_tracker.results.result import ResultWriter, check_target
from markerless_tracker.tracking import Tracker


class ResultFile:
    """NAME.trc and NAME.json of a live run, written frame by frame; writes nothing without NAME.

    Safe to use from several threads.

    Args:
        name: path without suffix; None = write no files.
        overwrite: whether an earlier result with this name may be replaced.
        report: called with a line if a frame cannot be written; tracking continues.

    Raises:
        DatasetError: the files cannot be written, or there is an earlier result; names the
            parameter.
    """

    def __init__(
        self, name: Path | None, *, overwrite: bool, report: Callable[[str], None]
    ) -> None:
        self._name, self._overwrite = name, overwrite
        self._report = report
        self._lock = Lock()
        self._writer: ResultWriter | None = None
        self._tracker: Tracker | None = None
        self._written_ns: int | None = None
        self._refused = self._closed = False
        if name is None:
            return
        try:
            check_target(name, overwrite=overwrite)
        except DatasetError as error:
            raise DatasetError(f"result_file: {error}") from error
        except OSError as error:
            raise DatasetError(f"result_file: {name}: {error.strerror}") from error

    def begin(self, tracker: Tracker) -> None:
        """Set the tracker whose results are written; the file records its present settings."""
        self._tracker, self._config = tracker, tracker.config

    def add(self, result: TrackResult, body: BodyModel) -> None:
        """Write a result and the present body; ignored after `close`."""
        with self._lock:
            try:
                writer = self._opened()
                if writer is None:
                    return
                writer.body = body
                writer.add(result)
            except DatasetError as error:
                if not self._refused:
                    self._report(f"result_file: {error}; {self._complete()}; tracking goes on")
                self._refused = True
                return
            if self._refused:
                self._report(f"result_file: {writer.trc_path}: is written again")
            self._refused, self._written_ns = False, result.stamp_ns

    def close(self, notes: Mapping[str, Any]) -> str | None:
        """Complete the files, once, with notes such as counts of skipped sets.

        Returns:
            A description of what was written; None if there are no files.

        Raises:
            DatasetError: they cannot be completed; what was written so far is kept.
        """
        with self._lock:
            try:
                writer = self._opened()
                if writer is None:
                    return None
                writer.note(notes)
                writer.close()
            except DatasetError as error:
                raise DatasetError(f"result_file: {error}; {self._complete()}") from error
            finally:
                self._closed = True
            return f"{writer.trc_path}: {writer.frames} frames written"

    def _opened(self) -> ResultWriter | None:
        if self._closed or self._name is None or self._tracker is None:
            return None
        if self._writer is None:
            # Another tracker may have written this result since this one was made.
            try:
                self._writer = ResultWriter(
                    self._name, self._tracker.body, self._config,
                    fps=None, source="live", overwrite=self._overwrite,
                )  # fmt: skip
            except OSError as error:
                raise DatasetError(f"{self._name}: {error.strerror}") from error
        return self._writer

    def _complete(self) -> str:
        if self._written_ns is None:
            return "no frame is written"
        return f"complete up to stamp {self._written_ns}"


class Pictures:
    """Debug images of each camera, drawn only while subscribed.

    ``debug/NAME/overlay`` is the body over the image; ``debug/NAME/evidence`` the image, its
    background, foreground (white) and shadow (grey), silhouette, edges and the body, side by side.

    Args:
        node: creates the publishers.
        cameras: their names.
    """

    def __init__(self, node: Any, cameras: Sequence[str]) -> None:
        self._publishers = {
            (name, kind): node.create_publisher(Image, f"debug/{name}/{kind}", output_qos())
            for name in cameras
            for kind in ("overlay", "evidence")
        }

    def publish(self, fitted: TrackedSet, segmenter: Callable[[str], Segmenter | None]) -> None:
        """Draw and publish the debug images that have subscribers.

        Args:
            fitted: the set.
            segmenter: gives the segmenter of a camera; None without a background.
        """
        for (name, kind), publisher in self._publishers.items():
            if not publisher.get_subscription_count() or name not in fitted.images:
                continue
            if kind == "overlay":
                picture: Picture | None = self._overlay(name, fitted)
            else:
                picture = self._evidence(name, fitted, segmenter(name))
            if picture is not None:
                message = Image(header=header(fitted.result.stamp_ns, optical_frame(name)))
                publisher.publish(fill_image(message, picture, f"debug/{name}/{kind}"))

    def _overlay(self, name: str, fitted: TrackedSet) -> Picture:
        image = _picture(fitted.images[name])
        if fitted.result.pose is None:
            return image
        return draw_overlay(image, fitted.rig[name], fitted.body, fitted.result.pose)

    def _evidence(
        self, name: str, fitted: TrackedSet, segmenter: Segmenter | None
    ) -> Picture | None:
        """None for an image without evidence."""
        observation = fitted.result.observations.get(name)
        if observation is None:
            return None
        return draw_steps(
            _picture(fitted.images[name]),
            observation,
            fitted.rig[name],
            fitted.body,
            fitted.result.pose,
            segmenter,
        )


def _picture(view: Picture | Observation) -> Picture:
    """A view as an image."""
    return class_picture(view) if isinstance(view, Observation) else view
