"""Quality of silhouettes against exact masks or a reference pose.

Beside the background subtractors of OpenCV.
"""
