from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from rclpy.serialization import deserialize_message, serialize_message

from markerless_tracker.node.ros.messages import header
from markerless_tracker.node.ros.transforms import TransformMessages

STAMP_NS = 1_700_000_000_123_456_789


@pytest.mark.parametrize("count", [1, 5])
def test_the_bytes_are_read_as_the_message(tf2_msgs: Any, count: int) -> None:
    from tf2_msgs.msg import TFMessage

    rng = np.random.default_rng(count)
    frames = [(f"{'m' * k}ap", f"pelvis{'_' * (3 * k)}") for k in range(count)]
    moved, turned = rng.normal(size=(count, 3)), rng.normal(size=(count, 4))
    message = TFMessage()
    for (parent, child), t, (w, x, y, z) in zip(
        frames, moved.tolist(), turned.tolist(), strict=True
    ):
        transform = Transform(
            translation=Vector3(x=t[0], y=t[1], z=t[2]), rotation=Quaternion(x=x, y=y, z=z, w=w)
        )
        message.transforms.append(
            TransformStamped(
                header=header(STAMP_NS, parent), child_frame_id=child, transform=transform
            )
        )
    messages = TransformMessages(frames)
    messages.serialised(5, turned[:, :3], turned)
    found = messages.serialised(STAMP_NS, moved, turned)
    assert deserialize_message(found, TFMessage) == message
    assert len(found) == len(serialize_message(message))
