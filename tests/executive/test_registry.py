"""The skills that come with the project."""

import dataclasses

from executive.registry import built_in_skills


def test_skills_are_found_by_name_with_typed_ports():
    skills = built_in_skills()
    assert {"navigate", "detect", "approach", "grasp", "place", "hand_over", "stow"} <= set(skills)
    assert all(name == skill.name and dataclasses.is_dataclass(skill.Inputs) for name, skill in skills.items())
