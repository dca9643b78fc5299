"""Track a person in NumPy images, one set of images after the other.

    python examples/track_arrays.py --frames 10

`read_cameras` stands for your own cameras: here it renders a made-up person. Images are uint8
arrays (h, w, 3) in BGR or (h, w) in grey, as OpenCV reads them, unrectified, one per camera and
time.
"""

import argparse
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from markerless_tracker import (
    MARKER_NAMES,
    CameraModel,
    CameraRig,
    TrackerConfig,
    TrackState,
    build_tracker,
    learn_background,
)
from markerless_tracker.synthesis import SyntheticScene

Images = dict[str, NDArray[np.uint8]]


def my_rig(scene: SyntheticScene) -> CameraRig:
    """The calibrated cameras; `read_calibration(Path("calibration.toml"))` reads them from a file.

    T_cam_world (4, 4) takes world points (metres, Z up) to the camera's frame (z forward, x right,
    y down); distortion is k1 k2 p1 p2, with k3 if known.
    """
    return CameraRig(
        tuple(
            CameraModel(
                name=camera.name,
                size_px=camera.size_px,
                matrix=camera.matrix,
                distortion=camera.distortion,
                T_cam_world=camera.T_cam_world,
            )
            for camera in scene.rig
        )
    )


def read_cameras(scene: SyntheticScene, frames: int) -> Iterator[tuple[int, Images]]:
    """Stamp in ns and image by camera of each time."""
    for index in range(frames):
        images, _, _ = scene.frame(index)
        yield scene.stamp_ns(index), images


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=10)
    args = parser.parse_args()

    scene = SyntheticScene(body="person31", size_px=(328, 245))
    config = TrackerConfig()
    # A few images of the empty scene per camera.
    empty = scene.backgrounds(5)
    backgrounds = {
        name: learn_background(images, config, camera=name) for name, images in empty.items()
    }
    tracker = build_tracker(my_rig(scene), config, backgrounds=backgrounds, stature=1.72).tracker
    # Compiles everything before the first image.
    tracker.warm_up()
    for stamp_ns, images in read_cameras(scene, args.frames):
        result = tracker.step(images, stamp_ns)
        if result.state is TrackState.TRACKING and result.markers_m is not None:
            wrist = result.markers_m[MARKER_NAMES.index("RWrist")]
            print(f"{stamp_ns * 1e-9:.3f} s: right wrist {np.round(wrist, 3)} m")
        else:
            print(f"{stamp_ns * 1e-9:.3f} s: {result.state.value}")


if __name__ == "__main__":
    main()
