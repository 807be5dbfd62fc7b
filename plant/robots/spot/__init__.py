"""The simulated Spot: floating base, legs, arm, gripper and sensors behind the Robot protocol."""
