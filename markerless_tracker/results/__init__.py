"""Runs over recordings, results on disk and their scores, for `track`, `evaluate` and the node."""
