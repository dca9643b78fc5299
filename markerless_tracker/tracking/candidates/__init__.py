"""Poses that are tried in one frame, by the automatic start and by the searches for limbs.

They come from known postures, from mirrored, turned and exchanged limbs, and from each other. They
are refined and compared together.
"""
