"""Results for HumanEva's web evaluation."""

import json
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from markerless_tracker.body import markers
from markerless_tracker.cli.main import main


@pytest.mark.parametrize(
    "stated",
    [
        {"source": "/data/S4_Combo_4"},
        {"source": "/data/S4/Image_Data/Combo_4_(C1)", "recording": "S4_Combo_4"},
    ],
)
def test_points_of_every_frame_in_mm(make_result, person, motion, stated) -> None:
    name = make_result(lost=[2])
    summary = name.with_name(name.name + ".json")
    text = json.loads(summary.read_text(encoding="utf-8"))
    summary.write_text(json.dumps({**text, **stated}), encoding="utf-8")
    assert main(["export", str(name), "--to", "humaneva.xml"]) == 0
    root = ElementTree.parse(name.with_name(name.name + ".humaneva.xml")).getroot()
    assert root.tag == "SEQUENCE" and root.findtext("Camera") == "N/A"
    expected = {"SubjectName": "S4", "ActionType": "Combo", "Trial": "4", "FrameEnd": "1258"}
    assert expected.items() <= root.attrib.items()
    frames = root.findall("Frame")
    # The result begins at 1.5 s of 60 Hz; frames count from 1.
    numbers = [int(frame.findtext("Number")) for frame in frames]
    assert numbers == [91 + i for i in range(len(motion)) if i != 2]
    truth = markers(person, motion[0])
    from markerless_tracker.body import MARKER_NAMES

    points = {
        joint.findtext("Name"): [float(joint.findtext(axis)) for axis in "XYZ"]
        for joint in frames[0].iter("Joint")
    }
    assert len(points) == 20
    for point, marker in {
        "torsoDistal": "Pelvis", "torsoProximal": "Neck", "headDistal": "Head",
        "upperLArmProximal": "LShoulder", "upperLArmDistal": "LElbow",
        "lowerRArmDistal": "RWrist", "upperRLegDistal": "RKnee", "lowerLLegDistal": "LAnkle",
    }.items():  # fmt: skip
        np.testing.assert_allclose(
            points[point], 1000.0 * truth[MARKER_NAMES.index(marker)], atol=0.01
        )
    assert all(joint.findtext("Enabled") == "1" for joint in root.iter("Joint"))
