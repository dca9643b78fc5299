import resource
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging import (
    BackgroundModel,
    Mode,
    read_background_model,
    write_background_model,
)


def model() -> BackgroundModel:
    rng = np.random.default_rng(0)
    mean, other = rng.uniform(0, 255, (2, 7, 9, 3))
    mode = Mode(rng.uniform(0, 0.5, (7, 9)), other, other + 1.0)
    return BackgroundModel(mean, mean + 1.0, "what it is made of", (mode,))


def test_a_written_model_is_read_back(tmp_path: Path) -> None:
    path, twin = tmp_path / "new" / "cam01.npz", tmp_path / "twin"
    write_background_model(path, model())
    write_background_model(twin, model())
    assert path.read_bytes() == twin.read_bytes()
    back, before = read_background_model(path), model()
    assert back.note == before.note
    for name in ("mean", "variance"):
        assert (getattr(back, name) == getattr(before, name)).all()
    for name in ("weight", "mean", "variance"):
        assert (getattr(back.modes[0], name) == getattr(before.modes[0], name)).all()


def test_other_files_are_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "cam01.npz"
    for content in (b"", b"no archive", b"PK\x03\x04 cut off"):
        path.write_bytes(content)
        with pytest.raises(ImageError, match="cam01.npz") as caught:
            read_background_model(path)
        assert "\n" not in str(caught.value)
    np.savez(path.open("wb"), mean=np.zeros(3))
    with pytest.raises(ImageError, match="no background model"):
        read_background_model(path)
    with pytest.raises(ImageError, match="absent.npz: cannot be read"):
        read_background_model(tmp_path / "absent.npz")
    with pytest.raises(ImageError, match="cannot be written"):
        write_background_model(tmp_path, model())


def test_a_damaged_model_is_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "cam01.npz"
    write_background_model(path, model())
    whole = path.read_bytes()
    for place in range(0, len(whole), 7):
        damaged = bytearray(whole)
        damaged[place] ^= 0xFF
        path.write_bytes(damaged)
        try:
            read_background_model(path)
        except ImageError as error:
            assert str(error).startswith(f"{path}: ")
    nothing = np.full((7, 9, 3), np.nan, np.float32)
    with path.open("wb") as file:
        np.savez(file, version=1, mean=nothing, variance=nothing, note=np.zeros(0, np.uint8))
    with pytest.raises(ImageError, match="cam01.npz: background: got numbers"):
        read_background_model(path)


def test_an_earlier_file_stays_until_the_new_one_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "cam01.npz"
    write_background_model(path, model())
    before = path.read_bytes()
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limit[1]))
    try:
        with pytest.raises(ImageError, match=r"cam01.npz: cannot be written: File too large"):
            write_background_model(path, model())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]
