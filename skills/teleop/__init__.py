"""Teleoperation of body and arm."""
