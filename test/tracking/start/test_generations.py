"""When the generations of a start end."""

from types import SimpleNamespace

import numpy as np
import pytest

from markerless_tracker.tracking.start.generations import improved


@pytest.mark.parametrize(
    "costs, used",
    [([0.4, 0.3, 0.2, 0.1], 3), ([0.10, 0.099, 0.05, 0.04], 1), ([0.4, 0.399, 0.398, 0.397], 3),
     ([0.3, 0.14, 0.139, 0.05], 2)],
)  # fmt: skip
def test_generations_end_when_the_best_pose_fits_and_hardly_improves(costs, used) -> None:
    populations = [SimpleNamespace(at=i, costs=np.array([c, 1.0])) for i, c in enumerate(costs)]
    numbers = []

    def recombined(population, number):
        numbers.append(number)
        return populations[population.at + 1]

    frame = SimpleNamespace(recombined=recombined)
    assert improved(frame, populations[0], range(4, 7)) is populations[used]
    assert numbers == [4, 5, 6][:used]
