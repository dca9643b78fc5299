"""Verb `doctor`: finds problems of this machine, its ROS graph and its cameras.

`verb` has its arguments and its output.
"""

from markerless_tracker.cli.doctor.verb import EXAMPLE, HELP, add_arguments, run

__all__ = ["EXAMPLE", "HELP", "add_arguments", "run"]
