"""Arm kinematics, collision checks and motion planning, shared by the manipulation skills."""
