"""``python -m markerless_tracker.cli.demo``: a person tracked live over ROS 2, end to end."""
