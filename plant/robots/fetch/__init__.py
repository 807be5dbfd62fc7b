"""The simulated Fetch: wheels, lift, head, arm, gripper and sensors behind the Robot protocol."""
