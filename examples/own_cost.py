"""Search with a cost of one's own: that of the images and a term for the pose.

    python examples/own_cost.py --frames 12

The images' cost of a pose is 1 - f_s, f_s being the overlap of body and silhouettes.
`NearPrediction` adds a term that grows with the distance from the predicted pose. It takes the
place of the algorithm `sppso`. `refine.swarms: always` searches with it in each frame after the
start (here the first eight); by default frames that the contour refinement explains are not
searched. A made-up person stands for the images.
"""

import argparse
from typing import Any

from markerless_tracker import TrackerConfig, build_tracker, learn_background
from markerless_tracker.optim import ALGORITHMS, Sppso
from markerless_tracker.synthesis import SyntheticScene

WEIGHT = 0.002
"""Cost of one standard deviation."""


class NearPrediction(Sppso):
    """SPPSO whose cost rises with the distance from the centre of the search."""

    def run(self, evaluate: Any, *, early: bool = False) -> Any:
        """Spend the budget on the images' cost (n,) of points (n, d) and the term of our own."""
        p = self.problem

        def cost(points: Any) -> Any:
            distance = ((points - p.centre) / p.sigma) ** 2
            return evaluate(points) + WEIGHT * distance.mean(axis=1)

        # Cutoffs are of the images' cost alone: without them.
        return super().run(cost)


ALGORITHMS["sppso"] = NearPrediction


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=12)
    args = parser.parse_args()

    scene = SyntheticScene(body="person31", size_px=(328, 245))
    config = TrackerConfig.from_mapping({"refine.swarms": "always"})
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
