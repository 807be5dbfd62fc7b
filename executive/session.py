"""One robot's mission under way: its lease, its tree, its log entries, and its orderly end."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.behaviours.answer import Answer
from executive.behaviours.context import RunContext
from executive.behaviours.explained import Explained
from executive.behaviours.skill_leaf import ERROR_TOPIC, SkillLeaf
from executive.compiler import CompiledTree
from executive.journal import Journal, TickNote
from executive.outcome import Outcome, RobotResult
from executive.record.drawable import stamp
from executive.record.schemas import OUTCOME, POSE, TRANSITIONS, TREE
from executive.snapshot import Snapshot, Transition, snapshot, transitions, walk
from executive.view.model import node_view
from executive.watchdog import VerbHung
from skills.api import Cause
from skills.robot import Pose2D

POSE_PERIOD_S = 0.5
_EPSILON_S = 1e-9


@dataclass(frozen=True)
class Ending:
    """An end that the tree did not come to by itself."""

    outcome: Outcome
    cause: Cause
    message: str


class Session:
    """One robot's mission. The runner calls `sense` and `tick` in turn until `finished`, and `close` in any case."""

    def __init__(self, tree: CompiledTree, context: RunContext, journal: Journal | None = None) -> None:
        self.context = context
        self._journal = journal
        self.root: Behaviour = tree.build(context)
        self.states: Snapshot = snapshot(self.root)
        self.result: RobotResult | None = None
        self._pose_due_s = context.clock.now()
        context.publish(TREE, {"robot": tree.robot_name, "root": node_view(tree.root, self.states).structure()})

    @property
    def name(self) -> str:
        """The robot's name."""
        return self.context.robot.name

    @property
    def finished(self) -> bool:
        """True when the tree has come to an end."""
        return self.root.status in (Status.SUCCESS, Status.FAILURE)

    def sense(self) -> None:
        """Bring the estimators up to date, and log the pose twice a second."""
        context = self.context
        context.localiser.update(context.robot)
        context.costmap.update(context.robot, context.localiser.estimate())
        if context.clock.now() >= self._pose_due_s - _EPSILON_S:
            self._pose_due_s += POSE_PERIOD_S
            self._publish_pose()

    def tick(self) -> None:
        """Tick the tree once and log what changed."""
        self.root.tick_once()
        changes = self._log_changes()
        if self._journal is not None:
            self._journal.note(self._tick_note(changes))

    def close(self, ending: Ending | None = None) -> RobotResult:
        """Stop the tree and the robot, give the lease back, log the end. Idempotent; raises nothing."""
        if self.result is None:
            self._halt()
            self._log_changes()
            context = self.context
            self._attempt("stop the robot", lambda: context.robot.stop(lease=context.lease))
            self._attempt("return the lease", lambda: context.robot.return_lease(context.lease))
            self.result = self._judge(ending)
        return self.result

    def log_end(self, ticks: int) -> None:
        """Write the outcome to the log."""
        assert self.result is not None
        result = self.result
        end = {"robot": self.name, "outcome": result.outcome, "cause": result.cause, "message": result.message}
        self.context.publish(OUTCOME, {**end, "answers": result.answers, "ticks": ticks})

    def _halt(self) -> None:
        """Stop all that runs; results that are there stay in sight. Also after an exception in the middle of a tick."""
        if not self.finished:
            self._attempt("stop the tree", lambda: self.root.stop(Status.INVALID))
        for node in walk(self.root):
            if isinstance(node, SkillLeaf):
                self._attempt(f"end {node.path_id}", node.abandon)

    def _judge(self, ending: Ending | None) -> RobotResult:
        root = self.root
        cause = root.cause if isinstance(root, Explained) else None
        message = root.message if isinstance(root, Explained) else root.feedback_message
        outcome = _OUTCOMES.get(root.status, Outcome.CANCELLED)
        if outcome is Outcome.FAILURE and cause is Cause.ERROR:
            outcome = Outcome.ERROR
        if ending is not None and not self.finished:
            outcome, cause, message = ending.outcome, ending.cause, ending.message
        answers = {n.path_id: n.answer for n in walk(root) if isinstance(n, Answer) and n.answer is not None}
        return RobotResult(self.name, outcome, cause, message, answers, self.states)

    def _log_changes(self) -> Sequence[Transition]:
        before, self.states = self.states, snapshot(self.root)
        changes = tuple(transitions(before, self.states))
        for change in changes:
            self.context.publish(TRANSITIONS, self._transition(change))
        return changes

    def _tick_note(self, changes: Sequence[Transition]) -> TickNote:
        context = self.context
        estimate = context.localiser.estimate()
        X_WB = estimate.X_WO @ context.robot.odometry().X_OB
        pose = Pose2D.from_transform(X_WB) if estimate.localised else None
        leaves = (node for node in walk(self.root) if isinstance(node, SkillLeaf))
        checkpoints = {leaf.path_id: leaf.checkpoint for leaf in leaves if leaf.checkpoint}
        return TickNote(context.clock.now(), changes, context.board.values(), pose, checkpoints)

    def _transition(self, change: Transition) -> dict[str, object]:
        after = change.after
        return {
            "t": round(self.context.clock.now(), 6),
            "robot": self.name,
            "node": change.path_id,
            "from": change.before.status.value,
            "to": after.status.value,
            "cause": after.cause,
            "message": after.message,
        }

    def _publish_pose(self) -> None:
        X_WB = self.context.localiser.estimate().X_WO @ self.context.robot.odometry().X_OB
        p, q = X_WB.translation(), X_WB.rotation().ToQuaternion()
        flat = Pose2D.from_transform(X_WB)
        self.context.publish(
            POSE,
            {
                "timestamp": stamp(self.context.clock.now()),
                "frame_id": "world",
                "robot": self.name,
                "pose": {
                    "position": {"x": p[0], "y": p[1], "z": p[2]},
                    "orientation": {"x": q.x(), "y": q.y(), "z": q.z(), "w": q.w()},
                },
                "yaw_rad": flat.yaw_rad,
            },
        )

    def _attempt(self, what: str, call: Callable[[], object]) -> None:
        """Do it; a defect goes to the log, since the rest of the end must still happen."""
        try:
            call()
        except (Exception, VerbHung):
            self.context.publish(ERROR_TOPIC, {"node": self.name, "what": what, "traceback": traceback.format_exc()})


_OUTCOMES = {Status.SUCCESS: Outcome.SUCCESS, Status.FAILURE: Outcome.FAILURE}
