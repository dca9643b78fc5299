"""Track silhouettes of one's own segmenter.

    python examples/own_segmenter.py --frames 4

`Tracker.step` takes an `Observation` in place of an image: a mask, and edges if the cost uses them.
The tracker needs no backgrounds then. `segment` subtracts an empty image; any other segmenter may
take its place. From disk: `markerless_tracker track SOURCE -o NAME --masks DIR`. A made-up person
stands for the images.
"""

import argparse

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker import Observation, TrackerConfig, build_tracker
from markerless_tracker.synthesis import SyntheticScene

THRESHOLD = 30


def segment(
    camera: str, image: NDArray[np.uint8], empty: NDArray[np.uint8], stamp_ns: int
) -> Observation:
    """The evidence of one image: what differs from the empty scene, without single pixels."""
    difference = cv2.absdiff(image, empty).max(axis=2)
    mask = cv2.medianBlur((difference > THRESHOLD).astype(np.uint8), 5)
    return Observation.from_mask(camera, stamp_ns, mask, np.zeros(mask.shape, dtype=np.uint8))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=10)
    args = parser.parse_args()

    scene = SyntheticScene(body="person31", size_px=(328, 245))
    empty = {name: images[0] for name, images in scene.backgrounds(1).items()}
    tracker = build_tracker(scene.rig, TrackerConfig(), stature=1.72).tracker
    for index in range(args.frames):
        stamp_ns = scene.stamp_ns(index)
        views = {
            name: segment(name, image, empty[name], stamp_ns)
            for name, image in scene.frame(index)[0].items()
        }
        result = tracker.step(views, stamp_ns)
        print(f"{index}: {result.state.value}, fitness {result.fitness:.3f}")


if __name__ == "__main__":
    main()
