"""The world of a recording turned upright, in metres: by an axis that is named, or by the recording
itself.
"""
