"""Runs over recordings, results on disk and their score.

What `track`, `evaluate` and the node need.
"""
