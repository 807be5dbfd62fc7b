"""The skills by name. An explicit tuple for now: the compiler and the tests read it, nothing adds to it."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from skills.api import Skill
from skills.approach.skill import Approach
from skills.detect.skill import Detect
from skills.grasp.skill import Grasp
from skills.hand_over.skill import HandOver
from skills.navigate.skill import Navigate
from skills.place.skill import Place
from skills.stow.skill import Stow

SKILL_CLASSES: tuple[type[Skill[Any]], ...] = (Approach, Detect, Grasp, HandOver, Navigate, Place, Stow)

SKILLS: Mapping[str, type[Skill[Any]]] = MappingProxyType({skill.name: skill for skill in SKILL_CLASSES})
