"""The skeleton of generated people: more joints than any tracker's body has."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

from markerless_tracker.body import BodyModel, Subject, load_description
from markerless_tracker.body.build import build_body
from markerless_tracker.body.description import BodyDescription

SPINE = ("spine_x", "spine_y")
"""The upper spine's lateral and forward bend, which no tracker's body has."""


@cache
def _person35() -> BodyDescription:
    return load_description("person35")


def skeleton(lengths_m: Mapping[str, float]) -> BodyModel:
    """person35 with a spine that bends at the loins and in its middle, 37 parameters.

    The trunk of person35 bends at the hips' height in one joint. Here the lower joint lies a fifth
    of the trunk above the hips and the upper one at 0.55 of it; so the distance of Pelvis and Neck
    changes with the bend, as a person's does.

    Raises:
        BodyModelError: a length is missing or impossible.
    """
    shipped = _person35()
    frames: dict[str, Mapping[str, str]] = {}
    for name, entry in shipped.frames.items():
        if name == "thorax":
            frames["loins"] = {
                "parent": "pelvis",
                "chain": "rx(180) tz(-0.2*torso) ry(-thorax_y) rz(-thorax_z)",
            }
            entry = {
                "parent": "loins",
                "chain": "tz(-0.35*torso) ry(-spine_y) rx(-spine_x) tz(-0.45*torso)",
            }
        frames[name] = entry
    parameters = dict(shipped.parameters) | {
        name: {"sigma": 0.02, "limits": [-50, 50]} for name in SPINE
    }
    description = replace(shipped, name="generated", frames=frames, parameters=parameters)
    return build_body(description, Subject("generated", dict(lengths_m)))
