"""The pose_arm skill."""
