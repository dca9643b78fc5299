"""Images of one camera or of several, from video files or numbered images.

Parallel decoding, frame rates and stamps.
"""
