"""What is counted of each camera.

Filled by the synchronizer, told in `state`.
"""
