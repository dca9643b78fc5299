"""Compiled loops of the renderer: triangles into a depth buffer, samples into an image."""

from markerless_tracker.compiled import compiled
from markerless_tracker.synthesis.triangles import doubled_area, range_of, weights_at


@compiled()
def rasterize(points, triangles, label, shade, nearness, labels, shades):  # type: ignore[no-untyped-def]
    """Draw triangles into a depth buffer; the nearest one keeps a sample.

    points (k, 3) are (u, v, 1 / depth) in samples of the buffer, NaN where not in front of the
    camera (their triangles are left out); triangles (m, 3); label and shade (k,) by vertex.
    Filled: nearness (h, w) = 1 / depth (0 where nothing is), labels (h, w), shades (h, w).
    """
    height, width = nearness.shape
    for n in range(triangles.shape[0]):
        i, j, k = triangles[n, 0], triangles[n, 1], triangles[n, 2]
        ax, ay, az = points[i, 0], points[i, 1], points[i, 2]
        bx, by, bz = points[j, 0], points[j, 1], points[j, 2]
        cx, cy, cz = points[k, 0], points[k, 1], points[k, 2]
        area = doubled_area(ax, ay, bx, by, cx, cy)
        # NaN fails this test too.
        if not abs(area) > 1e-12:
            continue
        left, right = range_of(ax, bx, cx, width)
        top, bottom = range_of(ay, by, cy, height)
        for v in range(top, bottom):
            for u in range(left, right):
                wb, wc = weights_at(u, v, ax, ay, bx, by, cx, cy, area)
                wa = 1.0 - wb - wc
                if wa < 0.0 or wb < 0.0 or wc < 0.0:
                    continue
                near = wa * az + wb * bz + wc * cz
                if near > nearness[v, u]:
                    nearness[v, u] = near
                    labels[v, u] = label[i]
                    shades[v, u] = wa * shade[i] + wb * shade[j] + wc * shade[k]


@compiled()
def compose(background, nearness, labels, shades, palette, cast, darkness, samples, image, covered):  # type: ignore[no-untyped-def]
    """Average samples x samples samples per pixel of the body over a shadowed background.

    background (h, w, 3); nearness, labels, shades, cast (h * samples, w * samples), cast being
    above 0 in the shadow, which takes `darkness` of the light away; palette (c, 3) BGR.
    Filled: image (h, w, 3) and covered (h, w), the part of each pixel that shows the body.
    """
    height, width = covered.shape
    part = 1.0 / (samples * samples)
    for v in range(height):
        for u in range(width):
            body = 0.0
            blue = green = red = light = 0.0
            for y in range(v * samples, v * samples + samples):
                for x in range(u * samples, u * samples + samples):
                    if nearness[y, x] > 0.0:
                        body += part
                        colour = palette[labels[y, x]]
                        weight = part * shades[y, x]
                        blue += weight * colour[0]
                        green += weight * colour[1]
                        red += weight * colour[2]
                    elif cast[y, x] > 0.0:
                        light += part * (1.0 - darkness)
                    else:
                        light += part
            covered[v, u] = body
            image[v, u, 0] = blue + light * background[v, u, 0]
            image[v, u, 1] = green + light * background[v, u, 1]
            image[v, u, 2] = red + light * background[v, u, 2]
