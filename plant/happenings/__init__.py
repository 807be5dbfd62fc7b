"""What happens in a world whatever the robot does: doors that close and open, objects that somebody moves."""
