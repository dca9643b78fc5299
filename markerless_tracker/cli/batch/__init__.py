"""Verb `batch`: many recordings to results and one summary table.

Finding the recordings, doing a trial, processes and clusters that do them, the table.
"""

from markerless_tracker.cli.batch.verb import EXAMPLE, HELP, add_arguments, run

__all__ = ["EXAMPLE", "HELP", "add_arguments", "run"]
