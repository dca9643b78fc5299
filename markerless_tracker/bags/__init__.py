"""Writing recordings as bags: MCAP rosbag2, without ROS."""

from markerless_tracker.bags.write import COMPRESSIONS, BagSummary, write_bag

__all__ = ["COMPRESSIONS", "BagSummary", "write_bag"]
