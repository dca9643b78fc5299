"""The rest pose of a skeleton: positions of the joints, and weights of the frames around them."""

from dataclasses import dataclass

import numpy as np

from markerless_tracker.body import MARKER_NAMES, BodyModel, markers, transforms
from markerless_tracker.geometry import FloatArray
from markerless_tracker.synthesis.people.loft import Binding

FRAMES = (
    "pelvis", "loins", "thorax", "head",
    "l_clavicle", "l_shoulder", "l_elbow", "l_wrist", "l_hip", "l_knee", "l_ankle",
    "r_clavicle", "r_shoulder", "r_elbow", "r_wrist", "r_hip", "r_knee", "r_ankle",
)  # fmt: skip
"""Frames that carry the surface."""
_INDEX = {name: i for i, name in enumerate(FRAMES)}


@dataclass(frozen=True, eq=False)
class Rest:
    """A skeleton in its neutral pose: facing +x, left is +y, the hips at the origin.

    Attributes:
        body: the skeleton.
        joints: marker to its place (3,) in m.
        inverse: (f, 4, 4) transforms from the world to each of `FRAMES`.
        loins: (3,) the spine's lower joint.
    """

    body: BodyModel
    joints: dict[str, FloatArray]
    inverse: FloatArray
    loins: FloatArray

    @classmethod
    def of(cls, body: BodyModel) -> "Rest":
        """The rest pose of a skeleton that has all of `FRAMES`."""
        frames = np.tile(np.eye(4), (len(FRAMES), 1, 1))
        frames[:, :3] = transforms(body, body.neutral)[[body.frames[name] for name in FRAMES]]
        joints = dict(zip(MARKER_NAMES, markers(body, body.neutral), strict=True))
        inverse = np.asarray(np.linalg.inv(frames), dtype=float)
        return cls(body, joints, inverse, frames[_INDEX["loins"], :3, 3])

    def moved(self, pose: FloatArray) -> FloatArray:
        """Transforms (f, 3, 4) from the rest pose to a pose (p,)."""
        now = transforms(self.body, pose)[[self.body.frames[name] for name in FRAMES]]
        return np.asarray(now[:, :3, :3] @ self.inverse[:, :3]) + np.pad(
            now[:, :, 3:], ((0, 0), (0, 0), (3, 0))
        )

    def trunk(self) -> Binding:
        """Binding of trunk, neck and head, by height."""
        loins, neck = self.loins[2], self.joints["Neck"][2]
        length = neck - loins
        middle = loins + 0.44 * length

        def bind(points: FloatArray) -> FloatArray:
            z = points[:, 2]
            return _chain(
                points,
                ("pelvis", _ramp(z, loins, 0.09)),
                ("loins", _ramp(z, middle, 0.10)),
                ("thorax", _ramp(z, neck + 0.035, 0.03)),
                ("head", None),
            )

        return bind

    def head(self) -> Binding:
        """Binding of the head and of what it carries."""
        return _rigid("head")

    def hanging(self) -> Binding:
        """Binding of cloth below the waist: the pelvis above, each leg on its side below."""
        hip, knee = self.joints["LHip"][2], self.joints["LKnee"][2]
        half = 0.06

        def bind(points: FloatArray) -> FloatArray:
            z = points[:, 2]
            weights = np.zeros((len(points), len(FRAMES)))
            trunk = self.trunk()(points)
            low = _ramp(-z, -(hip - 0.02), 0.07)
            shin = _ramp(-z, -knee, 0.06)
            left = _ramp(points[:, 1], 0.0, half)
            weights += trunk * (1.0 - low)[:, None]
            for side, share in (("l", left), ("r", 1.0 - left)):
                weights[:, _INDEX[f"{side}_hip"]] += low * share * (1.0 - shin)
                weights[:, _INDEX[f"{side}_knee"]] += low * share * shin
            return weights

        return bind

    def leg(self, side: str) -> Binding:
        """Binding of a leg, by height; side is l or r."""
        hip, knee, ankle = (self.joints[side.upper() + n][2] for n in ("Hip", "Knee", "Ankle"))

        def bind(points: FloatArray) -> FloatArray:
            down = -points[:, 2]
            return _chain(
                points,
                ("pelvis", _ramp(down, -hip - 0.05, 0.05)),
                (f"{side}_hip", _ramp(down, -knee, 0.06)),
                (f"{side}_knee", _ramp(down, -ankle, 0.03)),
                (f"{side}_ankle", None),
            )

        return bind

    def foot(self, side: str) -> Binding:
        """Binding of a foot."""
        return _rigid(f"{side}_ankle")

    def arm(self, side: str) -> Binding:
        """Binding of an arm, by the distance from the shoulder along it."""
        shoulder, elbow, wrist = (
            self.joints[side.upper() + n] for n in ("Shoulder", "Elbow", "Wrist")
        )
        direction = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
        to_elbow, to_wrist = (float((p - shoulder) @ direction) for p in (elbow, wrist))

        def bind(points: FloatArray) -> FloatArray:
            along = (points - shoulder) @ direction
            return _chain(
                points,
                (f"{side}_clavicle", _ramp(along, 0.0, 0.035)),
                (f"{side}_shoulder", _ramp(along, to_elbow, 0.04)),
                (f"{side}_elbow", _ramp(along, to_wrist, 0.02)),
                (f"{side}_wrist", None),
            )

        return bind

    def shoulder(self, side: str) -> Binding:
        """Binding of what lies between neck and shoulder."""
        neck, shoulder = self.joints["Neck"], self.joints[side.upper() + "Shoulder"]
        direction = (shoulder - neck) / np.linalg.norm(shoulder - neck)
        middle = 0.45 * float(np.linalg.norm(shoulder - neck))

        def bind(points: FloatArray) -> FloatArray:
            along = (points - neck) @ direction
            return _chain(
                points, ("thorax", _ramp(along, middle, 0.06)), (f"{side}_clavicle", None)
            )

        return bind


def _ramp(values: FloatArray, middle: float, half: float) -> FloatArray:
    """0 below middle - half, 1 above middle + half, smooth in between."""
    t = np.clip((values - middle + half) / (2.0 * half), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))


def _rigid(frame: str) -> Binding:
    return lambda points: _chain(points, (frame, None))


def _chain(points: FloatArray, *links: tuple[str, FloatArray | None]) -> FloatArray:
    """Weights (n, f): each link passes the share of its ramp on to the next."""
    weights = np.zeros((len(points), len(FRAMES)))
    left = np.ones(len(points))
    for name, ramp in links:
        passed = np.zeros(len(points)) if ramp is None else left * ramp
        weights[:, _INDEX[name]] += left - passed
        left = passed
    return weights
