"""ROS code shared by all nodes: messages, images, camera info, QoS, stamps, parameters, logs."""
