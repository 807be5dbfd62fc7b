"""Simulated robots: command table, servos, sensors and lease behind the Robot protocol, and a folder for each kind."""
