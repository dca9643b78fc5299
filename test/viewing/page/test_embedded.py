"""The film that is embedded in the page, read back."""

import io
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.results.read import read_result
from markerless_tracker.viewing.images import ResultImages
from markerless_tracker.viewing.page.embedded import embedded_film

av = pytest.importorskip("av", reason="PyAV is not installed: pip install av")


def test_the_film_is_in_the_time_of_the_result(make_result, walk: Path) -> None:
    sets = np.array([0, 1, 3, 5])
    result = read_result(make_result(source=walk)).rows(sets)
    film = embedded_film(result, ResultImages(result))
    with av.open(io.BytesIO(film.data)) as opened:
        times_s = [frame.time for frame in opened.decode(video=0)]
    np.testing.assert_allclose(times_s, sets / 30.0, atol=1e-3)
