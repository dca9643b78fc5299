"""The body of this person: sections and lengths found while tracking.

From the first frame, and from the first tracked frames together.
"""
