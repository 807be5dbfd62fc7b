"""ROS 2 bags of Errand's logs."""
