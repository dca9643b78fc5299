"""The verdict of a run: what happened, what is doubtful about it, and where to look next.

`RunRecord` takes the frames, `verdict_of` draws the conclusions.
"""
