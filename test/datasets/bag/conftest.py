"""Bags as other tools write them."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from markerless_tracker.camera import CameraRig

STORE = get_typestore(Stores.ROS2_JAZZY)
IMAGE, INFO, TF = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo", "tf2_msgs/msg/TFMessage"
COMPRESSED = "sensor_msgs/msg/CompressedImage"
STEP_NS = 50_000_000
FRAME = np.random.default_rng(5).integers(0, 256, (48, 64, 3), dtype=np.uint8)


def make(kind: str, **fields):
    return STORE.types[kind](**fields)


def header(stamp_ns: int, frame: str = "x"):
    time = make("builtin_interfaces/msg/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return make("std_msgs/msg/Header", stamp=time, frame_id=frame)


def image(stamp_ns: int, pixels: np.ndarray = FRAME, encoding: str = "bgr8"):
    return make(
        IMAGE,
        header=header(stamp_ns),
        height=pixels.shape[0],
        width=pixels.shape[1],
        encoding=encoding,
        is_bigendian=0,
        step=pixels[0].size,
        data=np.ascontiguousarray(pixels).reshape(-1),
    )


def save(path: Path, messages, *, rig_of: Path | None = None) -> Path:
    """Writes (topic, type, message) triples as a bag, with a calibration beside it if given."""
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {}
        for number, (topic, kind, message) in enumerate(messages):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(connections[topic], number, STORE.serialize_cdr(message, kind))
    if rig_of is not None:
        shutil.copy(rig_of / "calibration.toml", path)
    return path


def both(stamp_ns: int, **kwargs):
    return [(f"/{name}/image_raw", IMAGE, image(stamp_ns, **kwargs)) for name in ("cam01", "cam02")]


def info(name: str, rig: CameraRig, **changes):
    camera = rig[name]
    fields = {
        "header": header(0, f"{name}_optical_frame"),
        "height": camera.size_px[1],
        "width": camera.size_px[0],
        "distortion_model": "plumb_bob",
        "d": camera.distortion.copy(),
        "k": camera.matrix.reshape(-1).copy(),
        "r": np.eye(3).reshape(-1),
        "p": np.zeros(12),
        "binning_x": 0,
        "binning_y": 0,
        "roi": make(
            "sensor_msgs/msg/RegionOfInterest",
            x_offset=0,
            y_offset=0,
            height=0,
            width=0,
            do_rectify=False,
        ),
    }
    return (f"/{name}/camera_info", INFO, make(INFO, **{**fields, **changes}))


def static(parent: str, child: str, translation, quaternion=(1.0, 0.0, 0.0, 0.0)):
    w, x, y, z = quaternion
    tx, ty, tz = translation
    return make(
        "geometry_msgs/msg/TransformStamped",
        header=header(0, parent),
        child_frame_id=child,
        transform=make(
            "geometry_msgs/msg/Transform",
            translation=make("geometry_msgs/msg/Vector3", x=tx, y=ty, z=tz),
            rotation=make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w),
        ),
    )


def frames_message(*transforms):
    return ("/tf_static", TF, make(TF, transforms=list(transforms)))


@pytest.fixture
def bag(make_recording, tmp_path: Path) -> Callable[..., Path]:
    rig = make_recording()
    return lambda messages, name="bag": save(tmp_path / name, messages, rig_of=rig)
