"""The joint angles that are reported: names, axes, order and signs (docs/joint-angles.md).

Coordinates, order and signs as in the model of Rajagopal et al. (2016) for OpenSim, whose segments
have the axes x forward, y up, z right; zero at the anatomical posture. Its model has no clavicles
and no neck: those are named as in other models for OpenSim.
"""

from dataclasses import dataclass

GROUND = "ground"
"""The reference of the pelvis: x along the world's y, y up, z along the world's x, as in a TRC."""

_ZXY, _YXZ = (2, 0, 1), (1, 0, 2)


@dataclass(frozen=True)
class Joint:
    """A joint's angles: rotations of its segment relative to another, each about a moved axis.

    Attributes:
        segment: the segment that moves, a name of `SEGMENTS`.
        reference: the segment relative to which it moves, or `GROUND`.
        names: of the three angles in order; empty for one that has no name.
        order: (3,) axes (0, 1, 2 = x, y, z) of the rotations, each about the axis as moved by those
            before it.
        signs: (3,) sign of each angle about its axis.
    """

    segment: str
    reference: str
    names: tuple[str, str, str]
    order: tuple[int, int, int] = _ZXY
    signs: tuple[int, int, int] = (1, 1, 1)


def _sided(side: str) -> tuple[Joint, ...]:
    # A mirror image reverses rotations about the forward and up axes, not about the lateral one.
    s = 1 if side == "r" else -1
    mirrored = (1, s, s)
    return (
        Joint(
            f"{side}_thigh",
            "pelvis",
            (f"hip_flexion_{side}", f"hip_adduction_{side}", f"hip_rotation_{side}"),
            signs=mirrored,
        ),
        Joint(f"{side}_shank", f"{side}_thigh", (f"knee_angle_{side}", "", ""), signs=(-1, s, s)),
        Joint(f"{side}_foot", f"{side}_shank", (f"ankle_angle_{side}", "", ""), signs=mirrored),
        Joint(
            f"{side}_clavicle",
            "thorax",
            (f"clav_prot_{side}", f"clav_elev_{side}", ""),
            _YXZ,
            (s, -s, 1),
        ),
        Joint(
            f"{side}_upper_arm",
            "thorax",
            (f"arm_flex_{side}", f"arm_add_{side}", f"arm_rot_{side}"),
            signs=mirrored,
        ),
        Joint(
            f"{side}_forearm",
            f"{side}_upper_arm",
            (f"elbow_flex_{side}", "", f"pro_sup_{side}"),
            signs=mirrored,
        ),
        Joint(
            f"{side}_hand",
            f"{side}_forearm",
            (f"wrist_flex_{side}", f"wrist_dev_{side}", ""),
            signs=mirrored,
        ),
    )


ROOT_ANGLES = ("pelvis_tilt", "pelvis_list", "pelvis_rotation")
"""Angles of the pelvis relative to the ground: no joint's."""

JOINTS = (
    Joint("pelvis", GROUND, ROOT_ANGLES),
    Joint("thorax", "pelvis", ("lumbar_extension", "lumbar_bending", "lumbar_rotation")),
    Joint("head", "thorax", ("neck_extension", "neck_bending", "neck_rotation")),
    *_sided("r"),
    *_sided("l"),
)
"""All joints that can be reported, in the order of the angles."""


@dataclass(frozen=True)
class Segment:
    """A segment of a body.

    Attributes:
        frames: names that its frame may have in a body's description.
        axis: markers at its upper and lower end, which give its y axis; None: the trunk's.
    """

    frames: tuple[str, ...]
    axis: tuple[str, str] | None


def _limb_segments(side: str) -> dict[str, Segment]:
    s = side.upper()
    shank, forearm = (f"{s}Knee", f"{s}Ankle"), (f"{s}Elbow", f"{s}Wrist")
    return {
        f"{side}_thigh": Segment((f"{side}_hip",), (f"{s}Hip", f"{s}Knee")),
        f"{side}_shank": Segment((f"{side}_knee",), shank),
        f"{side}_foot": Segment((f"{side}_ankle", f"{side}_foot"), shank),
        f"{side}_clavicle": Segment((f"{side}_clavicle",), None),
        f"{side}_upper_arm": Segment((f"{side}_shoulder",), (f"{s}Shoulder", f"{s}Elbow")),
        f"{side}_forearm": Segment((f"{side}_elbow",), forearm),
        f"{side}_hand": Segment((f"{side}_wrist",), forearm),
    }


SEGMENTS = {
    "pelvis": Segment(("pelvis",), None),
    "thorax": Segment(("thorax",), ("Neck", "Pelvis")),
    "head": Segment(("head",), ("Head", "Neck")),
    **_limb_segments("r"),
    **_limb_segments("l"),
}
