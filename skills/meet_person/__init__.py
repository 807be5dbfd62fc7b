"""The meet_person skill: goes beside a person."""
