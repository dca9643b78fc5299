"""Passes of `track` over a recording: the first one fits the body, the second tracks with it."""
