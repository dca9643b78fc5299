"""Marker names of common sets, by the name of our marker."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np
import yaml

from markerless_tracker.datasets.markers.track import MarkerTrack
from markerless_tracker.errors import DatasetError

Sources = Sequence[Sequence[str]]
"""Alternatives, the preferred first; each is the mean of some markers."""

_SIDED = ("Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle")


def _sided(pattern: Mapping[str, Sequence[str]]) -> dict[str, list[list[str]]]:
    """Both sides of alternatives for the joints of a side; `+` joins the markers of a mean."""
    return {
        side + joint: [
            [part.format(s=side, side={"L": "left", "R": "right"}[side]) for part in one.split("+")]
            for one in alternatives
        ]
        for joint, alternatives in pattern.items()
        for side in "LR"
    }


MARKER_SETS: Mapping[str, Mapping[str, Sources]] = MappingProxyType(
    {
        # Pose2Sim's skeleton HALPE_26: Head is the top of the head.
        "pose2sim": {
            "Pelvis": [["Hip"]],
            "Neck": [["Neck"]],
            "Head": [["Head"]],
            **_sided({joint: [f"{{s}}{joint}"] for joint in _SIDED}),
        },
        # Joint centres as Plug-in Gait's users and its segment outputs name them, then the means
        # of markers on both sides of a joint. It has no top of the head.
        "plugin-gait": {
            "Pelvis": [["PELO"]],
            "Neck": [["C7", "CLAV"]],
            **_sided(
                {
                    "Shoulder": ["{s}SJC", "{s}HUP"],
                    "Elbow": ["{s}EJC", "{s}HUO"],
                    "Wrist": ["{s}WJC", "{s}RAO", "{s}WRA+{s}WRB"],
                    "Hip": ["{s}HJC", "{s}FEP"],
                    "Knee": ["{s}KJC", "{s}FEO", "{s}KNE+{s}KNM"],
                    "Ankle": ["{s}AJC", "{s}TIO", "{s}ANK+{s}MED"],
                }
            ),
        },
        "humaneva": {
            "Pelvis": [["torsoDistal"]],
            "Neck": [["torsoProximal"], ["headProximal"]],
            "Head": [["headDistal"]],
            **_sided(
                {
                    "Shoulder": ["upper{s}ArmProximal"],
                    "Elbow": ["lower{s}ArmProximal", "upper{s}ArmDistal"],
                    "Wrist": ["lower{s}ArmDistal"],
                    "Hip": ["upper{s}LegProximal"],
                    "Knee": ["lower{s}LegProximal", "upper{s}LegDistal"],
                    "Ankle": ["lower{s}LegDistal"],
                }
            ),
        },
        "coco": _sided({joint: [f"{{side}}_{joint.lower()}"] for joint in _SIDED}),
    }
)
"""Sets by name: our marker -> where the set has it; a marker that a set lacks is absent."""


def names_in(set_name: str, names: Sequence[str]) -> tuple[str, ...]:
    """The names that markers of ours have in a set; one that it lacks keeps its own.

    Raises:
        DatasetError: there is no such set.
    """
    known = _set(set_name)
    return tuple(
        known[name][0][0] if name in known and len(known[name][0]) == 1 else name for name in names
    )


def read_marker_map(name_or_file: str) -> Mapping[str, Sources]:
    """A set by its name, or a YAML file: our marker -> marker, or list of markers (their mean).

    Raises:
        DatasetError: there is no such set, or the file is no such mapping; names the file.
    """
    if name_or_file in MARKER_SETS:
        return MARKER_SETS[name_or_file]
    path = Path(name_or_file)
    if path.suffix not in (".yaml", ".yml"):
        return _set(name_or_file)
    try:
        loaded = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError, RecursionError) as error:
        first = str(error).splitlines()[0]
        raise DatasetError(f"{path}: cannot be read: {first}") from error
    if not isinstance(loaded, dict):
        raise DatasetError(f"{path}: expected a mapping of markers, got {type(loaded).__name__}")
    found: dict[str, Sources] = {}
    for ours, theirs in loaded.items():
        several = [theirs] if isinstance(theirs, str) else theirs
        if not (
            isinstance(ours, str)
            and isinstance(several, list)
            and several
            and all(isinstance(name, str) for name in several)
        ):
            raise DatasetError(
                f"{path}: {ours}: {theirs!r}, expected a marker's name or a list of names"
            )
        found[ours] = [several]
    return found


def renamed(track: MarkerTrack, sources: Mapping[str, Sources]) -> MarkerTrack:
    """The track with our markers, as far as it has theirs, and its others under their own names.

    Of the alternatives for a marker the first counts of which the track has every marker.

    Raises:
        DatasetError: the track has none of the markers.
    """
    names: list[str] = []
    columns = []
    used: set[str] = set()
    for ours, alternatives in sources.items():
        for theirs in alternatives:
            if set(theirs) <= set(track.names):
                names.append(ours)
                columns.append(
                    track.positions_m[:, [track.names.index(name) for name in theirs]].mean(axis=1)
                )
                used.update(theirs)
                break
    if not names:
        wanted = ", ".join("+".join(options[0]) for options in sources.values())
        raise DatasetError(
            f"no marker of the map: expected some of {wanted}; got {', '.join(track.names)}"
        )
    for column, name in enumerate(track.names):
        if name not in used and name not in names:
            names.append(name)
            columns.append(track.positions_m[:, column])
    return MarkerTrack(tuple(names), track.stamps_ns, np.stack(columns, axis=1))


def _set(name: str) -> Mapping[str, Sources]:
    if name not in MARKER_SETS:
        raise DatasetError(
            f"marker set {name!r} is unknown, expected {', '.join(MARKER_SETS)} or a .yaml file"
        )
    return MARKER_SETS[name]
