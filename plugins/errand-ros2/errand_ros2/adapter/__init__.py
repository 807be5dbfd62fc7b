"""Adapter: a robot of ROS 2 behind the robot protocol."""
