"""Sentences said to several robots: what is for which of them, and what has to wait for what."""

from executive.language.robots.meaning import Addressed, Part, Whom, understand_for_robots, understand_for_robots_asking

__all__ = ["Addressed", "Part", "Whom", "understand_for_robots", "understand_for_robots_asking"]
