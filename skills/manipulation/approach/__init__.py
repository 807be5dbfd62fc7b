"""The approach skill, and the base placements that other skills share."""
