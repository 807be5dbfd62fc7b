"""Estimators: localisation and costmaps from the robot's sensors."""
