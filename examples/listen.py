"""A ROS 2 node that listens to the tracker's topic `marker_poses`.

    python examples/listen.py       # beside a tracker in another terminal (README, "Live")

Each message has the 15 markers in the order of `MARKER_NAMES`, in metres, in the frame `map`, with
the stamp of the images. `--count N` ends the node after N messages.
"""

import argparse

import rclpy
from geometry_msgs.msg import PoseArray
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from markerless_tracker import MARKER_NAMES


class Listener(Node):
    """Prints the height of both wrists above the floor."""

    def __init__(self) -> None:
        super().__init__("listener")
        self.received = 0
        self.create_subscription(PoseArray, "marker_poses", self.take, 10)

    def take(self, message: PoseArray) -> None:
        """Receive the markers of one set of images."""
        positions = {
            name: pose.position for name, pose in zip(MARKER_NAMES, message.poses, strict=True)
        }
        left, right = positions["LWrist"].z, positions["RWrist"].z
        stamp = message.header.stamp
        print(f"{stamp.sec}.{stamp.nanosec:09d} left {left:.3f} m, right {right:.3f} m", flush=True)
        self.received += 1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=0, help="0 (default) = until interrupted")
    args, ros_arguments = parser.parse_known_args()

    rclpy.init(args=ros_arguments)
    node = Listener()
    try:
        while not args.count or node.received < args.count:
            rclpy.spin_once(node, timeout_sec=0.1)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
