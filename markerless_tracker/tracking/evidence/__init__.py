"""From views to the evidence of the tracked person.

Segmentation around the prediction, choice of components, views that cannot be right.
"""
