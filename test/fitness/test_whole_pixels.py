"""Whole pixels suffice: f_s against the same cones drawn at four times the resolution."""

import cv2
import numpy as np
from scipy.stats import spearmanr

from markerless_tracker.body import load_body
from markerless_tracker.fitness import Fitness
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import ring_rig

FINE = 4


def fine_silhouette(twin, body, camera, pose):
    """Mask (4 h, 4 w) of a posed body: 4 x 4 samples per pixel; each row of a cone is one span."""
    width, height = camera.size_px
    drawn = np.zeros((height * FINE, width * FINE), dtype=bool)
    u = (np.arange(width * FINE) + 0.5) / FINE - 0.5
    v = (np.arange(height * FINE) + 0.5) / FINE - 0.5
    for points in twin(body, camera, pose).points:
        if len(points) == 0:
            continue
        p = cv2.convexHull(points.astype(np.float32))[:, 0].astype(np.float64)
        q = np.roll(p, -1, axis=0)
        p, q = p[p[:, 1] != q[:, 1]], q[p[:, 1] != q[:, 1]]
        rows = np.flatnonzero((v >= p[:, 1].min()) & (v <= p[:, 1].max()))
        share = (v[rows, None] - p[:, 1]) / (q - p)[:, 1]
        cut = np.where((share >= 0) & (share <= 1), p[:, 0] + share * (q - p)[:, 0], np.nan)
        low, high = np.nanmin(cut, axis=1), np.nanmax(cut, axis=1)
        drawn[rows] |= (u >= low[:, None]) & (u <= high[:, None])
    return drawn


def compare(twin, body, cameras, masks, poses) -> tuple[float, float]:
    """Greatest difference of f_s, and Spearman's rank correlation, over poses (n, p)."""
    views = {
        c.name: Observation.from_mask(c.name, 0, masks[c.name], masks[c.name].astype(np.uint8))
        for c in cameras
    }
    fitness = Fitness(body, cameras)
    laid_out = fitness.lay_out(views)
    seen = {
        c.name: np.repeat(np.repeat(masks[c.name], FINE, axis=0), FINE, axis=1) for c in cameras
    }
    ours, fine = [], []
    for pose in poses:
        ours.append(np.mean([t.silhouette for t in fitness.terms(laid_out, pose).values()]))
        shares = []
        for camera in cameras:
            drawn = fine_silhouette(twin, body, camera, pose)
            both = float((drawn & seen[camera.name]).sum())
            shares += [both / max(drawn.sum(), 1), both / seen[camera.name].sum()]
        fine.append(np.mean(shares))
    return float(np.abs(np.subtract(ours, fine)).max()), float(spearmanr(ours, fine).statistic)


def test_poses_around_the_true_one_have_the_same_ranks(twin) -> None:
    body = load_body("balan31")
    cameras = ring_rig(2, size_px=(644, 488)).cameras
    pose = body.neutral.copy()
    pose[body.index("pelvis_tz")] = 0.95
    masks = {c.name: fine_silhouette(twin, body, c, pose)[2::FINE, 2::FINE] for c in cameras}
    rng = np.random.default_rng(0)
    poses = pose + body.sigma * rng.standard_normal((60, body.size))
    difference, rank = compare(twin, body, cameras, masks, poses)
    assert difference <= 0.005
    assert rank >= 0.999
