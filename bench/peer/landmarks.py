"""Landmarks of MediaPipe Pose in every view of a recording folder; runs in `.venv-peer`.

The model is `full`, which the wheel of MediaPipe brings along. Each view has a detector of its own
in its video mode, with the defaults of its makers. Nothing is given to it but the images.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import cv2
import mediapipe
import numpy as np

SUFFIXES = (".mp4", ".mkv", ".avi", ".mov")
LANDMARKS = 33
FULL = 1
"""Number of the model `full`."""


def landmarks(videos: list[Path]) -> tuple[np.ndarray, float]:
    """Landmarks of all frames, up to the end of the shortest video.

    Args:
        videos: one per view.

    Returns:
        (frames, views, 33, 3) u, v in px (the centre of the top left pixel is (0, 0)) and
        visibility in [0, 1], NaN where no person was detected; and the seconds that detection took,
        without decoding.
    """
    streams = [cv2.VideoCapture(str(video)) for video in videos]
    detectors = [mediapipe.solutions.pose.Pose(model_complexity=FULL) for _ in videos]
    found, seconds = [], 0.0
    while True:
        images = [image for done, image in (stream.read() for stream in streams) if done]
        if len(images) < len(videos):
            break
        started = time.perf_counter()
        found.append([in_view(one, image) for one, image in zip(detectors, images, strict=True)])
        seconds += time.perf_counter() - started
    for detector in detectors:
        detector.close()
    return np.array(found).reshape(-1, len(videos), LANDMARKS, 3), seconds


def in_view(detector: "mediapipe.solutions.pose.Pose", image: np.ndarray) -> np.ndarray:
    """(33, 3) landmarks of a BGR image, as `landmarks` returns them."""
    height, width = image.shape[:2]
    pose = detector.process(cv2.cvtColor(image, cv2.COLOR_BGR2RGB)).pose_landmarks
    if pose is None:
        return np.full((LANDMARKS, 3), np.nan)
    # Its coordinates are shares of the image, from its border.
    return np.array([[p.x * width - 0.5, p.y * height - 0.5, p.visibility] for p in pose.landmark])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path, help="folder with one video NAME.mp4 per camera")
    parser.add_argument("cameras", help="names of the cameras: A,B,...")
    parser.add_argument("out", type=Path, help="file to write (.npz)")
    args = parser.parse_args()
    videos = []
    for name in args.cameras.split(","):
        files = [args.recording / f"{name}{suffix}" for suffix in SUFFIXES]
        existing = next((file for file in files if file.is_file()), None)
        if existing is None:
            sys.exit(f"{args.recording}: no video of {name}, expected {files[0].name}")
        videos.append(existing)
    found, seconds = landmarks(videos)
    if not len(found):
        sys.exit(f"{args.recording}: a video has no frame")
    np.savez_compressed(args.out, landmarks=found)
    about = {"version": mediapipe.__version__, "sets": len(found), "seconds": seconds}
    json.dump(about, sys.stdout)


if __name__ == "__main__":
    main()
