"""A generated scene, frame by frame: images, exact masks and the true markers."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import (
    MARKER_NAMES,
    BodyModel,
    Subject,
    load_description,
    markers,
    pose_from_markers,
)
from markerless_tracker.body.build import build_body
from markerless_tracker.camera import CameraRig
from markerless_tracker.geometry import FloatArray
from markerless_tracker.synthesis.people import Action, Person
from markerless_tracker.synthesis.people.person import PARTS
from markerless_tracker.synthesis.rig import check_fps
from markerless_tracker.synthesis.rooms.chair import chair
from markerless_tracker.synthesis.rooms.lighting import Lighting, Triangles
from markerless_tracker.synthesis.rooms.surfaces import painted
from markerless_tracker.synthesis.rooms.view import Image, Mask, View, camera_model
from markerless_tracker.synthesis.scenes.colours import part_colours, part_light, vertex_colours
from markerless_tracker.synthesis.scenes.spec import SceneSpec, sample_scene

# Apart from each other: noise of frames with the person and of empty frames.
_PERSON, _EMPTY = 8, 9
_START_TOLERANCE_M = 0.03
# Times at which clothes that look like the room are compared with it.
_MATCHED_S = (0.0, 1.0, 2.0)
_CHAIR = (70.0, 90.0, 120.0)


class GeneratedScene:
    """A person in a room; everything depends on the arguments alone.

    Args:
        spec: the scene, or the seed of a sampled one.
        fps: frames per second; frame i has stamp round(i * 1e9 / fps).
        motion: what the person does instead of the spec's motion: one of `people.ACTIONS`. A chair
            stands in the room only where the motion is "seated".

    Attributes:
        spec, fps, seed: as given.
        rig: the true cameras.
        person: skeleton and surface.
        body: the skeleton; no tracker has it.
        motion: what the person does.

    Raises:
        ConfigError: the motion is unknown, the seed is negative, or the rate is impossible.
    """

    def __init__(
        self, spec: SceneSpec | int, *, fps: float = 60.0, motion: str | None = None
    ) -> None:
        check_fps(fps)
        self.spec = spec if isinstance(spec, SceneSpec) else sample_scene(spec)
        spec = self.spec
        self.fps = float(fps)
        self.seed = spec.seed
        self.person = Person(spec.person)
        self.body: BodyModel = self.person.body
        self.motion = Action(self.person, motion or spec.motion, spec.seed, spec.place_m)
        self.rig = CameraRig(
            tuple(
                camera_model(f"cam{i + 1:02d}", camera, spec.sensor.size_px)
                for i, camera in enumerate(spec.cameras)
            )
        )
        self._lighting = Lighting(spec.room)
        self._furniture = self._chair() if self.motion.kind == "seated" else _NOTHING
        sheet = painted(spec.room)
        self._views = {
            model.name: View(model, camera, spec.sensor, self._lighting, sheet)
            for model, camera in zip(self.rig, spec.cameras, strict=True)
        }
        level = float(np.mean([view.level() for view in self._views.values()]))
        self._colours = self._painted()
        self._exposure = spec.sensor.level / level

    def stamp_ns(self, index: int) -> int:
        """Stamp of a frame."""
        return round(index * 1e9 / self.fps)

    def pose(self, index: int) -> FloatArray:
        """True pose (p,) of the skeleton in a frame."""
        return self.motion.pose(index / self.fps)

    def markers(self, index: int) -> FloatArray:
        """True markers (15, 3) in m, world frame, of a frame."""
        return markers(self.body, self.pose(index))

    def subject(self) -> Subject:
        """The person's segment lengths."""
        return Subject(f"scene {self.seed}", dict(self.spec.person.lengths_m))

    def start(self, body: str = "person31", index: int = 0) -> tuple[BodyModel, FloatArray] | None:
        """A tracker's body with the person's lengths and its pose (p,) nearest to the markers.

        None where a marker is further than 3 cm off: the spine bends as that body's cannot.
        """
        model = build_body(load_description(body), self.subject())
        truth = self.markers(index)
        pose = pose_from_markers(model, dict(zip(MARKER_NAMES, truth, strict=True)))
        off = np.linalg.norm(markers(model, pose) - truth, axis=1)
        return (model, pose) if off.max() <= _START_TOLERANCE_M else None

    def frame(self, index: int) -> tuple[dict[str, Image], dict[str, Mask], FloatArray]:
        """Images (h, w, 3) or (h, w) and exact masks (h, w) by camera, and the true pose (p,)."""
        pose = self.pose(index)
        surface = self.person.posed(pose)
        shift = len(surface.vertices)
        solid = Triangles(
            np.concatenate([surface.vertices, self._furniture.vertices]),
            np.concatenate([surface.triangles, self._furniture.triangles + shift]),
        )
        person = np.arange(len(solid.triangles)) < len(surface.triangles)
        colours = np.concatenate([self._colours, self._wood])
        images, masks = {}, {}
        exposure = self._exposure * self._drift(index / self.fps)
        for number, (name, (picture, mask)) in enumerate(self._seen(solid, colours, person)):
            rng = np.random.default_rng([self.seed, _PERSON, number, index])
            images[name], masks[name] = self._views[name].taken(picture, rng, exposure), mask
        return images, masks, pose

    def backgrounds(self, count: int) -> dict[str, list[Image]]:
        """That many images of the empty room by camera."""
        no_person = np.zeros(len(self._furniture.triangles), dtype=np.bool_)
        seen = self._seen(self._furniture, self._wood, no_person)
        return {
            name: [
                self._views[name].taken(
                    picture, np.random.default_rng([self.seed, _EMPTY, number, i]), self._exposure
                )
                for i in range(count)
            ]
            for number, (name, (picture, _)) in enumerate(seen)
        }

    def values(self) -> dict[str, Any]:
        """All sampled values, plain."""
        return self.spec.values()

    @property
    def _wood(self) -> FloatArray:
        return np.tile(_CHAIR, (len(self._furniture.vertices), 1))

    def _seen(
        self, solid: Triangles, paint: FloatArray, person: Mask
    ) -> Iterator[tuple[str, tuple[NDArray[np.float32], Mask]]]:
        """By camera the light (h, w, 3) at its lens and the person's mask (h, w)."""
        hidden = self._lighting.hidden(solid)
        colours = paint * self._lighting.on_solid(solid) if len(paint) else paint
        for name, view in self._views.items():
            yield name, view.light_on(hidden, solid, colours, person)

    def _painted(self) -> FloatArray:
        """Colours (k, 3) of the person's vertices, matched at some times of the motion."""
        poses = [self.motion.pose(time_s) for time_s in _MATCHED_S]
        hips = np.array([markers(self.body, p)[MARKER_NAMES.index("Pelvis")] for p in poses])
        light = part_light(self.person, self._lighting, list(self._views.values()), poses)
        palette = part_colours(self.spec, self._lighting, light, hips * [1.0, 1.0, 0.0])
        return vertex_colours(self.spec, self.person, palette)

    def _drift(self, time_s: float) -> float:
        sensor = self.spec.sensor
        return 1.0 + sensor.drift * float(np.sin(2.0 * np.pi * time_s / sensor.drift_s + 0.5))

    def _chair(self) -> Triangles:
        """A chair under the hips of the person in frame 0."""
        pose = self.pose(0)
        surface = self.person.posed(pose)
        hips = markers(self.body, pose)[MARKER_NAMES.index("Pelvis")]
        near = np.linalg.norm(surface.vertices[:, :2] - hips[:2], axis=1) < 0.12
        cloth = surface.part == PARTS.index("lower")
        seat = float(surface.vertices[near & cloth, 2].min()) + 0.005
        heading = float(pose[self.body.index("pelvis_rz")])
        return Triangles(*chair(seat, (float(hips[0]), float(hips[1])), heading))


_NOTHING = Triangles(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
