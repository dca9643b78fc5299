"""Computing time of each part, and its ratio to a fixed reference timed alternately.

Every figure is measured several times. The parts alternate, so that other load on the machine
affects all of them alike. View-evaluations and refinement: minimum over the repeats. Frames:
minimum over the repeats of each frame, then median and 95th percentile over the frames. The ratio
of the whole fit to 1000 evaluations uses the minimum over the frames as well, since both do nearly
the same work in every frame.
"""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from markerless_tracker.benchmarks.machine import machine
from markerless_tracker.benchmarks.speed.reference import ReferenceFitness
from markerless_tracker.benchmarks.speed.scene import SpeedScene
from markerless_tracker.body import BodyModel
from markerless_tracker.fitness.threads import mapper
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import BackgroundModel, Segmenter, edge_map, learn_background
from markerless_tracker.libraries import usable_cores
from markerless_tracker.optim import keyed_generator
from markerless_tracker.records import Comparison, Observation
from markerless_tracker.results.result import versions
from markerless_tracker.tracking import Tracker, TrackerConfig
from markerless_tracker.tracking.search import Searcher, make_fitness
from markerless_tracker.tracking.stages.frame import contour_stage, frame_stages

THOUSAND = 1000
_ALONE = {"body": "balan31", "refinement": "none", "fit_shape": False, "edge_weight": 1.0}
SWARMS: Mapping[str, Mapping[str, Any]] = {
    "sppso_1000": {"optimizer": "sppso", "evaluations": 1000},
    "hmcpso_3600": {"optimizer": "hmcpso", "evaluations": 3600},
    "hmcpso_3600_hard": {"optimizer": "hmcpso", "evaluations": 3600, "partition": "hard"},
}
"""Searches without refinement whose time per frame is measured, all with the published body."""
_REFERENCE_POSES, _POSES = 16, 256
_SHORT, _LONG = 2, 42
_HARD = ("l_clavicle_x", "l_clavicle_y", "l_shoulder_x", "l_shoulder_y", "l_shoulder_z", "l_elbow")
_ARM = {"limb": _HARD, "limb_soft": ("thorax_y", "thorax_z", *_HARD)}
"""Parameters of an arm stage with a hard partition, and with a soft one (torso's joint added)."""

Report = Callable[[str, int, int], None]


def measure(
    scene: SpeedScene,
    *,
    threads: int = 0,
    repeats: int = 5,
    progress: Report = lambda part, done, total: None,
) -> dict[str, Any]:
    """Time all parts on a scene; keys as in `benchmark speed --json`.

    Args:
        scene: images and a start pose.
        threads: threads of fitness, search and imaging; 0 = one per core. View-evaluations always
            use one.
        repeats: number of repeats of each measurement.
        progress: receives the part, its steps done and its steps in total.

    Raises:
        TrackerError: the scene does not fit its rig or start.
    """
    threads = threads or usable_cores()
    tuned = TrackerConfig.from_mapping({"threads": threads})
    swarms = {
        name: TrackerConfig.from_mapping({**_ALONE, **settings, "threads": threads})
        for name, settings in SWARMS.items()
    }
    backgrounds = {name: learn_background(images, tuned) for name, images in scene.empty.items()}
    observed = _observations(scene, tuned, backgrounds)
    views = _view_evaluations(scene, observed[0], repeats, progress)
    swarm = {
        name: _spread(_swarm(scene, config, observed, repeats, progress, name))
        for name, config in swarms.items()
    }
    refine, contours = _refinement(scene, tuned, observed[0], repeats, progress)
    frames = _frames(scene, tuned, backgrounds, observed, repeats, progress)
    fit, thousand = np.array(frames["fitness"]), np.array(frames["thousand"])
    return {
        "machine": machine(),
        "versions": versions(),
        "threads": threads,
        "source": scene.name,
        "frames": len(scene.frames),
        "image_size": list(scene.rig.cameras[0].size_px),
        "cameras": len(scene.rig),
        "view_evaluation_us": views,
        "reference_ratio": views["reference"] / views["full"],
        "limb_ratio": views["limb"] / views["full"],
        "limb_soft_ratio": views["limb_soft"] / views["full"],
        "person31_ratio": views["person31"] / views["full"],
        "swarm_ms": swarm,
        "swarm_ratio": {
            name: figures["median"] / swarm["sppso_1000"]["median"]
            for name, figures in swarm.items()
            if name != "sppso_1000"
        },
        "refine_ms": refine,
        "refine_setup_ms": contours,
        "frame_ms": {
            key: _spread(frames[key])
            for key in ("background", "edges", "imaging", "fitness", "total")
        },
        "thousand_evaluations_ms": _spread(thousand),
        "fit_vs_1000_evaluations": float(fit.min() / thousand.min()),
    }


def poses_around(body: BodyModel, pose: FloatArray, count: int) -> FloatArray:
    """Poses (count, p) drawn around one with the published sigma; the same in every call."""
    rng = keyed_generator(0, 0, "speed")
    return pose + body.sigma * rng.standard_normal((count, body.size))


def _view_evaluations(
    scene: SpeedScene, observations: Mapping[str, Observation], repeats: int, progress: Report
) -> dict[str, float]:
    """Time in µs per pose and view on one thread: kinematics, silhouettes and edges."""
    timed: dict[str, tuple[Callable[[FloatArray], Any], FloatArray]] = {}
    views = len(scene.rig)
    for key, name in (("full", "balan31"), ("person31", "person31")):
        body = scene.body(name)
        pose = scene.pose(body)
        config = TrackerConfig.from_mapping({"body": name, "refinement": "none"})
        fitness = make_fitness(body, scene.rig, config)
        seen = fitness.lay_out(observations)
        poses = poses_around(body, pose, _POSES)
        whole = Comparison.whole(pose, len(body.cone_names), edge_weight=1.0)
        timed[key] = (fitness.prepare(seen, whole), poses)
        if key != "full":
            continue
        reference = ReferenceFitness(
            body, scene.rig.cameras, observations, pose, spacing_px=config.edges.spacing_px
        )
        timed["reference"] = (reference, poses_around(body, pose, _REFERENCE_POSES))
        for part, active in _ARM.items():
            indices = np.sort([body.index(parameter) for parameter in active])
            limb = fitness.prepare(seen, replace(whole, active=indices))
            timed[part] = (limb, np.ascontiguousarray(poses[:, indices]))
    best = dict.fromkeys(timed, np.inf)
    for repeat in range(repeats + 1):
        for key, (evaluate, poses) in timed.items():
            seconds = _seconds(partial(evaluate, poses))
            # The first repeat compiles.
            if repeat:
                best[key] = min(best[key], seconds / (len(poses) * views) * 1e6)
        progress("view-evaluations", repeat + 1, repeats + 1)
    return best


def _swarm(
    scene: SpeedScene,
    config: TrackerConfig,
    observed: Sequence[Mapping[str, Observation]],
    repeats: int,
    progress: Report,
    name: str,
) -> FloatArray:
    """Time in ms per frame (n,) from evidence to pose."""
    body = scene.body(config.body)
    searcher = _searcher(scene, body, config)
    best = np.full(len(observed), np.inf)
    for repeat in range(repeats + 1):
        pose = scene.pose(body)
        for i, observations in enumerate(observed):
            stages = frame_stages(body, config, pose, body.sigma)
            started = time.perf_counter()
            search = searcher.frame(observations, scene.frames[i].stamp_ns, pose)
            pose = search.run(stages)
            if repeat:
                best[i] = min(best[i], (time.perf_counter() - started) * 1e3)
        progress(f"swarm {name}", repeat + 1, repeats + 1)
    return best


def _refinement(
    scene: SpeedScene,
    config: TrackerConfig,
    observations: Mapping[str, Observation],
    repeats: int,
    progress: Report,
) -> tuple[float, float]:
    """Time in ms of one iteration of contour refinement, and of preparing a frame's contours."""
    body = scene.body(config.body)
    pose = scene.pose(body)
    stamp_ns = scene.frames[0].stamp_ns
    stage = contour_stage("align", body, config, pose, body.sigma)
    best = {_SHORT: np.inf, _LONG: np.inf}
    setup = np.inf
    searcher = _searcher(scene, body, config)
    for repeat in range(2 * repeats + 1):
        search = searcher.frame(observations, stamp_ns, pose)
        seconds = _seconds(partial(getattr, search, "contours"))
        if repeat:
            setup = min(setup, seconds)
        for iterations in best:
            search.pose = pose
            stages = (stage.planned(iterations=iterations),)
            seconds = _seconds(partial(search.run, stages))
            if repeat:
                best[iterations] = min(best[iterations], seconds)
        progress("refinement", repeat + 1, 2 * repeats + 1)
    # The difference cancels the two evaluations that both runs contain.
    return (best[_LONG] - best[_SHORT]) / (_LONG - _SHORT) * 1e3, setup * 1e3


def _frames(
    scene: SpeedScene,
    config: TrackerConfig,
    backgrounds: Mapping[str, BackgroundModel],
    observed: Sequence[Mapping[str, Observation]],
    repeats: int,
    progress: Report,
) -> dict[str, FloatArray]:
    """Time in ms per frame (n - 1,) of each part; without the first frame, which fits the shape.

    background: labels, shadows and morphology; edges: the edge maps; imaging: images to packed
    evidence, with edge maps only if `edge_weight` is above 0. These three use the region around the
    previous frame's body, as in tracking. fitness: evidence to pose; total: images to pose;
    thousand: 1000 evaluations of the same body on the same threads.
    """
    whole = _tracker(scene, config, backgrounds)
    fit = _tracker(scene, config, {})
    segmenters = {
        n: Segmenter(n, backgrounds[n], config, edges=config.edge_weight > 0.0) for n in backgrounds
    }
    names = ("background", "edges", "imaging", "fitness", "total", "thousand")
    best = {name: np.full(len(observed), np.inf) for name in names}
    shared_map = mapper(min(config.threads, len(segmenters)))
    whole.warm_up()
    fit.warm_up()
    for repeat in range(repeats):
        whole.reset()
        fit.reset()
        for i, frame in enumerate(scene.frames):
            images, stamp_ns = frame.images, frame.stamp_ns
            masks: dict[str, Any] = {}

            regions = whole.regions(stamp_ns)

            def label(
                name: str, images: Any = images, masks: Any = masks, regions: Any = regions
            ) -> None:
                masks[name] = segmenters[name].mask(images[name], regions[name])

            def edges(
                name: str, images: Any = images, masks: Any = masks, regions: Any = regions
            ) -> None:
                part = regions[name].slices if regions[name] else np.s_[:, :]
                edge_map(images[name][part], masks[name], config)

            def observe(name: str, images: Any = images, regions: Any = regions) -> None:
                segmenters[name].observe(images[name], 0, regions[name])

            taken = {
                "background": _seconds(partial(_all, shared_map, label, segmenters)),
                "edges": _seconds(partial(_all, shared_map, edges, segmenters)),
                "imaging": _seconds(partial(_all, shared_map, observe, segmenters)),
                "fitness": _seconds(partial(fit.step, observed[i], stamp_ns)),
                "total": _seconds(partial(whole.step, images, stamp_ns)),
            }
            if i == 0:
                thousand = _thousand(scene, fit.body, config)
            taken["thousand"] = thousand(observed[i])
            for name, seconds in taken.items():
                best[name][i] = min(best[name][i], seconds * 1e3)
            progress("frames", repeat * len(observed) + i + 1, repeats * len(observed))
    return {name: values[1:] for name, values in best.items()}


def _thousand(
    scene: SpeedScene, body: BodyModel, config: TrackerConfig
) -> Callable[[Mapping[str, Observation]], float]:
    """Seconds that 1000 evaluations of a body take on a frame's evidence."""
    fitness = make_fitness(body, scene.rig, config, threads=config.threads)
    poses = poses_around(body, scene.pose(body), THOUSAND)
    every = np.ones(len(body.cone_names), dtype=np.bool_)

    def run(observations: Mapping[str, Observation]) -> float:
        views = fitness.lay_out(observations)
        return _seconds(lambda: fitness.count(views, poses, every, every))

    return run


def _searcher(scene: SpeedScene, body: BodyModel, config: TrackerConfig) -> Searcher:
    shared_map = mapper(min(config.threads, len(scene.rig)))
    return Searcher(
        scene.rig, body, config, limits=body.limits, threads=config.threads, mapper=shared_map
    )


def _tracker(
    scene: SpeedScene, config: TrackerConfig, backgrounds: Mapping[str, BackgroundModel]
) -> Tracker:
    body = scene.body(config.body)
    return Tracker(scene.rig, body, config, start_pose=scene.pose(body), backgrounds=backgrounds)


def _observations(
    scene: SpeedScene, config: TrackerConfig, backgrounds: Mapping[str, BackgroundModel]
) -> list[dict[str, Observation]]:
    segmenters = {name: Segmenter(name, backgrounds[name], config) for name in scene.rig.names}
    return [
        {name: s.observe(frame.images[name], frame.stamp_ns) for name, s in segmenters.items()}
        for frame in scene.frames
    ]


def _all(
    shared_map: Callable[..., Iterable[None]], work: Callable[[str], None], names: Iterable[str]
) -> None:
    list(shared_map(work, names))


def _seconds(work: Callable[[], Any]) -> float:
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


def _spread(values: FloatArray) -> dict[str, float]:
    return {"median": float(np.median(values)), "p95": float(np.percentile(values, 95))}
