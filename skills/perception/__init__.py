"""What the robot makes of its pictures and scans: objects with a place, surfaces, people."""
