"""How a body moves: leg kinematics, the trot, and the planar floating base that bears the body for now."""
