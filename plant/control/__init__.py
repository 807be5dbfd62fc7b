"""What every simulated robot has behind the Robot protocol: command book, lease, and the servos of arm and gripper."""
