"""Estimators: immutable snapshots of where the robot is and what stands around it, made from its sensors."""
