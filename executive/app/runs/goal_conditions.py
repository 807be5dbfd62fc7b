"""Judges an ended mission by its goal conditions, each at its own times in the run, and by its speech."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from executive.run.mission_history import is_speech, looks_of
from executive.run.outcome import Execution, Outcome, RobotResult
from executive.tree.board import FromBoard
from executive.tree.compiler import CompiledTree
from executive.tree.plan import StepPart
from executive.words.expression import Expression, Template
from executive.words.goal import GoalCondition, GoalKind, RefereeReport, When
from executive.words.task import Part, task_named
from skills.inputs.errors import listing

SHOWN_CHARS = 60
_ENDED = {Outcome.FAILURE: "failed", Outcome.CANCELLED: "was cancelled", Outcome.ERROR: "was ended by a defect"}
_MOVING = frozenset({GoalKind.GRASPED, GoalKind.PLACED, GoalKind.HANDED_OVER, GoalKind.CLEARED})


@dataclass(frozen=True)
class Share:
    """Part of a mission that another robot did, before this robot or at the same time.

    The first `done` steps are judged with the mission; objects that the robot moved count as moved by the mission.
    """

    tree: CompiledTree
    result: RobotResult
    done: int


@dataclass(frozen=True)
class _Move:
    """Interval of time in which a robot moved objects of these classes as its task; no classes stand for any class."""

    classes: frozenset[str]
    from_s: float
    until_s: float

    def concerns(self, goal: GoalCondition) -> bool:
        """Returns whether the robot may have moved an object that a goal condition is about."""
        return not self.classes or not goal.classes or not self.classes.isdisjoint(goal.classes)


def verdict_of(
    tree: CompiledTree,
    result: RobotResult,
    judge: Callable[[Sequence[GoalCondition]], RefereeReport],
    *,
    before: Sequence[Share] = (),
    since_s: float = 0.0,
) -> RefereeReport:
    """Returns the verdict on an ended tree; `judge` is the referee, which judges goal conditions.

    A failed run has not fulfilled its mission, even if the goal conditions hold. A successful run is judged by its goal
    conditions, answers and speech; the verdict names the steps that cannot be judged. `before` are the parts of the
    mission that other robots did; events before `since_s` (simulated time) are ignored.
    """
    conditions = conditions_of(tree, result, before=before)
    verdict = judge([replace(condition, since_s=since_s) for condition in conditions])
    if result.outcome is not Outcome.SUCCESS:
        why = _joined(f"The mission {_ENDED[result.outcome]}.", verdict.why)
        lost = bool(conditions) and verdict.success is None  # by the simulation
        return replace(verdict, success=None if lost else False, why=why, holds=verdict.success)
    said = dict.fromkeys(_speech(tree, result))
    if said:
        failed = not all(holds for holds, _ in said)
        success = False if failed else verdict.success if conditions else True
        verdict = replace(verdict, success=success, why=_joined(verdict.why, *(sentence for _, sentence in said)))
    unseen = listing(_unseen(tree, result)) if _unseen(tree, result) else ""
    if verdict.success is None and not conditions:
        nothing = f"No goal condition stands for {unseen}." if unseen else "There are no goal conditions."
        return replace(verdict, why=_joined(nothing, verdict.why))
    return replace(verdict, why=_joined(verdict.why, f"Not judged: {unseen}." if unseen else ""))


def _unseen(tree: CompiledTree, result: RobotResult) -> Sequence[str]:
    """Returns the names of the executed skills for which there is no goal condition."""
    done = {one.path_id for one in result.executions if one.done}
    names = {node.path_id: node.name for node in tree.root.walk() if not is_speech(node)}
    paths = [_node_of(part) for part in tree.parts if part.goal is None and part.skill is not None]
    return list(dict.fromkeys(names[path] for path in paths if path in done and path in names))


def conditions_of(
    tree: CompiledTree, result: RobotResult, *, before: Sequence[Share] = ()
) -> tuple[GoalCondition, ...]:
    """Returns the goal conditions of an ended tree: one for each execution of a step, and one for each answer.

    When the mission did not succeed, a step is judged by its executions that ended well, or else by its last one. A
    count of objects is one condition for all trips. The place of a robot must hold until the robot drives again; the
    place or holder of an object must hold until the mission moves such an object again.
    """
    shares = (*before, Share(tree, result, len(tree.parts)))
    moves = [move for share in shares for move in _moves(share)]
    return tuple(each for share in shares for each in _conditions_of_share(share, moves, last=share is shares[-1]))


def _conditions_of_share(share: Share, moves: Sequence[_Move], *, last: bool) -> Iterator[GoalCondition]:
    """Yields the goal conditions of the part that one robot did."""
    result = share.result
    for part in share.tree.parts[: share.done]:
        if part.goal is None:
            continue
        condition = replace(part.goal, robot=share.tree.robot_name)
        own = [one for one in result.executions if one.path_id == _node_of(part)]
        failed = own if result.outcome is not Outcome.SUCCESS else []
        executions = [one for one in own if one.done] or [one for one in failed if one.succeeded] or failed[-1:]
        if part.goal.kind in (GoalKind.ANSWERED, GoalKind.DOOR_OPEN):
            yield from _answers(part, condition, result, own)
            continue
        if not executions and result.outcome is not Outcome.SUCCESS:
            yield condition
        for one in executions:
            yield _timed(condition, one, share, moves, last=last)


def _answers(
    part: StepPart, condition: GoalCondition, result: RobotResult, executions: Sequence[Execution]
) -> Iterator[GoalCondition]:
    """Yields a condition for each answer that a check gave, even if the step around the check failed later.

    The answer is on what its looks showed; on a door, on the time at which it was given.
    """
    below = f"{part.path_id}/"
    told = [(one, one.answer) for one in result.findings if f"{one.path_id}/".startswith(below)]
    answers = [(one, answer) for one, answer in told if isinstance(answer, int)]
    nodes = {node.path_id: node for node in result.tree.root.walk()}
    for one, answer in answers:
        begun_s = max((each.began_s for each in executions if each.began_s <= one.t_s), default=one.t_s)
        took = [each for each in result.executions if begun_s <= each.began_s <= one.t_s]
        looked_s = tuple(
            (name, each.began_s, min(_end(each), one.t_s))
            for name, leaves in looks_of(nodes[one.path_id]).items()
            for each in took
            if each.path_id in leaves
        )
        given = replace(condition, question=one.question, answer=answer, at_least=one.at_least, looked_s=looked_s)
        yield replace(given, answered_s=one.t_s, negated=bool(nodes[one.path_id].options.get("negated")))
    if not answers and any(one.done for one in executions):
        yield condition


def _timed(
    condition: GoalCondition, one: Execution, share: Share, moves: Sequence[_Move], *, last: bool
) -> GoalCondition:
    """Returns the goal condition of one execution, with the times between which it must hold."""
    result, ended_s = share.result, math.inf if one.ended_s is None else one.ended_s
    between = [_Move(frozenset(), each.began_s, _end(each)) for other in result.preempting for each in other.executions]
    later = [move for move in (*moves, *between) if move.until_s > ended_s and move.concerns(condition)]
    drove = not last or result.stepped_aside or bool(result.preempting) or (result.moved_s or 0.0) > ended_s
    let_go = condition.kind is GoalKind.GRASPED and later
    when = condition.when
    if when is When.END_OF_MISSION and (let_go or (condition.kind is GoalKind.WENT and drove)):
        when = When.END_OF_STEP
    said = result.said if condition.kind is GoalKind.OWN else ()
    spoken = [each for each in said if not each.asked and one.began_s <= each.t_s < ended_s]
    return replace(
        condition,
        when=when,
        began_s=one.began_s,
        ended_s=one.ended_s,
        spoken_s=tuple(each.t_s for each in spoken),
        said=tuple(each.text for each in spoken),
        taken_s=tuple((move.from_s, move.until_s) for move in later),
    )


def _moves(share: Share) -> Iterator[_Move]:
    """Yields the intervals in which a robot moved objects as its task, also in steps that failed or were stopped."""
    for part in share.tree.parts:
        if not _is_moving(part.skill.gripper_after if part.skill else None, part.goal):
            continue
        classes = frozenset(() if part.goal is None else part.goal.classes)
        for one in share.result.executions:
            if one.path_id == _node_of(part):
                yield _Move(classes, one.began_s, _end(one))


def _is_moving(gripper_after: object, goal: GoalCondition | None) -> bool:
    """Returns whether a step moves objects: as its goal, as the task of a plug-in, or without a goal by its skill."""
    if goal is None or goal.when is When.ALWAYS:
        return goal is None and gripper_after is not None
    return goal.kind in _MOVING or (bool(goal.task) and task_named(goal.task).item_is is not Part.NOTHING)


def _end(one: Execution) -> float:
    return math.inf if one.ended_s is None else one.ended_s


def _node_of(part: StepPart) -> str:
    return part.node or part.path_id


def _speech(tree: CompiledTree, result: RobotResult) -> Iterator[tuple[bool, str]]:
    """Yields whether the robot spoke as each executed speech step says, with a sentence on it.

    Each utterance counts for one step, in the order of time.
    """
    nodes = list(tree.root.walk())
    filled = {key: text for node in nodes for key, text in node.options.get("values", {}).items()}
    texts = {node.path_id: node.options["inputs"]["text"] for node in nodes if is_speech(node)}
    unheard = [said for said in result.said if not said.asked]
    for one in sorted(result.executions, key=lambda one: one.began_s):
        if not one.done or one.path_id not in texts:
            continue
        binding = texts[one.path_id]
        text = filled.get(binding.key) if isinstance(binding, FromBoard) else " ".join(str(binding.value).split())
        begun_s, end_s = one.began_s - 1e-3, _end(one) + 1e-3
        found = next((said for said in unheard if begun_s <= said.t_s <= end_s and _is_text(said.text, text)), None)
        if found is not None:
            unheard.remove(found)
        expected = text.text if isinstance(text, Template) else str(text or "")
        shown = (expected if found is None else found.text)[:SHOWN_CHARS]
        end = "" if shown.endswith((".", "!", "?")) else "."
        if found is not None and found.silent:
            yield True, f'It showed "{shown}" in the silent zone {found.silent}.'
            continue
        yield found is not None, f'It {"said" if found is not None else "did not say"} "{shown}"{end}'


def _is_text(heard: str, text: str | Template | Expression | None) -> bool:
    """Returns whether an utterance matches the text of a step, in which any values may be filled in."""
    return text.matches(heard) if isinstance(text, Template) else not isinstance(text, str) or heard == text


def _joined(*sentences: str) -> str:
    return " ".join(filter(None, sentences))
