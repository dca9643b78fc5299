"""The demo (``python -m markerless_tracker.cli.demo``): tracks a person live over ROS 2."""
