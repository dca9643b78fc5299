import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, load_body, markers, root_transform
from markerless_tracker.body.angles import AngleReader
from markerless_tracker.body.urdf import urdf
from markerless_tracker.geometry import rotation_from_quaternion, transform
from markerless_tracker.node.ros.urdf_joints import read_joints

SLIDING = """
<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
<joint name="j" type="prismatic"><origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/>
<parent link="a"/><child link="b"/><axis xyz="1 0 0"/></joint>
<joint name="k" type="fixed"><parent link="b"/><child link="c"/></joint></robot>
"""


@pytest.mark.parametrize("name", ["person31", "person35", "balan31"])
def test_links_chained_from_the_root_are_the_markers(name: str) -> None:
    body = load_body(name, 1.8)
    pose = body.neutral + np.random.default_rng(3).uniform(-1.2, 1.2, body.size)
    angles = AngleReader(body).read(pose)
    values = dict(zip(angles.names, angles.values_rad.tolist(), strict=True))
    moving, fixed = read_joints(urdf(body))
    steps = {}
    for joints in (moving, fixed):
        for link, t, q in zip(joints.links, *joints.transforms(values), strict=True):
            steps[link[1]] = (link[0], transform(rotation_from_quaternion(q), t))
    for marker, expected in zip(MARKER_NAMES, markers(body, pose), strict=True):
        at, T = marker, np.eye(4)
        while at != body.root_frame:
            at, step = steps[at]
            T = step @ T
        np.testing.assert_allclose((root_transform(body, pose) @ T)[:3, 3], expected, atol=1e-9)


def test_a_sliding_joint_translates_along_its_axis() -> None:
    moving, fixed = read_joints(SLIDING)
    (at,), (turned,) = moving.transforms({"j": 2.0})
    np.testing.assert_allclose(at, [1.0, 2.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(turned, [np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    assert fixed.links == (("b", "c"),)
