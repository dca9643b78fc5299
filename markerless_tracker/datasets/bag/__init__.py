"""Reading MCAP bags (rosbag2) without ROS.

Messages in file order, image encodings, camera infos.
"""
