"""Contour residuals and their normal equations.

Model outline points against the silhouette's signed distance.
"""
