"""The guide_person skill: goes ahead of a person to a place."""
