"""The skills that use the arm, and the arm that they share: motion, collisions, poses, gaze, holding."""
