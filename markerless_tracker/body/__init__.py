"""Body models: descriptions, subjects, forward kinematics, constraints, start poses."""

from markerless_tracker.body.collision import RULES, Feasibility
from markerless_tracker.body.kinematics import (
    cone_transforms,
    markers,
    markers_of_many,
    root_transform,
    transforms,
    transforms_of_many,
)
from markerless_tracker.body.load import load_body, load_description
from markerless_tracker.body.model import LIMB_MARKERS, MARKER_NAMES, BodyModel
from markerless_tracker.body.start import pose_from_markers, read_pose, write_pose
from markerless_tracker.body.subject import (
    STATURE_RANGE_M,
    Subject,
    read_subject,
    subject_from_markers,
    subject_from_stature,
    write_subject,
)

__all__ = [
    "LIMB_MARKERS",
    "MARKER_NAMES",
    "RULES",
    "STATURE_RANGE_M",
    "BodyModel",
    "Feasibility",
    "Subject",
    "cone_transforms",
    "load_body",
    "load_description",
    "markers",
    "markers_of_many",
    "pose_from_markers",
    "read_pose",
    "read_subject",
    "root_transform",
    "subject_from_markers",
    "subject_from_stature",
    "transforms",
    "transforms_of_many",
    "write_pose",
    "write_subject",
]
