"""Finding out where the robot is when it has lost its place."""
