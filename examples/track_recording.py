"""Track the person in a recording from disk and write the markers to a file.

    python examples/track_recording.py RECORDING out/walk

RECORDING is a folder with `calibration.toml`, one video per camera and `background/`. If it has a
`ground_truth.trc`, its first row gives the start pose; otherwise the person is searched for.
"""

import argparse
from pathlib import Path

from markerless_tracker import (
    MARKER_NAMES,
    ResultWriter,
    TrackerConfig,
    build_tracker,
    open_recording,
    recording_backgrounds,
    track_recording,
)

HEAD = MARKER_NAMES.index("Head")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recording", type=Path)
    parser.add_argument("result", type=Path, help="NAME of NAME.trc and NAME.json")
    args = parser.parse_args()

    recording = open_recording(args.recording)
    config = TrackerConfig()
    reference = args.recording / "ground_truth.trc"
    setup = build_tracker(
        recording.rig,
        config,
        backgrounds=recording_backgrounds(recording, config),
        start_file=reference if reference.is_file() else None,
    )
    tracker = setup.tracker
    with ResultWriter(args.result, tracker.body, config, fps=recording.fps) as writer:
        for tracked in track_recording(recording, setup):
            result = tracked.result
            writer.add(result)
            # The sizes of the body are fitted during the first frames.
            writer.body = tracker.body
            seconds = result.stamp_ns * 1e-9
            if result.markers_m is None:
                print(f"{seconds:.3f} s: {result.state.value}")
            else:
                x, y, z = result.markers_m[HEAD]
                print(f"{seconds:.3f} s: {result.state.value}, head {x:.3f} {y:.3f} {z:.3f} m")
    print(writer.trc_path)


if __name__ == "__main__":
    main()
