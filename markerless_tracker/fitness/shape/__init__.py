"""Lengths and sections of the body, fitted to silhouettes.

With the pose held, or together with the poses of several frames.
"""
