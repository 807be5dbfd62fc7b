"""A mission's goal conditions in the referee's words, as its tree compiled them and its run left them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from py_trees.common import Status

from executive.mission.goal import Area, GoalCondition, GoalKind
from executive.run.outcome import Outcome, RobotResult
from executive.tree.compiler import CompiledTree, StepPart
from executive.tree.node import NodeSpec
from plant import referee
from skills.files.errors import listing
from skills.speak.skill import Speak


@dataclass(frozen=True)
class Share:
    """What another robot did of a mission before it was handed on: the first `done` parts of its tree."""

    tree: CompiledTree
    result: RobotResult
    done: int


def verdict_of(
    tree: CompiledTree,
    result: RobotResult,
    judge: Callable[[Sequence[referee.GoalCondition]], referee.Verdict],
    *,
    before: Sequence[Share] = (),
    since_s: float = 0.0,
) -> referee.Verdict:
    """The verdict on a tree that has run; `judge` is the referee's, on the goal conditions.

    A run that did not end with success has not fulfilled its mission, whatever holds. One with a step that has no goal
    condition is not judged, unless a condition of another step does not hold. What other robots did `before` belongs to
    the mission as well, and what happened before `since_s` (simulated time) does not.
    """
    shares = [condition for share in before for condition in _of_parts(share.tree, share.result, _parts_of(share))]
    conditions = [*shares, *conditions_of(tree, result)]
    verdict = judge([replace(condition, since_s=since_s) for condition in conditions])
    without = [part for part in _done(tree, result) if part.goal is None]
    if result.outcome is not Outcome.SUCCESS:
        why = _joined(f"The mission ended with {result.outcome.value}.", verdict.why)
        return replace(verdict, success=False, why=why, holds=verdict.success)
    if verdict.success is False or not (without or verdict.success is None):
        return verdict
    names = {node.path_id: node.name for node in tree.root.walk()}
    steps = listing(dict.fromkeys(names.get(part.path_id, part.path_id) for part in without))
    missing = f"No goal condition stands for {steps}." if without else "There are no goal conditions."
    return replace(verdict, success=None, why=_joined(missing, verdict.why))


def conditions_of(tree: CompiledTree, result: RobotResult) -> tuple[referee.GoalCondition, ...]:
    """The goal conditions of a tree that has run: of all its parts that were done.

    A count is one condition, however many trips it takes; an answer belongs to the check that gave it; what comes
    before a step without condition needs to have been so at some time only, and so does where a robot went that stepped
    aside for another afterwards.
    """
    return _of_parts(tree, result, _done(tree, result))


def _parts_of(share: Share) -> Sequence[StepPart]:
    return [part for part in share.tree.parts[: share.done] if part.skill is not Speak]


def _of_parts(tree: CompiledTree, result: RobotResult, parts: Sequence[StepPart]) -> tuple[referee.GoalCondition, ...]:
    found: list[referee.GoalCondition] = []
    for n, part in enumerate(parts):
        if part.goal is None:
            continue
        below = f"{part.path_id}/"
        path = next((path for path in result.answers if f"{path}/".startswith(below)), "")
        times_s = [finding.t_s for finding in result.findings if finding.path_id == path]
        condition = condition_of(part.goal, robot=tree.robot_name, answer=result.answers.get(path))
        condition = replace(condition, answered_s=times_s[-1] if times_s else None)
        was = result.stepped_aside and part.goal.kind is GoalKind.WENT
        found.append(replace(condition, passing=was or any(later.goal is None for later in parts[n + 1 :])))
    return tuple(found)


def _done(tree: CompiledTree, result: RobotResult) -> list[StepPart]:
    """The parts that were done. Of a mission that succeeded, what failed or was not begun was not called for: it was
    skipped, stands in a branch that was not taken, or something else was done in its place; so was what stands below
    a node that failed. What was only said leaves nothing in the world to judge."""
    parts = [part for part in tree.parts if part.skill is not Speak]
    if result.outcome is not Outcome.SUCCESS:
        return parts
    statuses = {path: state.status for path, state in result.states.items()}
    done = frozenset(_done_below(tree.mission, statuses))
    return [part for part in parts if (part.node or part.path_id) in done]


def _done_below(node: NodeSpec, statuses: Mapping[str, Status]) -> Iterator[str]:
    """The path ids of nodes that succeeded, without those below one that failed."""
    status = statuses.get(node.path_id)
    if status is Status.SUCCESS:
        yield node.path_id
    if status is not Status.FAILURE:
        for child in node.children:
            yield from _done_below(child, statuses)


def _joined(*sentences: str) -> str:
    return " ".join(filter(None, sentences))


def condition_of(condition: GoalCondition, *, robot: str, answer: bool | None) -> referee.GoalCondition:
    """One condition in the referee's words."""
    return referee.GoalCondition(
        kind=referee.GoalKind[condition.kind.name],
        classes=condition.classes,
        count=condition.count,
        source=tuple(map(_region, condition.source)),
        goal=tuple(map(_region, condition.goal)),
        person=condition.person,
        wanted=condition.wanted,
        answer=answer,
        robot=robot,
    )


def _region(area: Area) -> referee.Region:
    return referee.Region(area.name, area.polygon, *(area.heights_m or ()))
