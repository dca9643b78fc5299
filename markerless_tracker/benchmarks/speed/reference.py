"""Reference for speed: the fitness written with NumPy and OpenCV.

Machines and their loads differ, so the compiled fitness is timed alternately with this reference in
one process and reported as a ratio. The reference must stay as it is, or ratios of different
versions cannot be compared.

Kinematics and projection are vectorised in NumPy over all poses of a batch. The outline of a cone
is the convex hull of 16 points (8 on each end's ellipse), filled by `cv2.fillConvexPoly` into one
mask per view. `cv2.bitwise_and` and `cv2.countNonZero` count the pixels. Edge samples on the two
sides of each cone's outline are gathered with NumPy indexing, hidden ones included.
"""

from collections.abc import Mapping, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from markerless_tracker.body import BodyModel
from markerless_tracker.body.model import SWING_X, SWING_Y
from markerless_tracker.camera import CameraModel
from markerless_tracker.camera.model import project_camera
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation

_AROUND = 8
_SUBPIXEL_BITS = 4
_FEWEST_SAMPLES = 4


class ReferenceFitness:
    """f = f_s + f_e, both averaged over the views (see the module).

    Args:
        body: the body.
        cameras: the cameras.
        observations: full-frame observations of every camera by name.
        pose: (p,) a pose near those evaluated later; the length of a cone's side at this pose sets
            its number of edge samples.
        spacing_px: distance of edge samples along a side, px.
    """

    def __init__(
        self,
        body: BodyModel,
        cameras: Sequence[CameraModel],
        observations: Mapping[str, Observation],
        pose: FloatArray,
        *,
        spacing_px: float = 5.0,
    ) -> None:
        self.body = body
        self.cameras = tuple(cameras)
        seen = [observations[camera.name] for camera in cameras]
        self._masks = [np.ascontiguousarray(o.mask).astype(np.uint8) * 255 for o in seen]
        self._edges = [o.edges for o in seen]
        self._observed = [cv2.countNonZero(mask) for mask in self._masks]
        self._drawn = [np.zeros_like(mask) for mask in self._masks]
        self._both = [np.zeros_like(mask) for mask in self._masks]
        self._samples = []
        for camera in cameras:
            sides = _sides(self._outlines(pose[None], camera))[0]
            lengths = np.linalg.norm(sides[:, :, 1] - sides[:, :, 0], axis=2).max(axis=1)
            counts = np.maximum(_FEWEST_SAMPLES, np.nan_to_num(lengths) / spacing_px).astype(int)
            cone = np.repeat(np.arange(counts.size), counts)
            along = np.concatenate([(np.arange(n) + 0.5) / n for n in counts])
            self._samples.append((cone, along[None, None, :, None]))

    @property
    def edge_samples(self) -> float:
        """Mean number of edge samples per view."""
        return float(np.mean([2 * cone.size for cone, _ in self._samples]))

    def __call__(self, poses: FloatArray) -> FloatArray:
        """Costs 2 - f (n,) of poses (n, p)."""
        f = np.zeros(len(poses))
        for view, camera in enumerate(self.cameras):
            outlines = self._outlines(poses, camera)
            f += self._edge_term(view, outlines)
            fixed = np.round(outlines * (1 << _SUBPIXEL_BITS))
            for n in range(len(poses)):
                f[n] += self._silhouette_term(view, fixed[n])
        return 2.0 - f / len(self.cameras)

    def _silhouette_term(self, view: int, outlines: FloatArray) -> float:
        drawn, both = self._drawn[view], self._both[view]
        drawn[:] = 0
        for points in outlines:
            if np.isfinite(points[0, 0]):
                hull = cv2.convexHull(points.astype(np.int32))
                cv2.fillConvexPoly(drawn, hull, 255, shift=_SUBPIXEL_BITS)
        cv2.bitwise_and(drawn, self._masks[view], dst=both)
        y = cv2.countNonZero(both)
        b = cv2.countNonZero(drawn) - y
        r = self._observed[view] - y
        return 0.5 * y / max(b + y, 1) + 0.5 * y / max(r + y, 1)

    def _edge_term(self, view: int, outlines: FloatArray) -> FloatArray:
        cone, along = self._samples[view]
        edges = self._edges[view]
        sides = _sides(outlines)
        start, end = (sides[:, :, :, i].transpose(0, 2, 1, 3)[:, :, cone] for i in (0, 1))
        at = np.nan_to_num(start + along * (end - start), nan=-9.0)
        u = np.clip(at[..., 0] + 0.5, -1, edges.shape[1]).astype(np.int64)
        v = np.clip(at[..., 1] + 0.5, -1, edges.shape[0]).astype(np.int64)
        inside = (u >= 0) & (v >= 0) & (u < edges.shape[1]) & (v < edges.shape[0])
        strength = edges[np.where(inside, v, 0), np.where(inside, u, 0)] / 255.0
        squared = np.where(inside, (1.0 - strength) ** 2, 0.0).sum(axis=(1, 2))
        count = inside.sum(axis=(1, 2))
        return np.where(count > 0, 1.0 - squared / np.maximum(count, 1), 0.0)

    def _outlines(self, poses: FloatArray, camera: CameraModel) -> FloatArray:
        """Points (n, c, 16, 2) in px on the cones' ends, 8 on each; NaN behind the camera."""
        body = self.body
        nodes = _transforms(body, poses)[:, body.cone_node]
        rotation = nodes[..., :3] @ body.cone_fixed[None, :, :, :3]
        origin = nodes[..., :3] @ body.cone_fixed[None, :, :, 3:]
        origin = origin[..., 0] + nodes[..., 3]
        angle = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
        shape = body.cone_shape[:, :, None, :]
        local = np.empty((len(body.cone_names), 2, _AROUND, 3))
        local[..., 0] = shape[..., 2] + shape[..., 0] * np.cos(angle)
        local[..., 1] = shape[..., 3] + shape[..., 1] * np.sin(angle)
        local[:, 0, :, 2] = 0.0
        local[:, 1, :, 2] = body.cone_length[:, None]
        flat = local.reshape(len(body.cone_names), 2 * _AROUND, 3)
        world = np.einsum("ncij,ckj->ncki", rotation, flat, optimize=True) + origin[:, :, None]
        pixels = project_camera(world.reshape(-1, 3), camera).reshape(*world.shape[:3], 2)
        behind = ~np.isfinite(pixels[..., 0]).all(axis=2)
        pixels[behind] = np.nan
        return np.asarray(pixels)


def _transforms(body: BodyModel, poses: FloatArray) -> FloatArray:
    """World transforms (n, m, 3, 4) of all nodes at poses (n, p)."""
    out = np.empty((len(poses), body.node_parent.size, 3, 4))
    for k, (above, kind) in enumerate(
        zip(body.node_parent.tolist(), body.node_kind.tolist(), strict=True)
    ):
        fixed = body.node_fixed[k]
        if above < 0:
            out[:, k] = fixed
        else:
            out[:, k] = out[:, above, :, :3] @ fixed
            out[:, k, :, 3] += out[:, above, :, 3]
        if kind < 0 or kind == SWING_X:
            continue
        if kind == SWING_Y:
            pair = body.node_parameter[[k - 1, k]]
            vector = np.zeros((len(poses), 3))
            vector[:, :2] = body.node_sign[[k - 1, k]] * poses[:, pair]
            out[:, k, :, :3] = out[:, k, :, :3] @ Rotation.from_rotvec(vector).as_matrix()
            continue
        value = (body.node_sign[k] * poses[:, body.node_parameter[k]])[:, None]
        if kind >= 3:
            out[:, k, :, 3] += value * out[:, k, :, kind - 3]
        else:
            i, j = (kind + 1) % 3, (kind + 2) % 3
            a, b = out[:, k, :, i].copy(), out[:, k, :, j].copy()
            out[:, k, :, i] = np.cos(value) * a + np.sin(value) * b
            out[:, k, :, j] = np.cos(value) * b - np.sin(value) * a
    return out


def _sides(outlines: FloatArray) -> NDArray[np.float64]:
    """Sides (n, c, 2, 2, 2) of the cones' quadrilaterals: side, end, (u, v).

    The corners are the points of each end's ellipse with the greatest distance from the line
    through the centres of both ends, one on each side of it.
    """
    ends = outlines.reshape(*outlines.shape[:2], 2, _AROUND, 2)
    axis = ends[:, :, 1].mean(axis=2) - ends[:, :, 0].mean(axis=2)
    across = np.stack([-axis[..., 1], axis[..., 0]], axis=-1)
    distance = np.nan_to_num((ends * across[:, :, None, None]).sum(axis=-1))
    sides = []
    for corner in (distance.argmax(axis=-1), distance.argmin(axis=-1)):
        picked = np.take_along_axis(ends, corner[..., None, None], axis=3)[:, :, :, 0]
        sides.append(picked)
    return np.stack(sides, axis=2)
