"""Numbered images of several cameras: lost ones are found, numbers that do not count are left."""

from pathlib import Path

import pytest

from markerless_tracker.datasets.video.numbering import check_numbers
from markerless_tracker.errors import DatasetError


def folders(root: Path, **numbers: list[int]) -> dict[str, Path]:
    for name, own in numbers.items():
        (root / name).mkdir()
        for number in own:
            (root / name / f"image{number:04d}.bmp").touch()
    return {name: root / name for name in numbers}


@pytest.mark.parametrize(
    ("a", "b"),
    [
        ([0, 1, 2, 3], [0, 1, 2, 3]),
        ([0, 1, 2, 3], [0, 1, 2]),
        ([3, 6, 9], [3, 6, 9]),
        ([5], [5]),
        # Times in ms.
        ([1000, 1033, 1067, 1100], [1001, 1034, 1066, 1101]),
    ],
)
def test_numbers_without_a_gap(tmp_path: Path, a: list[int], b: list[int]) -> None:
    assert check_numbers(folders(tmp_path, a=a, b=b)) == []


@pytest.mark.parametrize(("a", "lost"), [([0, 1, 3, 4], 2), ([10, 12, 14, 18], 16)])
def test_a_lost_image_of_one_camera_is_named(tmp_path: Path, a: list[int], lost: int) -> None:
    whole = list(range(a[0], a[-1] + 1, a[1] - a[0]))
    with pytest.raises(DatasetError, match=f"/a: no image {lost}, but b has one"):
        check_numbers(folders(tmp_path, a=a, b=whole))


def test_what_all_cameras_lack_is_a_warning(tmp_path: Path) -> None:
    (warning,) = check_numbers(folders(tmp_path, a=[0, 1, 4, 5], b=[0, 1, 4, 5, 6]))
    assert "2 image numbers are missing in all cameras, the first is 2" in warning


def test_different_first_numbers_are_a_warning(tmp_path: Path) -> None:
    (warning,) = check_numbers(folders(tmp_path, a=[1, 2, 3], b=[0, 1, 2, 3]))
    assert "begin with different image numbers (a 1, b 0)" in warning


def test_names_without_numbers_are_left(tmp_path: Path) -> None:
    found = folders(tmp_path, a=[0, 1, 3], b=[0, 1, 2, 3])
    (found["a"] / "first.bmp").touch()
    assert check_numbers(found) == [] and check_numbers({}) == []
