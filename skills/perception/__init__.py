"""What the robot makes of its pictures and scans: things with a place, surfaces, people."""
