"""The wire protocol of rmw_zenoh: key expressions, type hashes, nodes and actions, without ROS 2 installed."""
