"""Selects a few frames of a run of any length: evenly spread over it, or with different poses."""

from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.model import IntArray
from markerless_tracker.geometry import FloatArray

Item = TypeVar("Item")


def posture_angles(body: BodyModel) -> IntArray:
    """Indices of the parameters that make a posture: all joints, without place and heading."""
    return np.setdiff1d(body.joints, body.root)


class EvenlySpread(Generic[Item]):
    """Keeps every k-th of the offered items; k doubles when there are too many.

    Args:
        most: fewer items than this are kept.

    Attributes:
        items: the kept items, in the order in which they came.
    """

    def __init__(self, most: int) -> None:
        self.items: list[Item] = []
        self._most = most
        self._every = 1
        self._offered = 0

    def offer(self, make: Callable[[], Item]) -> None:
        """Keep the next item or skip it; `make` is called if it is kept."""
        self._offered += 1
        if (self._offered - 1) % self._every:
            return
        self.items.append(make())
        if len(self.items) >= self._most:
            self.items, self._every = self.items[::2], 2 * self._every


def most_different(count: int, most: int, distances: Callable[[int], FloatArray]) -> list[int]:
    """At most `most` of `count` items, each as far as possible from the items chosen before it.

    The first chosen item is the middle one.

    Args:
        count: number of items.
        most: number of items to choose.
        distances: gives, for an item's index, its distances (count,) to all items.
    """
    if count == 0:
        return []
    order = [count // 2]
    nearest = distances(order[0])
    while len(order) < min(most, count):
        order.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, distances(order[-1]))
    return order
