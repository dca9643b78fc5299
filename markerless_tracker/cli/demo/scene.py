"""The recording that the demo tracks: a real one, or a synthetic one without a download."""

from dataclasses import dataclass
from pathlib import Path

from markerless_tracker.cli.demo.fetch import fetch_recording
from markerless_tracker.cli.main import main as command
from markerless_tracker.errors import DatasetError

SCALE = 0.5
"""Scale factor of the images: full-size sets (25 MB at 60 fps) overload the middleware."""

MADE_UP_SECONDS = 1.5
MADE_UP_BODY = "balan31"


@dataclass(frozen=True)
class Scene:
    """A recording and how to track it; start pose and stature are estimated.

    Attributes:
        title: description for the report.
        recording: folder of the recording.
        scale: factor for its images.
        body: body model, the default one if empty.
        note: reason for not using the real recording; empty if it is used.
    """

    title: str
    recording: Path
    scale: float
    body: str = ""
    note: str = ""


def real_scene(folder: Path) -> Scene:
    """The real recording.

    Raises:
        DatasetError: it cannot be downloaded.
    """
    return Scene(
        "a real person, four cameras, 60 fps",
        fetch_recording(folder),
        SCALE,
    )


def made_up_scene(folder: Path, note: str) -> Scene:
    """A synthetic recording, written unless the folder has it.

    Raises:
        DatasetError: it cannot be written.
    """
    recording = folder / "made_up"
    if not recording.is_dir():
        status = command(
            ["synthesize", str(recording), "--body", MADE_UP_BODY]
            + ["--seconds", str(MADE_UP_SECONDS)]
        )
        if status:
            raise DatasetError(f"{recording}: synthesize ended with status {status}")
    return Scene(
        "a synthetic person, four cameras, 60 fps",
        recording,
        1.0,
        body=MADE_UP_BODY,
        note=note,
    )
