"""Skills: what a robot can do, seen only through `skills.robot`."""
