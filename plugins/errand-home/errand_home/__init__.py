"""Household tasks, a world, its objects and facts: commands of RoboCup@Home."""
