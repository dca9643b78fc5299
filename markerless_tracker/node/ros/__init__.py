"""What both nodes need of ROS: messages, images, camera info, QoS, stamps, parameters.

Nothing here knows the tracker or the player.
"""
