"""A synthetic person in front of synthetic cameras, frame by frame, with the exact truth.

Images and truth come from the model that a tracker fits: errors measured on them show that the
parts work together, and say nothing about accuracy on people.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from markerless_tracker.body import BodyModel, Subject, load_body, markers
from markerless_tracker.camera import CameraRig
from markerless_tracker.errors import ConfigError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.synthesis.mesh import body_mesh
from markerless_tracker.synthesis.motion import Motion
from markerless_tracker.synthesis.render import Image, Look, Mask, Renderer, clothes, dull_clothes
from markerless_tracker.synthesis.rig import MILD_LENS, check_cameras, check_range, ring_rig
from markerless_tracker.synthesis.room import room_picture
from markerless_tracker.synthesis.threads import side_by_side

LIGHTS: Mapping[str, Callable[[float], float]] = {
    "steady": lambda time_s: 1.0,
    "drift": lambda time_s: 1.0 + 0.2 * float(np.sin(0.2 * np.pi * time_s)),
    "step": lambda time_s: 1.0 if time_s < 1.0 else 1.3,
}
"""Brightness of everything by time in s."""

_ROOM_M = 7.0
# Keeps the noise of empty frames apart from that of frames with the person.
_PERSON, _EMPTY = 3, 4


class SyntheticScene:
    """A person, a motion, a rig and a room; everything depends on the arguments alone.

    Args:
        body: a body's name or file, or a body that is already built.
        stature_m: height of the person, unless the body is built.
        motion: walk, balance, jog or stand.
        cameras: number of cameras, cam01.. .
        size_px: (width, height) of every image.
        fps: frames per second; frame i has stamp round(i * 1e9 / fps).
        seed: of motion, room, clothes and noise.
        noise: standard deviation of the sensor's noise in grey levels.
        shadow: part of the light that the person's shadow on the floor takes away.
        samples: samples per pixel in each direction.
        distortion: lens k1 k2 p1 p2 (k3), zeros for none.
        light: steady; drift: brightness swings by 20 % in 10 s; step: 30 % more from 1 s on.
            Pictures of the empty room are taken in steady light.
        grey: grey cameras: images are (h, w).
        dull: clothes as bright as the background, within 10 %, and without colour.

    Raises:
        ConfigError: an argument is impossible; the message names it.
        BodyModelError: no such body, or an impossible stature.
    """

    def __init__(
        self,
        *,
        body: str | BodyModel = "balan31",
        stature_m: float = 1.72,
        motion: str = "walk",
        cameras: int = 4,
        size_px: tuple[int, int] = (656, 490),
        fps: float = 60.0,
        seed: int = 0,
        noise: float = 3.0,
        shadow: float = 0.35,
        samples: int = 3,
        distortion: Sequence[float] = MILD_LENS,
        light: str = "steady",
        grey: bool = False,
        dull: bool = False,
    ) -> None:
        check_cameras(cameras, size_px, fps, seed, noise)
        check_range("shadow", shadow, 0.0, 1.0)
        check_range("samples", samples, 1, 8)
        if len(distortion) not in (4, 5) or not np.isfinite(distortion).all():
            raise ConfigError(
                f"distortion has {len(distortion)} coefficients, expected finite k1 k2 p1 p2 (k3)"
            )
        if light not in LIGHTS:
            raise ConfigError(f"light is {light!r}, expected one of {', '.join(LIGHTS)}")
        self._light = LIGHTS[light]
        self.body = body if isinstance(body, BodyModel) else load_body(body, stature_m)
        self.rig: CameraRig = ring_rig(cameras, size_px, distortion=tuple(distortion))
        self.fps = float(fps)
        self.seed = seed
        self.motion = Motion(self.body, motion, seed)
        look = Look(noise=noise, shadow=shadow, samples=samples, grey=grey)
        mesh, rng = body_mesh(self.body), np.random.default_rng([seed, 0])
        rooms = {camera.name: room_picture(camera, _ROOM_M, seed) for camera in self.rig}
        if dull:
            brightness = float(np.mean([picture.mean() for picture in rooms.values()]))
            palette = dull_clothes(self.body, rng, brightness)
        else:
            palette = clothes(self.body, rng)
        self._renderers = {
            camera.name: Renderer(
                self.body, camera, rooms[camera.name], palette, look=look, mesh=mesh
            )
            for camera in self.rig
        }

    def stamp_ns(self, index: int) -> int:
        """Stamp of a frame."""
        return round(index * 1e9 / self.fps)

    def pose(self, index: int) -> FloatArray:
        """True pose (p,) of a frame."""
        return self.motion.pose(index / self.fps)

    def markers(self, index: int) -> FloatArray:
        """True markers (15, 3) in m, world frame, of a frame."""
        return markers(self.body, self.pose(index))

    def subject(self) -> Subject:
        """The person's segment lengths."""
        return Subject("made up", self.body.lengths_m)

    def start(self) -> tuple[BodyModel, FloatArray]:
        """The body and its true pose (p,) in frame 0."""
        return self.body, self.pose(0)

    def frame(self, index: int) -> tuple[dict[str, Image], dict[str, Mask], FloatArray]:
        """Images (h, w, 3) or (h, w) and exact masks (h, w) by camera, and the true pose (p,)."""
        pose = self.pose(index)
        light = self._light(index / self.fps)

        def view(numbered: tuple[int, str]) -> tuple[Image, Mask]:
            number, name = numbered
            rng = np.random.default_rng([self.seed, _PERSON, number, index])
            return self._renderers[name].render(pose, rng, light=light)

        names = list(self._renderers)
        views = dict(zip(names, side_by_side(view, list(enumerate(names))), strict=True))
        images = {name: image for name, (image, _) in views.items()}
        return images, {name: mask for name, (_, mask) in views.items()}, pose

    def backgrounds(self, count: int) -> dict[str, list[Image]]:
        """That many pictures of the empty room by camera."""
        return {
            name: [
                renderer.empty(np.random.default_rng([self.seed, _EMPTY, number, i]))
                for i in range(count)
            ]
            for number, (name, renderer) in enumerate(self._renderers.items())
        }
