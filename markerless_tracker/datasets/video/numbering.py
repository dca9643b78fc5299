"""Numbers in the names of files: their order, and whether folders of cameras hold the same ones."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from markerless_tracker.datasets.video.images import image_number, numbered_files
from markerless_tracker.errors import DatasetError


def in_order(path: Path) -> tuple[list[tuple[bool, int, str]], str]:
    """Sorts names by their texts and numbers: part_9 comes before part_10."""
    parts = re.split("([0-9]+)", path.name)
    return [(p.isdecimal(), int(p) if p.isdecimal() else 0, p) for p in parts], path.name


def check_numbers(folders: Mapping[str, Path]) -> list[str]:
    """Compare the image numbers of cameras, whose k-th images form a set.

    Numbers that do not count frames, such as times, are not compared.

    Args:
        folders: camera -> folder of numbered images.

    Returns:
        Warnings, one line each: numbers that all cameras lack, or different first numbers.

    Raises:
        DatasetError: a camera lacks an image that another one has; names both.
    """
    numbers = {name: _numbers(folder) for name, folder in folders.items()}
    counted = {name: found for name, found in numbers.items() if found}
    if not counted or len(counted) < len(folders):
        return []
    step = min(_least_step(found) for found in counted.values())
    places = {name: _places(found, step) for name, found in counted.items()}
    if any(found is None for found in places.values()):
        return []
    there = {name: found for name, found in places.items() if found is not None}
    missing = {name: [k for k in range(max(own)) if k not in own] for name, own in there.items()}
    for name, gaps in missing.items():
        lone = next(((k, other) for k in gaps for other in there if k in there[other]), None)
        if lone is not None:
            raise DatasetError(
                f"{folders[name]}: no image {counted[name][0] + lone[0] * step}, but {lone[1]} has "
                "one, expected an image of each camera for every set"
            )
    warnings = []
    first = next(iter(counted))
    if missing[first]:
        warnings.append(
            f"{folders[first]}: {len(missing[first])} image numbers are missing in all cameras, "
            f"the first is {counted[first][0] + missing[first][0] * step}; the images after them "
            "follow without a gap in time"
        )
    begins = {name: found[0] for name, found in counted.items()}
    if len(set(begins.values())) > 1:
        listed = ", ".join(f"{name} {number}" for name, number in begins.items())
        warnings.append(
            f"{folders[first].parent}: cameras begin with different image numbers ({listed}), "
            "their first images are taken as one set"
        )
    return warnings


def _numbers(folder: Path) -> list[int] | None:
    """The image numbers of a folder in order; None if a name has none."""
    numbers = [image_number(file) for file in numbered_files(folder)]
    found = [number for number in numbers if number is not None]
    return found if len(found) == len(numbers) else None


def _least_step(numbers: Sequence[int]) -> int:
    return min((later - one for one, later in zip(numbers, numbers[1:], strict=False)), default=1)


def _places(numbers: Sequence[int], step: int) -> set[int] | None:
    """Places of images, counted from the first; None if the numbers do not count by that step."""
    off = [number - numbers[0] for number in numbers]
    if step < 1 or any(value % step for value in off) or off[-1] // step + 1 >= 2 * len(off):
        return None
    return {value // step for value in off}
