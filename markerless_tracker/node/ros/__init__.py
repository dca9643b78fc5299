"""ROS code shared by both nodes: messages, images, camera info, QoS, stamps, parameters, logs.

Independent of the tracker and the player.
"""
