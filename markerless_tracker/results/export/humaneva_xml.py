"""Result files of HumanEva's web evaluation (XML), as its toolbox writes them."""

import re
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.results.export.new_file import new_file
from markerless_tracker.results.read import ResultReader

FPS = 60.0
"""Rate of the images of HumanEva, whose frames count from 1."""
_MM = 1000.0
_ENDS = {
    "torso": ("Neck", "Pelvis"),
    **{
        f"{part}{side}{limb}": (f"{side}{upper}", f"{side}{lower}")
        for limb, joints in (("Arm", "Shoulder Elbow Wrist"), ("Leg", "Hip Knee Ankle"))
        for side in "LR"
        for part, upper, lower in (
            ("upper", *joints.split()[:2]),
            ("lower", *joints.split()[1:]),
        )
    },
    "head": ("Neck", "Head"),
}
"""Part of the body -> our markers at its proximal and its distal end."""
_SEQUENCE = re.compile(r"(?P<subject>S\d+)_(?P<action>[A-Za-z]+)_(?P<trial>\d+)")
_FRAMES = {("S2", "Combo", "1"): (1, 1202), ("S4", "Combo", "4"): (2, 1258)}
"""First and last frame of the sequences of HumanEva-II."""


def write_humaneva(path: Path, reader: ResultReader, names: tuple[str, ...]) -> None:
    """Write the frames with a pose: the twenty points in mm, world frame with z up.

    The subject, action and trial are read from the name of the result's recording, or from its
    source, such as S2_Combo_1. The first image of the recording counts as the sequence's first.

    Args:
        path: the file.
        reader: the result.
        names: not used: the format has its own.

    Raises:
        DatasetError: it cannot be written.
    """
    stated = (str(reader.summary.get(key, "")) for key in ("recording", "source"))
    match = next(filter(None, map(_SEQUENCE.search, stated)), None)
    subject, action, trial = match.groups() if match else ("N/A", "N/A", "N/A")
    first, last = _FRAMES.get((subject, action, trial), (0, 0))
    about = {
        "DatasetName": "HumanEvaII",
        "DatasetBasePath": "../",
        "SubjectName": subject,
        "ActionType": action,
        "Trial": trial,
        "FrameStart": str(first),
        "FrameEnd": str(last),
        "Partition": "Test",
    }
    columns = {name: MARKER_NAMES.index(name) for name in MARKER_NAMES}
    with new_file(path) as sink:
        attributes = " ".join(f"{key}={quoteattr(value)}" for key, value in about.items())
        sink.write(f'<?xml version="1.0" encoding="utf-8"?>\n<SEQUENCE {attributes}>\n')
        sink.write("<Camera>N/A</Camera>\n")
        for part in reader.chunks():
            for stamp, positions in zip(part.stamps_ns.tolist(), part.positions_m, strict=True):
                if not np.isfinite(positions).all():
                    continue
                number = round(stamp * FPS / 1e9) + 1
                sink.write(f"<Frame><Number>{number}</Number><Pose>\n")
                for segment, ends in _ENDS.items():
                    for end, marker in zip(("Proximal", "Distal"), ends, strict=True):
                        x, y, z = (_MM * positions[columns[marker]]).tolist()
                        sink.write(
                            f"<Joint><Name>{segment}{end}</Name><Enabled>1</Enabled>"
                            f"<X>{x:.6f}</X><Y>{y:.6f}</Y><Z>{z:.6f}</Z></Joint>\n"
                        )
                sink.write("</Pose><Error>N/A</Error></Frame>\n")
        sink.write("</SEQUENCE>\n")
