"""A result's exports, each read by a program of others, and how far they are from the result.

TRC, MOT and OSIM by OpenSim's wheel, C3D by ezc3d, bags by mcap with mcap-ros2-support, CSV and
NPZ by Python and NumPy, BVH by `bvh_file`. The result itself is read by `json` and as text.
"""

import csv
import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import ezc3d
import numpy as np
from bvh_file import MARKERS, Bvh, joints
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from numpy.typing import NDArray

from markerless_tracker.body import markers
from markerless_tracker.results.stored_result import stored_body

Floats = NDArray[np.float64]
TO_FILE = [1, 2, 0]
"""World axis behind each axis of a file."""
SINGULAR_COSINE = 0.7
"""Cosine of a joint's second angle below which the reported angles may share the other rotations
otherwise than the pose does (docs/joint-angles.md); frames are then left out, and counted."""


def opensim() -> ModuleType:
    """OpenSim's wheel; importing it leaves the environment as it was.

    The wheel sets LD_LIBRARY_PATH, with which later processes would not find ROS 2.
    """
    before = dict(os.environ)
    import opensim as found

    os.environ.clear()
    os.environ.update(before)
    found.Logger.removeFileSink()
    found.Logger.setLevelString("error")
    return found


@dataclass
class Difference:
    """Largest differences of a format from the result.

    Attributes:
        mm: of positions; NaN if the format has none.
        degrees: of angles; NaN if the format has none.
        s: of times.
        notes: what else there is to say.
    """

    mm: float = float("nan")
    degrees: float = float("nan")
    s: float = float("nan")
    notes: dict[str, float] = field(default_factory=dict)


class Result:
    """A result by its files.

    Attributes:
        times: (n,) s.
        held: (n,) whether the person is tracked.
        positions: (n, 15, 3) m in the file's axes, of the TRC's text.
        posed: (n, 15, 3) the markers of the JSON's parameters and final body, in the same axes.
        angles: name -> (n,) degrees, of the JSON.
        near: name -> (n,) whether the joint is near a singularity of its angles.
        names: of the markers.
    """

    def __init__(self, name: Path) -> None:
        self.name = name
        summary = json.loads(name.with_name(name.name + ".json").read_text(encoding="utf-8"))
        frames = summary["frames"]
        self.times = np.array([frame["stamp_ns"] / 1e9 for frame in frames])
        self.held = np.array([frame["state"] == "TRACKING" for frame in frames])
        self.body = stored_body(summary)
        self.posed = np.full((len(frames), 15, 3), np.nan)
        for row in np.flatnonzero(self.held):
            pose = np.array(frames[row]["parameters"])
            self.posed[row] = markers(self.body, pose)[:, TO_FILE]
        first = next(frame for frame in frames if frame["state"] == "TRACKING")
        self.angles = {
            angle: np.array([
                frame["angles"][angle] if held else np.nan
                for frame, held in zip(frames, self.held, strict=True)
            ])
            for angle in first["angles"]
        }  # fmt: skip
        self.near = {angle: np.zeros(len(frames), dtype=np.bool_) for angle in self.angles}
        for _, _, names, _, _ in joints():
            if set(names) <= set(self.angles):
                cosine = np.cos(np.deg2rad(self.angles[names[1]]))
                for angle in names:
                    self.near[angle] = np.abs(cosine) < SINGULAR_COSINE
        lines = name.with_name(name.name + ".trc").read_text(encoding="utf-8").splitlines()
        self.names = lines[3].split("\t")[2::3][:15]
        self.positions = np.full((len(frames), 15, 3), np.nan)
        for line in lines[5:]:
            cells = line.split("\t")
            if len(cells) > 2:
                values = [float(cell or "nan") for cell in cells[2:47]]
                row = int(np.abs(self.times - float(cells[1])).argmin())
                self.positions[row] = np.reshape(values, (15, 3))

    def path(self, ending: str) -> Path:
        """NAME with that ending."""
        return self.name.with_name(self.name.name + ending)


def most_mm(found: Floats, true: Floats) -> float:
    """Largest distance of points (n, k, 3) m; NaN in one but not in the other is infinite."""
    if not np.array_equal(np.isfinite(found), np.isfinite(true)):
        return float("inf")
    return float(np.nanmax(np.linalg.norm(found - true, axis=2))) * 1000.0


def trc(result: Result) -> Difference:
    """NAME.trc, by OpenSim; rows of frames that are not tracked are blank."""
    table = opensim().TimeSeriesTableVec3(str(result.path(".trc")))
    assert list(table.getColumnLabels()) == result.names
    found = np.array([
        [[row.getElt(0, k).get(axis) for axis in range(3)] for k in range(15)]
        for row in (table.getRowAtIndex(i) for i in range(table.getNumRows()))
    ])  # fmt: skip
    most_s = float(np.abs(np.array(table.getIndependentColumn()) - result.times).max())
    blank = int((~np.isfinite(found).all(axis=(1, 2))).sum())
    assert blank == int((~result.held).sum())
    return Difference(most_mm(found, result.positions), s=most_s, notes={"blank rows": blank})


def poses(result: Result) -> Difference:
    """NAME.json: the markers of its parameters and its final body beside those of NAME.trc."""
    off = np.linalg.norm(result.posed - result.positions, axis=2).max(axis=1) * 1000.0
    late = np.flatnonzero(off > 0.1)
    return Difference(
        float(np.nanmax(off)), notes={"last frame above 0.1 mm": int(late[-1]) if late.size else -1}
    )


def c3d(result: Result) -> Difference:
    """NAME.c3d, by ezc3d."""
    content = ezc3d.c3d(str(result.path(".c3d")))
    point = content["parameters"]["POINT"]
    assert point["UNITS"]["value"] == ["mm"] and point["LABELS"]["value"] == result.names
    first = int(content["parameters"]["TRACKER"]["FIRST_NS"]["value"][0]) / 1e9
    rate = float(point["RATE"]["value"][0])
    found = content["data"]["points"][:3].transpose(2, 1, 0) / 1000.0
    rows = np.rint((result.times - first) * rate).astype(int)
    most_s = float(np.abs(first + rows / rate - result.times).max())
    return Difference(most_mm(found[rows], result.positions), s=most_s)


def table(result: Result) -> Difference:
    """NAME.csv, by Python's reader."""
    with result.path(".csv").open(encoding="utf-8", newline="") as lines:
        rows = list(csv.DictReader(lines))
    found = np.array([[float(row[axis] or "nan") for axis in "xyz"] for row in rows])
    times = np.array([float(row["time"]) for row in rows]).reshape(-1, 15)
    assert [row["joint"] for row in rows[:15]] == result.names
    states = [row["state"] == "TRACKING" for row in rows[::15]]
    assert states == result.held.tolist()
    return Difference(
        most_mm(found.reshape(-1, 15, 3), result.positions),
        s=float(np.abs(times - result.times[:, None]).max()),
    )


def npz(result: Result) -> Difference:
    """NAME.npz, by NumPy."""
    with np.load(result.path(".npz")) as found:
        assert found["marker_names"].tolist() == result.names
        by_name = dict(zip(found["angle_names"].tolist(), found["angles_deg"].T, strict=True))
        return Difference(
            most_mm(found["positions_m"], result.positions),
            most_degrees(by_name, result.angles),
            float(np.abs(found["times_s"] - result.times).max()),
        )


def bag(result: Result) -> Difference:
    """NAME_bag, by mcap and mcap-ros2-support, from the definitions in the file alone."""
    (path,) = result.path("_bag").glob("*.mcap")
    found = np.full_like(result.positions, np.nan)
    angles = {name: np.full(len(result.times), np.nan) for name in result.angles}
    stamps = np.rint(result.times * 1e9).astype(np.int64)
    most_s = 0.0
    states = []
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            if channel.topic == "/state":
                states.append(message.status[0].message == "TRACKING")
            if channel.topic not in ("/marker_poses", "/joint_states"):
                continue
            at = message.header.stamp
            row = int(np.abs(stamps - (at.sec * 10**9 + at.nanosec)).argmin())
            most_s = max(most_s, abs(at.sec + at.nanosec / 1e9 - result.times[row]))
            if channel.topic == "/marker_poses":
                points = [pose.position for pose in message.poses]
                found[row] = np.array([[p.x, p.y, p.z] for p in points])[:, TO_FILE]
            else:
                for name, value in zip(message.name, message.position, strict=True):
                    angles[name][row] = np.rad2deg(value)
    assert states == result.held.tolist()
    # The pelvis' own angles are in /root_pose.
    joints = {name: values for name, values in angles.items() if not name.startswith("pelvis_")}
    return Difference(most_mm(found, result.positions), most_degrees(joints, result.angles), most_s)


def mot(result: Result) -> Difference:
    """NAME.mot on NAME.osim, by OpenSim: its angles, and the markers that it moves the model to."""
    wheel = opensim()
    motion = wheel.TimeSeriesTable(str(result.path(".mot")))
    assert wheel.Storage(str(result.path(".mot"))).isInDegrees()
    labels, values = list(motion.getColumnLabels()), motion.getMatrix().to_numpy()
    by_name = {name: values[:, labels.index(name)] for name in result.angles}
    model = wheel.Model(str(result.path(".osim")))
    state = model.initSystem()
    coordinates = model.getCoordinateSet()
    found = np.full_like(result.posed, np.nan)
    for row in np.flatnonzero(result.held):
        for label, value in zip(labels, values[row].tolist(), strict=True):
            metres = label in ("pelvis_tx", "pelvis_ty", "pelvis_tz")
            shown = value if metres else float(np.deg2rad(value))
            coordinates.get(label).setValue(state, shown, False)
        model.realizePosition(state)
        for k, name in enumerate(result.names):
            place = model.getMarkerSet().get(name).getLocationInGround(state)
            found[row, k] = place.to_numpy()
    times = np.array(motion.getIndependentColumn())
    most_s = float(np.abs(times - result.times).max())
    far = {
        name: np.where(result.near[name], result.angles[name], by_name[name]) for name in by_name
    }
    degrees = most_degrees(far, result.angles)
    return Difference(most_mm(found, result.posed), degrees, most_s, left_out(result))


def bvh(result: Result) -> Difference:
    """NAME.bvh, by its description: forward kinematics, and the angles of docs/joint-angles.md."""
    found = Bvh(result.path(".bvh"))
    frames = np.rint((result.times - result.times[0]) / found.period).astype(int)
    most_s = float(np.abs(frames * found.period - (result.times - result.times[0])).max())
    columns = [found.names.index(joint) for joint in MARKERS]
    shown = [result.names.index(marker) for marker in MARKERS.values()]
    own = found.positions[frames][:, columns] / 100.0
    true = result.posed[:, shown]
    off = np.linalg.norm(own - true, axis=2)[result.held]
    angles = {}
    for names, values in found.angles():
        shown_deg = values[frames]
        if set(names) <= set(result.angles):
            # Three angles describe a rotation in two ways; the one nearer to the result's counts.
            other = shown_deg * [1.0, -1.0, 1.0] + 180.0
            wanted = np.stack([result.angles[name] for name in names], axis=1)
            ways = [np.abs(turned(way - wanted)).sum(axis=1) for way in (shown_deg, other)]
            shown_deg = np.where((ways[1] < ways[0])[:, None], other, shown_deg)
        for k, name in enumerate(names):
            if name in result.angles:
                left = result.near[name] | ~result.held
                angles[name] = np.where(left, result.angles[name], shown_deg[:, k])
    degrees = most_degrees(angles, result.angles)
    return Difference(float(off.max()) * 1000.0, degrees, most_s, left_out(result))


def left_out(result: Result) -> dict[str, float]:
    """Frames with an angle near a singularity, which is not compared there."""
    return {"frames near a singularity": int(np.any(list(result.near.values()), axis=0).sum())}


def inverse_kinematics(result: Result, folder: Path) -> Difference:
    """NAME.ik.xml, run by OpenSim's tool: root mean square distance of the markers, mm."""
    wheel = opensim()
    at = Path.cwd()
    os.chdir(folder)
    try:
        assert wheel.InverseKinematicsTool(f"{result.name.name}.ik.xml").run()
        errors = wheel.TimeSeriesTable(f"{result.name.name}_ik_marker_errors.sto")
    finally:
        os.chdir(at)
    assert errors.getNumRows() == int(result.held.sum())
    rms = errors.getDependentColumn("marker_error_RMS").to_numpy() * 1000.0
    worst = errors.getDependentColumn("marker_error_max").to_numpy() * 1000.0
    notes = {"mean rms": float(rms.mean()), "worst marker": float(worst.max())}
    return Difference(float(rms.max()), notes=notes)


def most_degrees(found: Mapping[str, Floats], true: Mapping[str, Floats]) -> float:
    """Largest difference of angles that both have."""
    assert found and set(found) <= set(true)
    most = 0.0
    for name, values in found.items():
        if not np.array_equal(np.isfinite(values), np.isfinite(true[name])):
            return float("inf")
        most = max(most, float(np.nanmax(np.abs(turned(values - true[name])))))
    return most


def turned(degrees: Floats) -> Floats:
    """Differences of angles within half a turn."""
    return np.asarray((degrees + 180.0) % 360.0 - 180.0)


READERS: Sequence[tuple[str, Callable[[Result], Difference]]] = (
    ("trc", trc), ("c3d", c3d), ("csv", table), ("npz", npz), ("bag", bag), ("mot + osim", mot),
    ("bvh", bvh), ("json", poses),
)  # fmt: skip
FORMATS = "c3d,csv,npz,bag,mot,osim,bvh"


def read_back(name: Path) -> dict[str, Any]:
    """Largest differences of every export of a result beside it, by format."""
    result = Result(name)
    found = {kind: read(result) for kind, read in READERS}
    found["ik"] = inverse_kinematics(result, name.parent)
    return found
