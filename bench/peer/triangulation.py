"""Joints in the world from landmarks in the views: weighted linear triangulation, to a TRC."""

from itertools import combinations

import cv2
import numpy as np

from markerless_tracker.camera import CameraModel, CameraRig, project
from markerless_tracker.datasets import MarkerTrack, Recording
from markerless_tracker.datasets.video.rates import stamp_of
from markerless_tracker.geometry import FloatArray

JOINTS = {
    "LShoulder": 11, "RShoulder": 12, "LElbow": 13, "RElbow": 14, "LWrist": 15, "RWrist": 16,
    "LHip": 23, "RHip": 24, "LKnee": 25, "RKnee": 26, "LAnkle": 27, "RAnkle": 28,
}  # fmt: skip
"""Our marker -> number of MediaPipe's landmark: the 12 limb joints, which both define alike."""
AGREEMENT_PX = 15.0
"""Largest mean distance of pixels from a point's images; Pose2Sim's default."""
LEAST_VIEWS = 3
"""Views that are never left out, if so many see the joint."""


def joint_track(landmarks: FloatArray, recording: Recording) -> MarkerTrack:
    """The limb joints at the frames of a recording.

    Args:
        landmarks: (frames, views, 33, 3) u, v in px of the stored images and visibility; the views
            in the order of the recording's cameras; NaN where no person was detected.
        recording: at its full size.
    """
    chosen = landmarks[:, :, list(JOINTS.values())]
    frames, views, joints = chosen.shape[:3]
    positions = np.full((frames, joints, 3), np.nan)
    rays = np.stack(
        [
            undistorted(chosen[:, view, :, :2].reshape(-1, 2), camera).reshape(frames, joints, 2)
            for view, camera in enumerate(recording.rig)
        ],
        axis=2,
    )
    weights = np.nan_to_num(np.moveaxis(chosen[..., 2], 1, 2), nan=0.0)
    pixels = np.moveaxis(chosen[..., :2], 1, 2)
    for frame in range(frames):
        for joint in range(joints):
            positions[frame, joint] = consistent(
                rays[frame, joint], pixels[frame, joint], weights[frame, joint], recording.rig
            )
    stamps = np.array([stamp_of(frame, recording.fps) for frame in range(frames)])
    return MarkerTrack(tuple(JOINTS), stamps, positions)


def consistent(
    rays: FloatArray, pixels: FloatArray, weights: FloatArray, rig: CameraRig
) -> FloatArray:
    """(3,) the point of the views that agree, in m; NaN with less than two views.

    As in Pose2Sim, views are left out, no more than needed, until the mean distance of the pixels
    from the point's images is at most `AGREEMENT_PX`; at least `LEAST_VIEWS` stay. If it is never
    reached, the `LEAST_VIEWS` that agree best count.

    Args:
        rays: (views, 2) undistorted pixels; NaN where there is none.
        pixels: (views, 2) the pixels.
        weights: (views,) visibility in [0, 1].
        rig: the cameras.
    """
    usable = [v for v in range(len(rig)) if weights[v] > 0.0 and np.isfinite(rays[v]).all()]
    best = np.full(3, np.nan)
    if len(usable) < 2:
        return best
    for size in range(len(usable), min(len(usable), LEAST_VIEWS) - 1, -1):
        least = np.inf
        for views in combinations(usable, size):
            some = CameraRig(tuple(rig.cameras[v] for v in views))
            point = triangulated(rays[list(views)], weights[list(views)], some)
            images = project(point[None], some)[:, 0]
            error = float(np.linalg.norm(images - pixels[list(views)], axis=1).mean())
            if error < least:
                least, best = error, point
        if least <= AGREEMENT_PX:
            break
    return best


def undistorted(pixels: FloatArray, camera: CameraModel) -> FloatArray:
    """(n, 2) pixels as rays (x / z, y / z) of the camera; NaN stays."""
    known = np.isfinite(pixels).all(axis=1)
    rays = np.full(pixels.shape, np.nan)
    if known.any():
        rays[known] = cv2.undistortPoints(pixels[known][:, None], camera.matrix, camera.distortion)[
            :, 0
        ]
    return rays


def triangulated(rays: FloatArray, weights: FloatArray, rig: CameraRig) -> FloatArray:
    """(3,) the point in m whose images are the rays, by the weighted linear method.

    Two equations per view, x p3 - p1 = 0 and y p3 - p2 = 0 with the rows p of its [R t], times its
    weight; the solution is the singular vector of the smallest singular value (Hartley and
    Zisserman, Multiple View Geometry, section 12.2).

    Args:
        rays: (views, 2), of two views or more.
        weights: (views,) above 0.
        rig: the cameras.
    """
    rows = []
    for (x, y), weight, camera in zip(rays, weights, rig, strict=True):
        pose = camera.T_cam_world
        rows += [weight * (x * pose[2] - pose[0]), weight * (y * pose[2] - pose[1])]
    point = np.linalg.svd(np.array(rows))[2][-1]
    return np.asarray(point[:3] / point[3])
