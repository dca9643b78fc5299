"""The lens model on the plane at focal length 1: OpenCV's k1 k2 p1 p2 k3."""

import numpy as np

from markerless_tracker.compiled import inlined, kernel

_NEAREST_M = 1e-6
_OUTSIDE = 1e3
"""Factor of the distance from the optical axis that puts a point outside of any image."""
_INVERSE_STEPS = 5
"""Of `without_lens`: as many as OpenCV's."""


@kernel
def _falls(r2, k1, k2, k3):  # type: ignore[no-untyped-def]
    """Whether the distorted distance from the axis falls at a squared distance, or before it."""
    if 1.0 + r2 * (3.0 * k1 + r2 * (5.0 * k2 + r2 * 7.0 * k3)) <= 0.0:
        return True
    # The slope may be positive again here; then it has its least value before.
    if k3 != 0.0:
        inside = 100.0 * k2 * k2 - 252.0 * k1 * k3
        least = (np.sqrt(inside) - 10.0 * k2) / (42.0 * k3) if inside >= 0.0 else -1.0
    else:
        least = -3.0 * k1 / (10.0 * k2) if k2 > 0.0 else -1.0
    if least <= 0.0 or least >= r2:
        return False
    return 1.0 + least * (3.0 * k1 + least * (5.0 * k2 + least * 7.0 * k3)) <= 0.0


@inlined
def _may_fall(r2, k1, k2, k3):  # type: ignore[no-untyped-def]
    """False where `_falls` is: the absolute terms' sum tells it cheaply of most points."""
    return r2 * (3.0 * abs(k1) + r2 * (5.0 * abs(k2) + r2 * 7.0 * abs(k3))) >= 1.0


@inlined
def _displaced(a, b, r2, radial, p1, p2):  # type: ignore[no-untyped-def]
    """A point at a squared distance r2 from the axis, with its radial factor."""
    ab = a * b
    return (
        a * radial + 2.0 * p1 * ab + p2 * (r2 + 2.0 * a * a),
        b * radial + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * ab,
    )


@kernel
def lens(a, b, distortion):  # type: ignore[no-untyped-def]
    """Distorted position of a point of the plane at focal length 1, lens (5,) k1 k2 p1 p2 k3.

    Beyond some distance from the optical axis the polynomial may fall: it would put points far
    beside the camera into the image, even where it rises again. They are put outside of any image
    instead.
    """
    k1, k2, k3 = distortion[0], distortion[1], distortion[4]
    r2 = a * a + b * b
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    if _may_fall(r2, k1, k2, k3) and _falls(r2, k1, k2, k3):
        radial = _OUTSIDE
    return _displaced(a, b, r2, radial, distortion[2], distortion[3])


@kernel
def distort(count, lanes, a, b, distortion):  # type: ignore[no-untyped-def]
    """As `lens`, for the first points of a and b, in place.

    Args:
        count: number of points.
        lanes: number of values that may be changed, `count` at least; the compiler's loop has no
            remainder if it is a multiple of its vectors.
    """
    k1, k2, k3 = distortion[0], distortion[1], distortion[4]
    p1, p2 = distortion[2], distortion[3]
    doubtful = 0
    for i in range(count):
        doubtful += _may_fall(a[i] * a[i] + b[i] * b[i], k1, k2, k3)
    if doubtful > 0:
        for i in range(count):
            a[i], b[i] = lens(a[i], b[i], distortion)
        return
    # Without a branch the loop is vectorised.
    for i in range(lanes):
        x, y = a[i], b[i]
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        a[i], b[i] = _displaced(x, y, r2, radial, p1, p2)


@kernel
def without_lens(a, b, distortion):  # type: ignore[no-untyped-def]
    """The inverse of `lens`, by OpenCV's fixed-point iterations, for compiled loops.

    They converge for usual lenses.
    """
    k1, k2, k3 = distortion[0], distortion[1], distortion[4]
    p1, p2 = distortion[2], distortion[3]
    x, y = a, b
    for _ in range(_INVERSE_STEPS):
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        xy = x * y
        x, y = (
            (a - 2.0 * p1 * xy - p2 * (r2 + 2.0 * x * x)) / radial,
            (b - p1 * (r2 + 2.0 * y * y) - 2.0 * p2 * xy) / radial,
        )
    return x, y


@kernel
def projected(x, y, z, to_camera, matrix, distortion):  # type: ignore[no-untyped-def]
    """Pixel coordinates (u, v) of a point of the world, m; NaN behind the camera.

    Args:
        x, y, z: the point.
        to_camera: (4, 4) world to camera.
        matrix: (3, 3) intrinsics, px.
        distortion: (5,) of `lens`.
    """
    t = to_camera
    depth = t[2, 0] * x + t[2, 1] * y + t[2, 2] * z + t[2, 3]
    # NaN fails the comparison and is left out, too.
    if not depth > _NEAREST_M:
        return np.nan, np.nan
    a = (t[0, 0] * x + t[0, 1] * y + t[0, 2] * z + t[0, 3]) / depth
    b = (t[1, 0] * x + t[1, 1] * y + t[1, 2] * z + t[1, 3]) / depth
    a, b = lens(a, b, distortion)
    u = matrix[0, 0] * a + matrix[0, 1] * b + matrix[0, 2]
    return u, matrix[1, 1] * b + matrix[1, 2]


@kernel
def pixel(x, y, z, to_camera, matrix, distortion):  # type: ignore[no-untyped-def]
    """The whole pixel nearest to what `projected` gives."""
    u, v = projected(x, y, z, to_camera, matrix, distortion)
    return np.rint(u), np.rint(v)


@kernel
def project_points(points, to_camera, matrix, distortion, out):  # type: ignore[no-untyped-def]
    """Fill out (n, 2) with what `projected` gives for points (n, 3)."""
    for i in range(points.shape[0]):
        out[i, 0], out[i, 1] = projected(
            points[i, 0], points[i, 1], points[i, 2], to_camera, matrix, distortion
        )


@kernel
def distorts(distortion):  # type: ignore[no-untyped-def]
    """Whether any coefficient of a lens (5,) is not zero."""
    for i in range(5):
        if distortion[i] != 0.0:
            return True
    return False
