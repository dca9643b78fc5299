"""Masks packed into rows of words (`records.pack_mask`): cutting, growing and flooding them.

A mask is (h, k) words; column u is bit u % 64 of word u // 64. Bits beyond its width are 0.
"""

import numpy as np

from markerless_tracker.compiled import kernel
from markerless_tracker.fitness.raster.bits import ALL

_ONE, _LAST = np.uint64(1), np.uint64(63)


@kernel
def has(words, u, v):  # type: ignore[no-untyped-def]
    """Whether the bit of column u in row v is set; both must lie inside the mask."""
    return (words[v, u >> 6] >> np.uint64(u & 63)) & _ONE != np.uint64(0)


@kernel
def trim(words, width):  # type: ignore[no-untyped-def]
    """Clear the bits beyond a width."""
    rest = width & 63
    if rest == 0:
        return
    last, kept = words.shape[1] - 1, ALL >> np.uint64(64 - rest)
    for v in range(words.shape[0]):
        words[v, last] &= kept


@kernel
def cut_words(frame, left, top, width, out):  # type: ignore[no-untyped-def]
    """Fill `out` (h, k) with the part of a frame of words whose top left pixel is (left, top)."""
    shift, first = np.uint64(left & 63), left >> 6
    for v in range(out.shape[0]):
        for w in range(out.shape[1]):
            word = frame[top + v, first + w] >> shift
            if shift != np.uint64(0) and first + w + 1 < frame.shape[1]:
                word |= frame[top + v, first + w + 1] << (np.uint64(64) - shift)
            out[v, w] = word
    trim(out, width)


@kernel
def paste_words(frame, left, top, width, out):  # type: ignore[no-untyped-def]
    """As `cut_words`, for a part that may extend beyond the frame; it is 0 there."""
    height, count = frame.shape
    shift, first = np.uint64(left & 63), left >> 6
    for v in range(out.shape[0]):
        for w in range(out.shape[1]):
            word, at = np.uint64(0), first + w
            if 0 <= top + v < height:
                if 0 <= at < count:
                    word = frame[top + v, at] >> shift
                if shift != np.uint64(0) and 0 <= at + 1 < count:
                    word |= frame[top + v, at + 1] << (np.uint64(64) - shift)
            out[v, w] = word
    trim(out, width)


@kernel
def spread(words, v, w):  # type: ignore[no-untyped-def]
    """Word w of row v, grown by the bits whose left, right, upper or lower neighbour is set."""
    height, count = words.shape
    word = words[v, w]
    out = word | (word << _ONE) | (word >> _ONE)
    if w > 0:
        out |= words[v, w - 1] >> _LAST
    if w + 1 < count:
        out |= words[v, w + 1] << _LAST
    if v > 0:
        out |= words[v - 1, w]
    if v + 1 < height:
        out |= words[v + 1, w]
    return out


@kernel
def grow_across(words, px, width):  # type: ignore[no-untyped-def]
    """Grow a mask by `px` pixels to the left and to the right."""
    height, count = words.shape
    for v in range(height):
        done = 1
        while done < px + 1:
            step = min(done, px + 1 - done)
            far, bits = step >> 6, np.uint64(step & 63)
            for w in range(count - 1, far - 1, -1):
                word = words[v, w - far] << bits
                if bits != np.uint64(0) and w - far > 0:
                    word |= words[v, w - far - 1] >> (np.uint64(64) - bits)
                words[v, w] |= word
            done += step
        done = 1
        while done < px + 1:
            step = min(done, px + 1 - done)
            far, bits = step >> 6, np.uint64(step & 63)
            for w in range(count - far):
                word = words[v, w + far] >> bits
                if bits != np.uint64(0) and w + far + 1 < count:
                    word |= words[v, w + far + 1] << (np.uint64(64) - bits)
                words[v, w] |= word
            done += step
    trim(words, width)


@kernel
def grow_square(words, px, width):  # type: ignore[no-untyped-def]
    """Grow a mask by a square of radius `px`."""
    grow_across(words, px, width)
    height, count = words.shape
    done = 1
    while done < px + 1:
        step = min(done, px + 1 - done)
        for v in range(height - 1, step - 1, -1):
            for w in range(count):
                words[v, w] |= words[v - step, w]
        done += step
    done = 1
    while done < px + 1:
        step = min(done, px + 1 - done)
        for v in range(height - step):
            for w in range(count):
                words[v, w] |= words[v + step, w]
        done += step


@kernel
def grow_rows(words, half_widths, width, out):  # type: ignore[no-untyped-def]
    """Fill `out` with a mask grown by a shape; changes the mask.

    Args:
        words: (h, k).
        half_widths: (2 r + 1,) of each row of the shape, px; -1 for an empty row.
        width: of the mask, px.
        out: (h, k), zeros.
    """
    height, count = words.shape
    radius = half_widths.size // 2
    most = 0
    for half in half_widths:
        most = max(most, half)
    for half in range(most + 1):
        if half > 0:
            grow_across(words, np.int64(1), width)
        for i in range(half_widths.size):
            if half_widths[i] != half:
                continue
            for v in range(max(0, radius - i), min(height, height + radius - i)):
                for w in range(count):
                    out[v, w] |= words[v + i - radius, w]


@kernel
def flood(words, within, open_rows):  # type: ignore[no-untyped-def]
    """Grow a mask to all pixels of `within` that are 4-connected to it within `within`.

    Args:
        words, within: (h, k).
        open_rows: (h,) bool, working memory: rows that may grow.
    """
    height, count = words.shape
    for v in range(height):
        held = np.uint64(0)
        for near in range(max(0, v - 1), min(height, v + 2)):
            for w in range(count):
                held |= words[near, w]
        open_rows[v] = held != np.uint64(0)
    changed = True
    while changed:
        changed = False
        for i in range(2 * height):
            v = i if i < height else 2 * height - 1 - i
            if not open_rows[v]:
                continue
            open_rows[v] = False
            grown = False
            for w in range(count):
                grown |= _flood_word(words, within, v, w)
            for w in range(count - 2, -1, -1):
                grown |= _flood_word(words, within, v, w)
            if grown:
                changed = True
                open_rows[v] = True
                open_rows[max(0, v - 1)] = True
                open_rows[min(height - 1, v + 1)] = True


@kernel
def _flood_word(words, within, v, w):  # type: ignore[no-untyped-def]
    """Grow one word from its neighbours, then along itself; returns whether it has changed."""
    free = within[v, w]
    if free == words[v, w]:
        return False
    before = words[v, w]
    found = before | (spread(words, v, w) & free)
    # Along a run of free pixels, to either side, in steps that double.
    if found != before:
        up, down, left, right = found, found, free, free
        for i in range(6):
            step = np.uint64(1 << i)
            up |= left & (up << step)
            left &= left << step
            down |= right & (down >> step)
            right &= right >> step
        found = up | down
    words[v, w] = found
    return found != before
