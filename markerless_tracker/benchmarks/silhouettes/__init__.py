"""Quality of silhouettes against exact masks or a reference pose.

OpenCV's background subtractors are measured for comparison.
"""
