"""Verb `batch`: tracks many recordings, and writes their results and one summary table.

A trial is the tracking of one recording. Trials run in parallel processes or on a cluster.
"""

from markerless_tracker.cli.batch.verb import EXAMPLE, HELP, add_arguments, run

__all__ = ["EXAMPLE", "HELP", "add_arguments", "run"]
