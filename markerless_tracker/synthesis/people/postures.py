"""Actions of generated people: the motions, and postures in which a recording may begin."""

from collections.abc import Callable, Mapping

import numpy as np

from markerless_tracker.body.anatomy import posture, published_sign
from markerless_tracker.geometry import FloatArray
from markerless_tracker.synthesis.motion import Angles, Course, Motion
from markerless_tracker.synthesis.people.person import Person

_TURN = 2.0 * np.pi
_ANKLE_RAD = (-0.80, 0.42)
"""Range of the ankle, rad: toes down, toes up."""


_HABITS = {"motion": 0.05, "posture": 0.10}
"""Standard deviation of a person's own angles about those of the action, rad."""


def _both(**angles: float) -> dict[str, float]:
    """Angles of both sides."""
    return {f"{side}_{name}": angle for side in "lr" for name, angle in angles.items()}


def _squat(phase: float) -> Angles:
    slow = np.sin(_TURN * phase)
    return _both(
        hip_y=1.90 + 0.08 * slow, hip_x=0.15, knee=2.00 + 0.08 * slow, shoulder_y=1.1,
        shoulder_x=0.1, elbow=0.5 + 0.1 * slow,
    ) | {"pelvis_ry": 0.40, "thorax_y": 0.30, "head_y": -0.35}  # fmt: skip


def _bent(phase: float) -> Angles:
    slow = np.sin(_TURN * phase)
    return _both(
        hip_y=1.15, knee=0.25 + 0.03 * slow, shoulder_y=1.60 + 0.15 * slow, shoulder_x=0.05,
        elbow=0.25,
    ) | {"pelvis_ry": 0.95 + 0.03 * slow, "thorax_y": 0.65, "head_y": -0.10}  # fmt: skip


def _seated(phase: float) -> Angles:
    slow = np.sin(_TURN * phase)
    return _both(
        hip_y=1.45, hip_x=0.10, knee=1.50, shoulder_y=0.45 + 0.05 * slow, shoulder_x=0.08,
        elbow=0.95 - 0.1 * slow,
    ) | {"pelvis_ry": -0.08, "thorax_y": 0.08 + 0.04 * slow, "head_z": 0.3 * slow}  # fmt: skip


def _raised(phase: float) -> Angles:
    slow = np.sin(_TURN * phase)
    return _both(
        hip_y=0.04, knee=0.06, shoulder_y=2.80 + 0.10 * slow, shoulder_x=0.15,
        elbow=0.20 + 0.10 * slow,
    ) | {"thorax_y": -0.05, "head_y": -0.05}  # fmt: skip


def _wide(phase: float) -> Angles:
    slow = np.sin(_TURN * phase)
    return _both(hip_y=0.04, hip_x=0.12, knee=0.06, shoulder_x=1.55 + 0.10 * slow, elbow=0.12) | {
        "thorax_z": 0.1 * slow
    }


def _crossed(phase: float) -> Angles:
    slow = np.sin(_TURN * phase)
    return _both(hip_y=0.04, knee=0.06, shoulder_y=0.50 + 0.03 * slow, shoulder_x=-0.04) | {
        "l_shoulder_z": 1.36, "l_elbow": 1.62, "r_shoulder_z": -1.30, "r_elbow": 1.50,
        "thorax_y": 0.05, "head_z": 0.15 * slow,
    }  # fmt: skip


_FEET = ("LAnkle", "RAnkle")
POSTURES: Mapping[str, Course] = {
    "squat": (_squat, 0.25, 0.0, 0.0, _FEET),
    "bent": (_bent, 0.25, 0.0, 0.0, _FEET),
    "seated": (_seated, 0.20, 0.0, 0.0, ("Pelvis",)),
    "raised": (_raised, 0.25, 0.0, 0.0, _FEET),
    "wide": (_wide, 0.25, 0.0, 0.0, _FEET),
    "crossed": (_crossed, 0.20, 0.0, 0.0, _FEET),
}
ACTIONS = (*Motion.courses, *POSTURES)
"""Names of motions and postures."""


class Action(Motion):
    """A motion or posture of a generated person, whose soles stay on the floor.

    The spine bends in both of its joints, the ankles keep the soles level as far as they can, and
    the seed varies every joint by some degrees.

    Args:
        person: the person that moves.
        kind: one of `ACTIONS`.
        seed: varies heading, phase, amplitude, tempo and joints.
        place_m: where on the floor, added to the motion's own path.

    Raises:
        ConfigError: the action is unknown.
    """

    courses = {**Motion.courses, **POSTURES}

    def __init__(
        self, person: Person, kind: str, seed: int = 0, place_m: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        self._person = person
        self._place_m = place_m
        rng = np.random.default_rng([seed, 5])
        spread = _HABITS["posture" if kind in POSTURES else "motion"]
        names = [f"{side}_{name}" for side in "lr" for name in ("shoulder_x", "shoulder_y",
                 "shoulder_z", "elbow", "hip_x")]  # fmt: skip
        self._habit = {
            name: spread * float(np.clip(rng.standard_normal(), -2.0, 2.0))
            for name in (*names, "spine_x", "head_y", "head_z")
        }
        super().__init__(person.body, kind, seed)

    def _amplitudes(self, kind: str) -> tuple[float, float]:
        return (0.90, 1.06) if kind in POSTURES else super()._amplitudes(kind)

    def pose(self, time_s: float) -> FloatArray:
        """The pose (p,) at a time in s."""
        pose = super().pose(time_s)
        for name, offset in zip(("pelvis_tx", "pelvis_ty"), self._place_m, strict=True):
            pose[self.body.index(name)] += offset
        return pose

    def _posture(self, phase: float) -> FloatArray:
        body = self.body
        angles = {name: self._amplitude * angle for name, angle in self._angles(phase).items()}
        for name, angle in self._habit.items():
            angles[name] = angles.get(name, 0.0) + published_sign(name) * angle
        pose = posture(body, angles)
        forward = body.index("thorax_y")
        pose[body.index("spine_y")] = 0.45 * pose[forward]
        pose[forward] *= 0.65
        for side in "lr":
            shin = (
                angles.get(f"{side}_hip_y", 0.0)
                - angles.get(f"{side}_knee", 0.0)
                - angles.get("pelvis_ry", 0.0)
            )
            pose[body.index(f"{side}_ankle")] = np.clip(-0.85 * shin, *_ANKLE_RAD)
        return pose

    def _lowest_m(self) -> Callable[[FloatArray], float]:
        return self._person.lowest_m
