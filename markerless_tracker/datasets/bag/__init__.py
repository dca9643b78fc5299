"""Reading MCAP bags (rosbag2) without ROS.

Messages in file order, sets of one stamp, image encodings, camera infos.
"""
