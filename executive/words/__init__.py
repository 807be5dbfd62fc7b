"""Words: commands, knowledge, conditions, goals, steps. Plain data that every other package may import."""
