"""What is to be done: commands, knowledge of the world, missions and their files."""
