"""What is counted of each camera.

Filled by the synchronizer, reported in `state`.
"""
