"""The find_people skill: looks for people around the robot."""
