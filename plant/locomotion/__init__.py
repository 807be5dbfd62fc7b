"""How a body moves: leg kinematics, the trot, and the carrier that bears the body for now."""
