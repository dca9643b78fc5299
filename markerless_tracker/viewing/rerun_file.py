"""A result for the Rerun viewer: pictures, body, cameras and floor in 3D, angles over time."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from markerless_tracker.body import BodyModel, cone_transforms
from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.drawing.outline import cone_surfaces
from markerless_tracker.drawing.overlay import ELLIPSE_SD, Image, side_colour
from markerless_tracker.errors import ConfigError, DatasetError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.results.stored_result import StoredResult
from markerless_tracker.viewing.overlays import Overlays

APPLICATION = "markerless_tracker"
TIMELINE = "time"
CURVES = {"angles": "joint angles, degrees", "sd_mm": "sd, mm", "overlap": "overlap"}
"""Folders of the curves over time, and their titles."""
BONES = (
    ("Pelvis", "Neck"), ("Neck", "Head"),
    ("Neck", "LShoulder"), ("LShoulder", "LElbow"), ("LElbow", "LWrist"),
    ("Neck", "RShoulder"), ("RShoulder", "RElbow"), ("RElbow", "RWrist"),
    ("Pelvis", "LHip"), ("LHip", "LKnee"), ("LKnee", "LAnkle"),
    ("Pelvis", "RHip"), ("RHip", "RKnee"), ("RKnee", "RAnkle"),
)  # fmt: skip
"""Pairs of markers joined by a line."""

_JPEG_QUALITY = 80
_FLOOR_M = 4.0
_BACKGROUND = (28, 30, 34)
_END_POINTS = 16
# Triangles of a cone with this many points on each end: its side, then a fan over each end.
_TRIANGLES = np.array(
    [
        corner
        for i, j in ((k, (k + 1) % _END_POINTS) for k in range(_END_POINTS))
        for corner in ((i, j, _END_POINTS + i), (j, _END_POINTS + j, _END_POINTS + i))
    ]
    + [(end, end + i, end + i + 1) for end in (0, _END_POINTS) for i in range(1, _END_POINTS - 1)],
    dtype=np.uint32,
)


def require_rerun() -> Any:
    """The Rerun SDK.

    Raises:
        ConfigError: it is not installed.
    """
    try:
        import rerun
    except ImportError as error:
        raise ConfigError(
            "the Rerun viewer needs rerun-sdk: pip install rerun-sdk, or markerless_tracker[view]"
        ) from error
    return rerun


def write_rrd(
    path: Path,
    result: StoredResult,
    *,
    rig: CameraRig | None = None,
    overlays: Overlays | None = None,
    rows: list[int] | None = None,
) -> None:
    """Write a result as a recording of the Rerun viewer.

    Args:
        path: the file, *.rrd.
        result: the result; world frame, Z up.
        rig: its cameras.
        overlays: their pictures, with the body drawn.
        rows: frames whose pictures are written; None = all.

    Raises:
        ConfigError: rerun-sdk is not installed.
        DatasetError, BodyModelError: the file cannot be written, the images cannot be read, or the
            result's body is unknown.
    """
    rr = require_rerun()
    body = result.body()
    stream = rr.RecordingStream(APPLICATION)
    names = rig.names if rig is not None else ()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        stream.save(path, default_blueprint=blueprint(names, CURVES))
    except (OSError, RuntimeError, ValueError) as error:
        raise DatasetError(f"{path}: cannot be written: {error}") from error
    try:
        log_world(rr, stream)
        for camera in rig or ():
            _camera(rr, stream, camera)
        _cones(rr, stream, body)
        for row in range(len(result)):
            stream.set_time(TIMELINE, duration=float(result.times_s[row]))
            _body(rr, stream, result, row)
            _move_cones(rr, stream, body, result.parameters[row])
            _curves(rr, stream, result, row)
        if overlays is not None:
            shown = list(range(len(result))) if rows is None else rows
            for row, pictures in overlays.pictures(shown):
                stream.set_time(TIMELINE, duration=float(result.times_s[row]))
                log_pictures(rr, stream, pictures)
        stream.flush()
    finally:
        stream.disconnect()


def log_world(rr: Any, stream: Any) -> None:
    """Log the axes of the world and its floor."""
    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    stream.log("world/floor", _floor(rr), static=True)


def _floor(rr: Any) -> Any:
    """A grid of 1 m on z = 0."""
    ticks = np.arange(-_FLOOR_M, _FLOOR_M + 0.5)
    lines = [[(x, -_FLOOR_M, 0.0), (x, _FLOOR_M, 0.0)] for x in ticks]
    lines += [[(-_FLOOR_M, y, 0.0), (_FLOOR_M, y, 0.0)] for y in ticks]
    return rr.LineStrips3D(lines, colors=[(110, 110, 110)], radii=0.003)


def _camera(rr: Any, stream: Any, camera: CameraModel) -> None:
    T = camera.T_world_cam
    at = f"world/cameras/{camera.name}"
    stream.log(at, rr.Transform3D(translation=T[:3, 3], mat3x3=T[:3, :3]), static=True)
    stream.log(
        at,
        rr.Pinhole(
            image_from_camera=camera.matrix,
            resolution=camera.size_px,
            camera_xyz=rr.ViewCoordinates.RDF,
            image_plane_distance=0.4,
        ),
        static=True,
    )


def _cones(rr: Any, stream: Any, body: BodyModel) -> None:
    """The surface of each cone in its base frame."""
    for name, points in zip(
        body.cone_names, cone_surfaces(body, end_points=_END_POINTS, sections=0), strict=True
    ):
        mesh = rr.Mesh3D(
            vertex_positions=points,
            triangle_indices=_TRIANGLES,
            vertex_colors=np.tile(np.array(_rgb(name), dtype=np.uint8), (len(points), 1)),
        )
        stream.log(f"world/cones/{name}", mesh, static=True)


def _move_cones(rr: Any, stream: Any, body: BodyModel, pose: FloatArray) -> None:
    """Log the transform of each cone; without a pose its scale is zero."""
    if not np.isfinite(pose).all():
        stream.log("world/cones", rr.Transform3D(scale=0.0))
        return
    stream.log("world/cones", rr.Transform3D(scale=1.0))
    for name, T in zip(body.cone_names, cone_transforms(body, pose), strict=True):
        placed = rr.Transform3D(translation=T[:, 3], mat3x3=T[:, :3])
        stream.log(f"world/cones/{name}", placed)


def _body(rr: Any, stream: Any, result: StoredResult, row: int) -> None:
    log_body(
        rr, stream, result.marker_names, result.positions_m[row], sd_m=result.positions_sd_m[row]
    )


def log_body(
    rr: Any,
    stream: Any,
    names: Sequence[str],
    positions_m: FloatArray,
    *,
    sd_m: FloatArray | None = None,
) -> None:
    """Log joints and bones at the stream's time.

    Args:
        rr: the Rerun SDK.
        stream: its recording.
        names: n markers.
        positions_m: (n, 3) m, world frame; NaN = unknown.
        sd_m: (n, 3) standard deviations, m; NaN = unknown.
    """
    if not np.isfinite(positions_m).any():
        stream.log("world/body", rr.Clear(recursive=True))
        return
    at = dict(zip(names, positions_m, strict=True))
    known = np.asarray(np.isfinite(positions_m).all(axis=1))
    found = [name for name, here in zip(names, known.tolist(), strict=True) if here]
    colours = [_rgb(name) for name in found]
    stream.log(
        "world/body/joints",
        rr.Points3D(
            positions_m[known], colors=colours, radii=0.02, labels=found, show_labels=False
        ),
    )
    bones = [(a, b) for a, b in BONES if a in found and b in found]
    stream.log(
        "world/body/bones",
        rr.LineStrips3D(
            [np.array([at[a], at[b]]) for a, b in bones],
            colors=[_rgb(b) for _, b in bones],
            radii=0.012,
        ),
    )
    if sd_m is None:
        return
    radii = ELLIPSE_SD * sd_m[known]
    if np.isfinite(radii).all():
        stream.log(
            "world/body/sd",
            rr.Ellipsoids3D(centers=positions_m[known], half_sizes=radii, colors=colours),
        )


def _curves(rr: Any, stream: Any, result: StoredResult, row: int) -> None:
    """Log the known values; a curve is cleared in the first row without one, which breaks it."""
    before = max(row - 1, 0)
    for folder, names, values in (
        ("angles", result.angle_names, result.angles_deg[[before, row]]),
        ("overlap", result.camera_names, result.overlap[[before, row]]),
        ("sd_mm", result.marker_names, 1000.0 * _length(result.positions_sd_m[[before, row]])),
    ):
        for name, last, value in zip(names, *values.tolist(), strict=True):
            if np.isfinite(value):
                stream.log(f"{folder}/{name}", rr.Scalars(value))
            elif np.isfinite(last):
                stream.log(f"{folder}/{name}", rr.Clear(recursive=False))


def _length(deviations: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt((deviations**2).sum(axis=-1)))


def log_pictures(rr: Any, stream: Any, pictures: Mapping[str, Image]) -> None:
    """Log images (h, w, 3) BGR by camera, as JPEG, at the stream's time."""
    for name, picture in pictures.items():
        done, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        if done:
            image = rr.EncodedImage(contents=data.tobytes(), media_type="image/jpeg")
            stream.log(f"world/cameras/{name}", image)


def blueprint(cameras: Sequence[str], curves: Mapping[str, str]) -> Any:
    """3D on the left, the cameras' pictures on the right, curves below.

    Args:
        cameras: their names.
        curves: folder of the curves -> title.
    """
    import rerun.blueprint as rrb

    pictures = [rrb.Spatial2DView(origin=f"world/cameras/{name}", name=name) for name in cameras]
    views = [rrb.TimeSeriesView(origin=folder, name=name) for folder, name in curves.items()]
    space = rrb.Spatial3DView(origin="world", name="world", background=_BACKGROUND)
    above = rrb.Horizontal(space, rrb.Grid(*pictures)) if pictures else space
    return rrb.Blueprint(
        rrb.Vertical(above, rrb.Tabs(*views), row_shares=[3, 1]), collapse_panels=True
    )


def _rgb(name: str) -> tuple[int, int, int]:
    blue, green, red = side_colour(name)
    return red, green, blue
