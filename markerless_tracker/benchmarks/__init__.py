"""The laboratory: measured accuracy and speed on recordings.

Nothing that `track` or the nodes need.
"""
