"""ROS 2 for Errand: runs and robots on its network, and bags of logs."""
