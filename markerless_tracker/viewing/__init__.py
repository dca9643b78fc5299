"""Pictures of a run for people.

Files with the evidence and the body of every frame.
"""
