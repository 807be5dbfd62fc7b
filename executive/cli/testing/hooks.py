"""Hooks that a conftest.py may implement for the plug-in."""

from __future__ import annotations

from typing import Any


def pytest_errand_skill_tests(settings: Any) -> None:
    """Change what all skill tests of the session share, before the first is collected.

    `settings` is an `executive.testing.collect.SkillTestSettings`: append to `fault_kinds`, add to `skills`, put other
    benches into `makers`.
    """
