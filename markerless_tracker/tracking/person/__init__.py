"""The body of the tracked person: sections and lengths fitted while tracking.

They are fitted to the first frame, to the first tracked frames, and to later frames.
"""
