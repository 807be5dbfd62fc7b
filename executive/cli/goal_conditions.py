"""A mission's goal conditions in the referee's words, as its tree compiled them and its run left them."""

from __future__ import annotations

from executive.mission.goal import Area, GoalCondition
from executive.run.outcome import RobotResult
from executive.tree.compiler import CompiledTree
from plant import referee


def conditions_of(tree: CompiledTree, result: RobotResult) -> tuple[referee.GoalCondition, ...]:
    """The goal conditions of a tree that has run: of all its parts but those that its own result tells were skipped.

    A count is one condition, however many trips it takes; an answer belongs to the check that gave it.
    """
    found: list[referee.GoalCondition] = []
    for part in tree.parts:
        if part.goal is None or part.was_skipped({path: state.status for path, state in result.states.items()}):
            continue
        below = f"{part.path_id}/"
        answers = (answer for path, answer in result.answers.items() if f"{path}/".startswith(below))
        found.append(condition_of(part.goal, robot=tree.robot_name, answer=next(answers, None)))
    return tuple(found)


def condition_of(condition: GoalCondition, *, robot: str, answer: bool | None) -> referee.GoalCondition:
    """One condition in the referee's words."""
    return referee.GoalCondition(
        kind=referee.GoalKind[condition.kind.name],
        classes=condition.classes,
        count=condition.count,
        source=tuple(map(_region, condition.source)),
        goal=tuple(map(_region, condition.goal)),
        person=condition.person,
        answer=answer,
        robot=robot,
    )


def _region(area: Area) -> referee.Region:
    return referee.Region(area.name, area.polygon, *(area.heights_m or ()))
