"""No success on old data: what a skill declares in `max_data_age_s` is checked when it says that it succeeded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from executive.tree.behaviours.context import RunContext
from skills.api import Cause, Failed, Skill, Succeeded

_TOLERANCE_S = 1e-6


class Remembered(Succeeded):
    """A success from before a restart: its data was fresh then."""


def refuse_stale(skill: type[Skill[Any]], success: Succeeded, context: RunContext) -> Succeeded | Failed:
    """The success, or a failed postcondition when data that it rests on is older than the skill allows."""
    if isinstance(success, Remembered):
        return success
    for source, most_s in skill.max_data_age_s.items():
        stamp_s = _stamp_s(source, success.outputs, context)
        if stamp_s is None:
            return Failed(Cause.POSTCONDITION, f"{skill.name} cannot be sure: there is no {source} data")
        age_s = context.clock.now() - stamp_s
        if age_s > most_s + _TOLERANCE_S:
            why = f"its {source} data is {age_s:.1f} s old, more than {most_s:g} s"
            return Failed(Cause.POSTCONDITION, f"{skill.name} cannot be sure: {why}")
    return success


def _stamp_s(source: str, outputs: Mapping[str, Any], context: RunContext) -> float | None:
    """When the data was taken: an output port's value, the place estimate, or a sense verb that does not block."""
    if source in outputs:
        return float(outputs[source].stamp_s)
    if source == "localisation":
        return context.localiser.estimate().stamp_s
    reading = getattr(context.robot, source)()
    return None if reading is None else float(reading.stamp_s)
