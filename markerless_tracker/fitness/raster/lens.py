"""The lens model on the plane at focal length 1: OpenCV's k1 k2 p1 p2 k3."""

from markerless_tracker.compiled import kernel


@kernel
def lens(a, b, distortion):  # type: ignore[no-untyped-def]
    """Where a lens (5,) k1 k2 p1 p2 k3 moves a point of the plane at focal length 1."""
    k1, k2, k3 = distortion[0], distortion[1], distortion[4]
    p1, p2 = distortion[2], distortion[3]
    r2 = a * a + b * b
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    ab = a * b
    return (
        a * radial + 2.0 * p1 * ab + p2 * (r2 + 2.0 * a * a),
        b * radial + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * ab,
    )


@kernel
def distorts(distortion):  # type: ignore[no-untyped-def]
    """Whether any coefficient (5,) of a lens is not zero."""
    for i in range(5):
        if distortion[i] != 0.0:
            return True
    return False
