"""Search with an optimiser of one's own, registered by name.

    python examples/own_optimizer.py --frames 12

`RandomSearch` draws points around the best one, ever closer. It takes the place of `pso`, whose
partition searches the whole body at once. `refine.swarms: always` searches with it in each frame
after the start (here the first eight); by default frames that the contour refinement explains are
not searched. A made-up person stands for the images.
"""

import argparse
from typing import Any

import numpy as np

from markerless_tracker import TrackerConfig, build_tracker, learn_background
from markerless_tracker.optim import ALGORITHMS, Optimizer, Problem
from markerless_tracker.synthesis import SyntheticScene


class RandomSearch(Optimizer):
    """Normal draws around the best point; their width shrinks from iteration to iteration."""

    def __init__(self, problem: Problem, **_: Any) -> None:
        super().__init__(problem)
        self._width = 1.0

    def _ask(self) -> tuple[Any, Any]:
        p = self.problem
        draws = p.rng.standard_normal((p.particles, p.centre.size))
        points = np.clip(self.best_x + self._width * p.sigma * draws, *p.bounds)
        return points, ~p.feasible(points)

    def _tell(self, points: Any, costs: Any) -> None:
        self._width *= 0.95


ALGORITHMS["pso"] = RandomSearch


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=12)
    args = parser.parse_args()

    scene = SyntheticScene(body="person31", size_px=(328, 245))
    config = TrackerConfig.from_mapping(
        {"optimizer": "pso", "evaluations": 900, "refine.swarms": "always"}
    )
    backgrounds = {
        name: learn_background(images, config, camera=name)
        for name, images in scene.backgrounds(5).items()
    }
    tracker = build_tracker(scene.rig, config, backgrounds=backgrounds, stature=1.72).tracker
    for index in range(args.frames):
        result = tracker.step(scene.frame(index)[0], scene.stamp_ns(index))
        print(f"{index}: {result.state.value}, fitness {result.fitness:.3f}")


if __name__ == "__main__":
    main()
