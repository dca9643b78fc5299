"""Files for OpenSim, read by OpenSim's own wheel."""

import os
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.body import markers
from markerless_tracker.cli.main import main
from markerless_tracker.results.read import read_result

# The wheel takes over LD_LIBRARY_PATH, with which later processes no longer find ROS 2.
_ENVIRONMENT = dict(os.environ)
opensim = pytest.importorskip("opensim", reason="opensim is not installed")
os.environ.clear()
os.environ.update(_ENVIRONMENT)
opensim.Logger.removeFileSink()


def test_importing_the_wheel_leaves_the_environment_as_it_was() -> None:
    for name in ("LD_LIBRARY_PATH", "PATH", "SIMBODY_HOME"):
        assert os.environ.get(name) == _ENVIRONMENT.get(name)


@pytest.fixture
def exported(make_result, monkeypatch):
    """`exported(lost=)`: NAME of a result with model, motion and setup, in the current folder."""

    def make(**changes) -> Path:
        name = make_result(**changes)
        assert main(["export", str(name), "--to", "osim,mot"]) == 0
        monkeypatch.chdir(name.parent)
        return name

    return make


def test_a_marker_file_with_blank_rows_and_cells_opens(make_result) -> None:
    path = make_result(lost=[0, 3, 11]).with_suffix(".trc")
    lines = path.read_text(encoding="utf-8").splitlines()
    cells = lines[9].split("\t")
    lines[9] = "\t".join([*cells[:2], "", "", "", *cells[5:44], "", "", "", ""])
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    table = opensim.TimeSeriesTableVec3(str(path))
    assert (table.getNumRows(), table.getNumColumns()) == (12, 15)
    assert opensim.MarkerData(str(path)).getNumFrames() == 12
    first = table.getRowAtIndex(0)
    assert np.isnan([first.getElt(0, column).get(0) for column in range(15)]).all()
    assert table.getIndependentColumn()[4] == pytest.approx(1.5 + 4 / 60)


def test_the_motion_moves_the_model_to_the_markers(exported, person, motion) -> None:
    name = exported(lost=[2])
    model = opensim.Model(f"{name.name}.osim")
    state = model.initSystem()
    table = opensim.TimeSeriesTable(f"{name.name}.mot")
    assert opensim.Storage(f"{name.name}.mot").isInDegrees()
    labels, values = list(table.getColumnLabels()), table.getMatrix().to_numpy()
    assert np.isnan(values[2]).all()
    held = np.arange(len(motion)) != 2
    result = read_result(name)
    assert set(result.angle_names) <= set(labels)
    for angle in result.angle_names:
        off = values[held, labels.index(angle)] - result.angle(angle)[held]
        # The JSON file has two decimals of a degree.
        assert np.abs(off).max() < 0.0051, angle
    coordinates = model.getCoordinateSet()
    assert {coordinates.get(k).getName() for k in range(coordinates.getSize())} == set(labels)
    for row in np.flatnonzero(held):
        for label, value in zip(labels, values[row], strict=True):
            if coordinates.getIndex(label) >= 0:
                metres = label in ("pelvis_tx", "pelvis_ty", "pelvis_tz")
                shown = value if metres else np.deg2rad(value)
                coordinates.get(label).setValue(state, shown, False)
        model.realizePosition(state)
        found = [
            model.getMarkerSet().get(index).getLocationInGround(state).to_numpy()
            for index in range(15)
        ]
        truth = markers(person, motion[row])[:, [1, 2, 0]]
        assert np.abs(np.array(found) - truth).max() < 1e-6


@pytest.mark.parametrize("lost", [(), (0, 4, 5)], ids=["whole", "with blank rows"])
def test_inverse_kinematics_runs_on_the_markers_at_once(exported, lost) -> None:
    name = exported(lost=lost)
    assert opensim.InverseKinematicsTool(f"{name.name}.ik.xml").run()
    errors = opensim.TimeSeriesTable(f"{name.name}_ik_marker_errors.sto")
    assert errors.getNumRows() == 12 - len(lost)
    rms_m = errors.getDependentColumn("marker_error_RMS").to_numpy()
    assert rms_m.max() < 0.001
    assert opensim.TimeSeriesTable(f"{name.name}.ik.mot").getNumRows() == 12 - len(lost)


def test_inverse_kinematics_runs_on_other_marker_names(make_result, monkeypatch) -> None:
    name = make_result(lost=[3])
    assert main(["export", str(name), "--to", "osim", "--names", "plugin-gait"]) == 0
    monkeypatch.chdir(name.parent)
    assert opensim.InverseKinematicsTool(f"{name.name}.plugin-gait.ik.xml").run()
    errors = opensim.TimeSeriesTable(f"{name.name}_plugin-gait_ik_marker_errors.sto")
    assert errors.getNumRows() == 11
    assert errors.getDependentColumn("marker_error_RMS").to_numpy().max() < 0.001
