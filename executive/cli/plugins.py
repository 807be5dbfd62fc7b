"""The installed skills as commands use them: what cannot be used is reported once, and harms nothing else."""

from __future__ import annotations

from functools import cache

import typer

from executive.tree.registry import SkillRegistry, installed_skills


def usable_skills() -> SkillRegistry:
    """The installed skills. Raises InputError as `installed_skills` does."""
    skills = installed_skills()
    for error in skills.broken.values():
        _report(str(error))
    return skills


@cache
def _report(warning: str) -> None:
    """One line on standard error, once in a process."""
    typer.echo(f"errand: warning: {warning}", err=True)
