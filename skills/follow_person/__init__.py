"""The follow_person skill: keeps behind a walking person."""
