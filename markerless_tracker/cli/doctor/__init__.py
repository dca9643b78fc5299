"""Verb `doctor`: what is wrong with this machine, its ROS graph and its cameras.

`verb` has its arguments and what it prints.
"""

from markerless_tracker.cli.doctor.verb import EXAMPLE, HELP, add_arguments, run

__all__ = ["EXAMPLE", "HELP", "add_arguments", "run"]
