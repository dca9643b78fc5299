"""Compiled loops of the room renderer: occlusion of lamps, samples, composition."""

import numpy as np

from markerless_tracker.compiled import compiled
from markerless_tracker.synthesis.triangles import doubled_area, range_of, weights_at


@compiled()
def add_occlusion(points, triangles, stamp, stamps, total, weight):  # type: ignore[no-untyped-def]
    """Add a weight to every texel that any triangle covers, once.

    points (k, 2) in texels, NaN where there is none; triangles (m, 3); stamps (h, w) holds other
    values than `stamp` where nothing was drawn yet; total (h, w) grows.
    """
    height, width = total.shape
    for n in range(triangles.shape[0]):
        i, j, k = triangles[n, 0], triangles[n, 1], triangles[n, 2]
        ax, ay = points[i, 0], points[i, 1]
        bx, by = points[j, 0], points[j, 1]
        cx, cy = points[k, 0], points[k, 1]
        area = doubled_area(ax, ay, bx, by, cx, cy)
        if not abs(area) > 1e-12:
            continue
        left, right = range_of(ax, bx, cx, width)
        top, bottom = range_of(ay, by, cy, height)
        for v in range(top, bottom):
            for u in range(left, right):
                if stamps[v, u] == stamp:
                    continue
                wb, wc = weights_at(u, v, ax, ay, bx, by, cx, cy, area)
                if wb >= 0.0 and wc >= 0.0 and wb + wc <= 1.0:
                    stamps[v, u] = stamp
                    total[v, u] += weight


@compiled()
def nearest_triangles(points, triangles, nearness, number):  # type: ignore[no-untyped-def]
    """Draw triangles into a depth buffer.

    points (k, 3) are (u, v, 1 / depth), NaN where not in front; triangles (m, 3). Filled where a
    triangle is nearer: nearness (h, w) = 1 / depth and number (h, w), the triangle's.
    """
    height, width = nearness.shape
    for n in range(triangles.shape[0]):
        i, j, k = triangles[n, 0], triangles[n, 1], triangles[n, 2]
        ax, ay, az = points[i, 0], points[i, 1], points[i, 2]
        bx, by, bz = points[j, 0], points[j, 1], points[j, 2]
        cx, cy, cz = points[k, 0], points[k, 1], points[k, 2]
        area = doubled_area(ax, ay, bx, by, cx, cy)
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
                    number[v, u] = n


@compiled()
def vertex_normals(vertices, triangles, normals):  # type: ignore[no-untyped-def]
    """Fill normals (k, 3), unit, as the mean of the adjoining triangles' by area."""
    normals[:] = 0.0
    for n in range(triangles.shape[0]):
        i, j, k = triangles[n, 0], triangles[n, 1], triangles[n, 2]
        ax, ay, az = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        bx, by, bz = vertices[j, 0] - ax, vertices[j, 1] - ay, vertices[j, 2] - az
        cx, cy, cz = vertices[k, 0] - ax, vertices[k, 1] - ay, vertices[k, 2] - az
        x, y, z = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        for corner in (i, j, k):
            normals[corner, 0] += x
            normals[corner, 1] += y
            normals[corner, 2] += z
    for i in range(normals.shape[0]):
        length = np.sqrt(normals[i, 0] ** 2 + normals[i, 1] ** 2 + normals[i, 2] ** 2) + 1e-30
        for axis in range(3):
            normals[i, axis] /= length


@compiled()
def add_visible(points, depth, nearness, tolerance_m, weight, total):  # type: ignore[no-untyped-def]
    """Add a weight to total (k,) for every point that a lamp's depth map does not hide.

    points (k, 2) in texels of the map, depth (k,) in m from the lamp; nearness (h, w) = 1 / depth.
    """
    height, width = nearness.shape
    for i in range(points.shape[0]):
        u, v = int(np.rint(points[i, 0])), int(np.rint(points[i, 1]))
        if 0 <= u < width and 0 <= v < height:
            near = nearness[v, u]
            if near > 0.0 and depth[i] > 1.0 / near + tolerance_m:
                continue
        total[i] += weight


@compiled()
def shine(paint, ambient, lamps, hidden, light):  # type: ignore[no-untyped-def]
    """Fill light (h, w, 3): paint under the ambient light and what arrives of each lamp.

    paint, ambient (h, w, 3); lamps (l, h, w, 3): what arrives of each lamp where it is not
    hidden; hidden (l, h, w): the part of the lamp that is hidden.
    """
    count, height, width = hidden.shape
    for v in range(height):
        for u in range(width):
            blue, green, red = ambient[v, u, 0], ambient[v, u, 1], ambient[v, u, 2]
            for n in range(count):
                open_part = 1.0 - hidden[n, v, u]
                blue += open_part * lamps[n, v, u, 0]
                green += open_part * lamps[n, v, u, 1]
                red += open_part * lamps[n, v, u, 2]
            light[v, u, 0] = paint[v, u, 0] * blue
            light[v, u, 1] = paint[v, u, 1] * green
            light[v, u, 2] = paint[v, u, 2] * red


@compiled()
def cover(image, left, top, points, triangles, number, colours, person, samples, covered):  # type: ignore[no-untyped-def]
    """Put drawn triangles over an image, averaged over samples x samples samples a pixel.

    image (h, w, 3) changes; left, top: its pixel under number[0, 0]; points (k, 2) in samples of
    number (y, x), which holds triangles, -1 for none; colours (k, 3) by vertex; person (m,) whether
    a triangle is the person's; covered (h, w) is filled with the part that shows the person.
    """
    height, width = number.shape[0] // samples, number.shape[1] // samples
    part = 1.0 / (samples * samples)
    for v in range(height):
        for u in range(width):
            over = body = 0.0
            blue = green = red = 0.0
            for y in range(v * samples, v * samples + samples):
                for x in range(u * samples, u * samples + samples):
                    n = number[y, x]
                    if n < 0:
                        continue
                    i, j, k = triangles[n, 0], triangles[n, 1], triangles[n, 2]
                    ax, ay = points[i, 0], points[i, 1]
                    bx, by = points[j, 0] - ax, points[j, 1] - ay
                    cx, cy = points[k, 0] - ax, points[k, 1] - ay
                    area = bx * cy - by * cx
                    wb = ((x - ax) * cy - (y - ay) * cx) / area
                    wc = (bx * (y - ay) - by * (x - ax)) / area
                    wa = 1.0 - wb - wc
                    over += part
                    if person[n]:
                        body += part
                    blue += part * (wa * colours[i, 0] + wb * colours[j, 0] + wc * colours[k, 0])
                    green += part * (wa * colours[i, 1] + wb * colours[j, 1] + wc * colours[k, 1])
                    red += part * (wa * colours[i, 2] + wb * colours[j, 2] + wc * colours[k, 2])
            if over > 0.0:
                row, column = top + v, left + u
                image[row, column, 0] = (1.0 - over) * image[row, column, 0] + blue
                image[row, column, 1] = (1.0 - over) * image[row, column, 1] + green
                image[row, column, 2] = (1.0 - over) * image[row, column, 2] + red
                covered[row, column] = body


@compiled()
def look(flat, rotation, centre, planes, sheet, texels, points, seen):  # type: ignore[no-untyped-def]
    """What rays from a camera meet of the room.

    flat (n, 2): rays are (x, y, 1) in the camera's frame; rotation (3, 3) and centre (3,) take them
    to the world; planes (q, 4): axis, place, sign of the direction inward, first row on the sheet;
    sheet: half width in m, m per texel, texels of a side of the floor, rows of a wall. Filled:
    texels (n, 2) as (column, row), reflected into the plane's part of the sheet, points (n, 3) and
    seen (n,), the plane, -1 for none. Planes that the camera stands behind are left out.
    """
    half, texel, size, rise = sheet[0], sheet[1], sheet[2], sheet[3]
    for n in range(flat.shape[0]):
        nearest = np.inf
        seen[n] = -1
        a, b = flat[n, 0], flat[n, 1]
        ray = (
            rotation[0, 0] * a + rotation[0, 1] * b + rotation[0, 2],
            rotation[1, 0] * a + rotation[1, 1] * b + rotation[1, 2],
            rotation[2, 0] * a + rotation[2, 1] * b + rotation[2, 2],
        )
        for q in range(planes.shape[0]):
            axis = int(planes[q, 0])
            if (centre[axis] - planes[q, 1]) * planes[q, 2] <= 0.0 or ray[axis] == 0.0:
                continue
            distance = (planes[q, 1] - centre[axis]) / ray[axis]
            if 0.0 < distance < nearest:
                nearest = distance
                seen[n] = q
        texels[n, 0] = texels[n, 1] = -9.0
        if seen[n] < 0:
            continue
        for axis in range(3):
            points[n, axis] = centre[axis] + nearest * ray[axis]
        axis = int(planes[seen[n], 0])
        if axis == 2:
            across, along, most = points[n, 0] + half, points[n, 1] + half, size - 1.0
        else:
            across, along, most = points[n, 1 - axis] + half, points[n, 2], rise - 1.0
        across, along = across / texel - 0.5, along / texel - 0.5
        texels[n, 0] = (size - 1.0) - abs(size - 1.0 - across % (2.0 * (size - 1.0)))
        texels[n, 1] = planes[seen[n], 3] + most - abs(most - along % (2.0 * most))
