"""Images of one camera or of several, from video files or numbered images.

Decoding side by side, frame rates and stamps.
"""
