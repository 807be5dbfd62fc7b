"""The approach skill, and base placements, which other skills share."""
