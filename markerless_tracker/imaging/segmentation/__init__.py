"""From one image to the silhouette of the person.

Foreground test, shadow test, morphology and the border of the silhouette.
"""
