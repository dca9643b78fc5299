"""A scene against its background."""

import cv2
import numpy as np

from markerless_tracker.checks.scene import moved_px, unlike_share


def picture(seed=0):
    rng = np.random.default_rng(seed)
    rough = cv2.GaussianBlur(rng.standard_normal((200, 260)).astype(np.float32), (0, 0), 2.0)
    return 120.0 + 40.0 * rough / rough.std()


def test_a_moved_camera_is_measured() -> None:
    whole = picture()
    here, there = whole[20:180, 20:240], whole[22:182, 25:245]
    assert moved_px(here, here) < 0.1
    assert abs(moved_px(here, there) - np.hypot(2.0, 5.0)) < 0.3
    assert moved_px(here, picture(9)[20:180, 20:240]) == 0.0


def test_a_chair_is_a_share_of_the_scene() -> None:
    scene, empty = picture(), picture()
    scene[50:100, 60:125] += 60.0
    assert unlike_share(empty, empty) == 0.0
    assert abs(unlike_share(scene, empty) - 50 * 65 / scene.size) < 0.01
    assert unlike_share(scene, np.zeros_like(scene)) == 1.0
