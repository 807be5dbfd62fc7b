"""Runs one mission's tree: ticks, suspension, stops, the log of its changes, and its result."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.run.mission_history import BEFORE, Executions, Findings, achieved, claim, findings_in_words
from executive.run.outcome import Ending, Outcome, RobotResult
from executive.run.visitor import TickNote, Visitors
from executive.tree.behaviour import Explained, ExplainedNode, Hook, message_of, suspend
from executive.tree.compiler import CompiledTree
from executive.tree.context import Endings, RunContext
from executive.tree.node import Change, NodeState, Snapshot
from executive.tree.node_view import node_view
from executive.words.goal import GoalKind
from executive.words.schemas import ACTIVITY, TRANSITIONS, TREE
from skills.api import Cause
from skills.inputs.errors import listing
from skills.zone_map import zone_messages

POSE_NOTE_PERIOD_S = 1.0

Attempt = Callable[[str, Callable[[], object]], bool]
Visited = Callable[[Behaviour, bool], None]
"""Receives each node that a tick has visited, and whether it was stopped from outside since its last visit."""


class TreeRun:
    """Run of one tree; `states` has the last states of its nodes."""

    def __init__(self, tree: CompiledTree, context: RunContext, visitors: Visitors) -> None:
        self.tree = tree
        findings, publish = Findings(context.clock, context.board, tree.robot_name, tree.mission_name), context.publish
        self._findings = findings
        self.context = context = replace(
            context,
            publish=lambda topic, message: publish(topic, findings.message(topic, message)),
            endings=Endings(),
            hook=Hook(),
            zones=tree.zones,
        )
        self.root = tree.build(context)
        self._ended_early = self._suspended = False
        self._endings: list[str] = []
        self._observed = TreeObserver(self.root, context.hook)
        self._nodes = tuple(node for node in self._observed.nodes if isinstance(node, ExplainedNode))
        self._for_buttons = tuple(node for node in self._nodes if node.waits_for_button())
        self._skills = {node.path_id: node for node in self._nodes if node.runs_skill}
        self._running = {path_id: leaf for path_id, leaf in self._skills.items() if leaf.status is Status.RUNNING}
        self._changes: Sequence[Change] = ()
        self._pose_due_s = -math.inf
        for each in visitors:
            each.mission_begun(self._observed.nodes, context)
        self.show()
        self._executions = Executions(tree, self._observed.nodes, context.board, context.clock)

    @property
    def finished(self) -> bool:
        """Returns whether the tree has ended and all steps under `always` are finished."""
        return self.root.status in (Status.SUCCESS, Status.FAILURE) and self.context.endings.due is None

    @property
    def waits_for_people(self) -> bool:
        """Returns whether a node waits for a person to press a button."""
        return any(node.status is Status.RUNNING for node in self._for_buttons)

    @property
    def ends(self) -> bool:
        """Returns whether the tree was ended early and still runs its steps under `always`."""
        return self._ended_early and self.context.endings.due is not None

    @property
    def waiting_at(self) -> str | None:
        """Path id of the node that waits at a breakpoint; None if no node waits."""
        return next(iter(self.context.hook.waiting), None)

    def show(self) -> None:
        """Logs the tree."""
        structure = node_view(self.tree.root, self.states).structure()
        zones = zone_messages(self.tree.all_zones)
        message = {"robot": self.tree.robot_name, "root": structure}
        self.context.publish(TREE, {**message, "zones": zones} if zones else message)

    def tick(self, breakpoints: frozenset[str]) -> bool:
        """Ticks once and logs the changes; returns whether anything changed."""
        self.context.hook.breakpoints = breakpoints
        self._tick()
        self._changes = self.log_changes()
        for path_id, _, after in (change for change in self._changes if change.path_id in self._skills):
            if after.status is Status.RUNNING:
                self._running[path_id] = self._skills[path_id]
            else:
                self._running.pop(path_id, None)
        self._executions.after_tick(change.path_id for change in self._changes)
        return bool(self._changes)

    def note(self, *, ticked: bool) -> TickNote:
        """Returns the note of the last tick; `ticked` is False while another mission preempts this one."""
        context, changes = self.context, self._changes
        now_s, board = context.clock.now(), context.board.values()
        if not ticked:
            return TickNote(self.tree, now_s, (), board, None, {})
        checkpoints = {path_id: point for path_id, leaf in self._running.items() if (point := leaf.checkpoint)}
        pose = charge = None
        if changes or now_s >= self._pose_due_s:
            self._pose_due_s, pose = now_s + POSE_NOTE_PERIOD_S, context.known_pose()
            charge = context.robot.battery().charge
        return TickNote(self.tree, now_s, changes, board, pose, checkpoints, charge)

    def _tick(self) -> None:
        """Ticks the tree; while steps under `always` of a stopped node are due, suspends it and ticks these instead."""
        endings = self.context.endings
        due = endings.due
        if due is None:
            self._suspended = False
            if not self._ended_early:
                self._observed.tick(self.root, self._visited)
            return
        if not self._suspended:
            self._suspended = True
            suspend(self.root, sparing=due)
        self._observed.tick(due, self._visited)
        if due.status != Status.RUNNING:
            endings.pop()
            if due.status == Status.FAILURE:
                self._endings.append(f"in the end: {message_of(due)}")

    def _visited(self, node: Behaviour, stopped: bool) -> None:
        if node not in self.context.hook.waiting.values():
            self._executions.note_visit(node, stopped)

    def end_early(self) -> None:
        """Stops the tree at its present step; afterwards only its steps under `always` run."""
        if not self._ended_early and not self.finished:
            self.root.stop(Status.INVALID)
            self._ended_early = True

    def suspend(self) -> None:
        """Suspends all running nodes, which release the robot."""
        suspend(self.root)

    @property
    def states(self) -> Snapshot:
        """Last states of all nodes by path id."""
        return self._observed.states

    def log_changes(self, *, of_all: bool = False) -> Sequence[Change]:
        """Logs and returns the transitions since the last call, and logs new actions of running skills."""
        changes = self._observed.changes(of_all=of_all)
        transitions, repeated = [change for change in changes if change.is_transition], self.context.hook.repeated
        for path_id, before, after in transitions:
            states = {"from": before.status.value, "to": after.status.value, "cause": after.cause}
            restored = {"restored": True} if path_id in repeated and after.status in _OUTCOMES else {}
            self.context.publish(TRANSITIONS, {**self._activity(path_id, after), **states, **restored})
        repeated.clear()
        for change in (each for each in changes if each.path_id in self._skills and each.is_activity):
            self.context.publish(ACTIVITY, self._activity(change.path_id, change.after))
        return transitions

    def halt(self, attempt: Attempt) -> None:
        """Stops all running nodes, even after an exception during a tick; the nodes keep their results.

        Each stop is called through `attempt`, so that an error in one does not prevent the others.
        """
        for node in self.context.endings.close():
            steps = listing(each.name for each in node.children or [node])
            what = message_of(node) if node.status == Status.RUNNING else steps
            self._endings.append(f"in the end, broken off: {what}")
            attempt("stop what is done in the end", lambda node=node: node.stop(Status.INVALID))  # type: ignore[misc]
        if not self.finished and not self._ended_early:
            attempt("stop the tree", lambda: self.root.stop(Status.INVALID))
        for leaf in self._skills.values():
            attempt(f"end {leaf.path_id}", leaf.abandon)
        self.log_changes(of_all=True)

    def _reached(self) -> Sequence[tuple[GoalKind, str, str]]:
        """Kind, name and last message of each step with a goal that has succeeded, in the order of the mission."""
        nodes = {node.path_id: node for node in self._nodes}
        parts = ((part.goal, nodes.get(part.node or part.path_id)) for part in self.tree.parts)
        done = ((goal, node) for goal, node in parts if goal and node and node.status == Status.SUCCESS)
        return list({node.path_id: (goal.kind, node.name, node.message) for goal, node in done}.values())

    def judge(self, ending: Ending | None, preempting: tuple[RobotResult, ...] = ()) -> RobotResult:
        """Returns the mission's result: from the tree's status if the tree has ended, else from `ending`."""
        root = self.root
        cause = root.cause if isinstance(root, Explained) else None
        message = root.message if isinstance(root, Explained) else root.feedback_message
        outcome = _OUTCOMES.get(root.status, Outcome.CANCELLED)
        if outcome is Outcome.FAILURE and cause is Cause.ERROR:
            outcome = Outcome.ERROR
        if ending is not None and not self.finished:
            outcome, cause, message = ending.outcome, ending.cause, ending.message
        message = "; ".join((message, *self._endings))
        answers = {node.path_id: answer for node in self._nodes if (answer := node.answered()) is not None}
        findings, said = self._findings.findings, self._findings.said
        if outcome is Outcome.SUCCESS:
            skipped = [omission for node in self._nodes if (omission := node.omission()) is not None]
            if findings or not skipped:
                whole = claim(achieved(self._reached(), "" if findings else message), findings, skipped)
                again = message.endswith(f"({BEFORE})") and BEFORE not in whole
                message = f"{whole} ({BEFORE})" if again else whole
        elif findings and outcome is Outcome.FAILURE:
            message = f"{message} (found out: {findings_in_words(findings)})"
        return RobotResult(
            tree=self.tree,
            outcome=outcome,
            cause=cause,
            message=message,
            answers=answers,
            states=self.states,
            preempting=preempting,
            findings=findings,
            said=said,
            executions=self._executions.all,
            moved_s=self._executions.moved_s,
        )

    def _activity(self, path_id: str, state: NodeState) -> dict[str, object]:
        now_s = round(self.context.clock.now(), 6)
        return {"t": now_s, "robot": self.tree.robot_name, "node": path_id, "message": state.message}


class TreeObserver:
    """Reads the states of a built tree after every tick. `states` holds the last state of each node, parents first.

    A node's state changes only when `tick` ticks it or when it is stopped. Only these nodes are read, so that a tick
    costs nothing for the others.
    """

    def __init__(self, root: Behaviour, hook: Hook) -> None:
        """Reads the initial states; `hook` is the hook that the nodes of the tree share."""
        self.nodes: tuple[Behaviour, ...] = tuple(_walk(root))
        self._explained = tuple(node for node in self.nodes if isinstance(node, Explained))
        self._last = [_state(node) for node in self._explained]
        named = zip(self._explained, self._last, strict=True)
        self.states: Snapshot = {node.path_id: state for node, state in named}
        self._index: Mapping[Behaviour, int] = {node: index for index, node in enumerate(self._explained)}
        self._touched, self._stopped = hook.touched, hook.stopped

    def tick(self, node: Behaviour, visited: Visited = lambda node, stopped: None) -> None:
        """Ticks a node with its subtree, and calls `visited` for each node, children before parents."""
        for each in node.tick():
            self._touched.add(each)
            visited(each, each in self._stopped)
            self._stopped.discard(each)

    def changes(self, *, of_all: bool = False) -> Sequence[Change]:
        """Returns the changes since the last call, in the order of the tree, and updates `states`.

        With `of_all` all nodes are read, as needed after an exception in a tick or a direct change of a node.
        """
        touched = sorted(self._index[node] for node in self._touched if node in self._index)
        self._touched.clear()
        found = list[Change]()
        for index in range(len(self._explained)) if of_all else touched:
            node, last, state = self._explained[index], self._last[index], _state(self._explained[index])
            if state != last:
                self._last[index] = state
                found.append(Change(node.path_id, last, state))
        if found:
            self.states = {**self.states, **{change.path_id: change.after for change in found}}
        return found


def _walk(root: Behaviour) -> Iterator[Behaviour]:
    """Yields the node and all its descendants, parents first."""
    yield root
    for child in root.children:
        yield from _walk(child)


def _state(node: Explained) -> NodeState:
    return NodeState(node.status, node.cause, node.message, node.progress)


_OUTCOMES = {Status.SUCCESS: Outcome.SUCCESS, Status.FAILURE: Outcome.FAILURE}
