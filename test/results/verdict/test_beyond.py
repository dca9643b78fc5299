"""How far silhouettes reach beyond the body."""

from dataclasses import replace
from typing import Any

import numpy as np

from markerless_tracker.geometry import rotation_from_rodrigues
from markerless_tracker.results.verdict.beyond import LEAST, Beyond


def cut(mask: np.ndarray, above: int, below: int) -> np.ndarray:
    """A mask without its first and last rows."""
    rows = np.flatnonzero(mask.any(axis=1))
    found = mask > 0
    found[: rows[0] + above] = False
    found[rows[-1] + 1 - below :] = False
    return found


def added(scene: Any, result: Any, masks: Any, frames: int, rows: dict[str, Any]) -> Beyond:
    found = Beyond()
    for index in range(frames):
        for camera in scene.rig:
            covered = cut(masks[index][camera.name], *rows.get(camera.name, (4, 2)))
            found.add(result(index), camera, covered)
    return found


def test_rows_above_and_below_in_metres(scene: Any, result: Any, masks: Any) -> None:
    found = added(scene, result, masks, LEAST, {})
    # A pixel is 10 to 20 mm in these images.
    assert 0.06 < found.median_m < 0.12
    assert set(found.by_camera_m) == set(scene.rig.names)
    assert (
        abs(added(scene, result, masks, LEAST, dict.fromkeys(scene.rig.names, (0, 0))).median_m)
        < 0.01
    )


def test_one_camera_with_a_shadow_does_not_count(scene: Any, result: Any, masks: Any) -> None:
    rows = {**dict.fromkeys(scene.rig.names, (0, 0)), "cam01": (0, 15)}
    found = added(scene, result, masks, LEAST, rows)
    assert found.by_camera_m["cam01"] > 0.1 and abs(found.median_m) < 0.01


def test_a_single_row_is_the_resolution_of_the_images(scene: Any, result: Any, masks: Any) -> None:
    found = added(scene, result, masks, LEAST, dict.fromkeys(scene.rig.names, (1, 0)))
    assert abs(found.median_m) < 0.003


def test_few_frames_say_nothing(scene: Any, result: Any, masks: Any) -> None:
    assert np.isnan(added(scene, result, masks, LEAST - 1, {}).median_m)


def test_a_camera_that_lies_on_its_side_is_passed_over(scene: Any, result: Any, masks: Any) -> None:
    found = Beyond()
    camera = scene.rig.cameras[0]
    T = np.eye(4)
    T[:3, :3] = rotation_from_rodrigues(np.array([0.0, 0.0, 0.5 * np.pi]))
    aside = replace(camera, T_cam_world=T @ np.asarray(camera.T_cam_world))
    for index in range(LEAST):
        found.add(result(index), aside, masks[index][camera.name] > 0)
    assert found.by_camera_m == {} and np.isnan(found.median_m)


def test_specks_beside_the_person_do_not_count(scene: Any, result: Any, masks: Any) -> None:
    found = Beyond()
    for index in range(LEAST):
        for camera in scene.rig:
            there = result(index)
            seen = there.observations[camera.name]
            speck = seen.mask.copy()
            speck[-3:-1, :2] = True
            assert not seen.mask[-6:, :8].any()
            views = {**there.observations, camera.name: seen.with_masks(speck, seen.undecided)}
            found.add(replace(there, observations=views), camera, masks[index][camera.name] > 0)
    assert abs(found.median_m) < 0.01


def test_what_is_connected_with_the_person_counts(scene: Any, result: Any, masks: Any) -> None:
    found = Beyond()
    for index in range(LEAST):
        for camera in scene.rig:
            covered = cut(masks[index][camera.name], 8, 0)
            found.add(result(index), camera, covered)
    assert found.median_m > 0.06
