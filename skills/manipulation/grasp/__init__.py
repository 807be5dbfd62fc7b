"""The grasp skill."""
