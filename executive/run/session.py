"""One robot in a run: its lease, its missions (others may come in between), and its orderly end."""

from __future__ import annotations

import math
import traceback
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from executive.record.drawable import stamp
from executive.record.profile import Profile
from executive.record.schemas import NAVIGATION, OUTCOME, POSE, STATE
from executive.run.control import Control
from executive.run.guarded_robot import GuardedRobot
from executive.run.journal import Journal
from executive.run.outcome import Outcome, RobotResult, RobotStatus
from executive.run.resting import HOLDER
from executive.run.tree_run import Ending, TreeRun
from executive.run.watchdog import VerbHung
from executive.tree.behaviours.board import Board
from executive.tree.behaviours.context import RunContext
from executive.tree.behaviours.skill_leaf import ERROR_TOPIC
from executive.tree.compiler import CompiledTree
from executive.tree.compiling.builder import start_key
from executive.tree.snapshot import NodeState, Snapshot
from executive.words.slug import slug
from skills.api import Cause, LayeredView, LocalisationEstimate, ParticleView, SkillContext
from skills.robot import Pose2D

POSE_PERIOD_S = 0.5
MOST_PARTICLES = 30
LEASE_PATIENCE_S = 60.0
_EPSILON_S = 1e-9
_NOTHING: Final = np.empty((0, 2))


class Session:
    """One robot. The runner calls `sense`, `may_move` and `tick` or `hold` in turn until `finished`, then `close`."""

    def __init__(
        self,
        tree: CompiledTree,
        context: RunContext,
        robot: GuardedRobot,
        control: Control,
        journal: Journal | None = None,
        profile: Profile | None = None,
        *,
        speaker_W: Pose2D | None = None,
    ) -> None:
        """`speaker_W` is where whoever asked for it stands; None: where the robot begins."""
        self.name: Final = context.robot.name
        if speaker_W is not None:
            context.board.put(start_key(tree.robot_name, tree.mission_name), speaker_W)
        self.context = context
        self._robot, self._control, self._profile = robot, control, profile
        self._stack: tuple[TreeRun, ...] = (TreeRun(tree, context, journal, profile),)
        self._given_up: tuple[TreeRun, ...] = ()
        self._held = False
        self._lost_since_s: float | None = None
        self._preempting: tuple[RobotResult, ...] = ()
        self._later: tuple[CompiledTree, ...] = ()
        self._cancelled: tuple[Ending, float] | None = None  # and when it is over at the latest
        self.result: RobotResult | None = None
        self._pose_due_s = context.clock.now()
        self._asked_at: Pose2D | None = None
        self._matched_s = -math.inf
        self._navigation: Mapping[str, object] = {}

    @property
    def tree(self) -> CompiledTree:
        """The mission under way."""
        return self._top.tree

    @property
    def states(self) -> Snapshot:
        """The states of all nodes, those of suspended missions included."""
        if len(self._stack) == 1:
            return self._top.states
        merged: dict[str, NodeState] = {}
        for run in self._stack:
            merged |= run.states
        return merged

    @property
    def finished(self) -> bool:
        """True when the mission that the robot began with has come to an end."""
        return self.result is not None or (len(self._stack) == 1 and self._top.finished and not self._later)

    @property
    def main_tree(self) -> CompiledTree:
        """The mission that the robot began with, or the one that took its place."""
        return self._stack[0].tree

    @property
    def status(self) -> RobotStatus:
        """Where the robot is and whether it holds something."""
        return RobotStatus(self.context.known_pose(), self.context.robot.gripper().holding)

    @property
    def waiting_at(self) -> str | None:
        """The breakpoint that the mission under way waits at."""
        return self._top.waiting_at

    def sense(self) -> None:
        """Bring the estimators up to date, and log pose and state twice a second."""
        context = self.context
        context.localiser.update(context.robot)
        estimate = context.localiser.estimate()
        context.costmap.update(context.robot, estimate)
        if estimate.stamp_s != self._matched_s:
            self._matched_s = estimate.stamp_s
            context.work.count("scan_matches")
        self._asked_at = self._asked_at or context.known_pose()
        if context.clock.now() >= self._pose_due_s - _EPSILON_S:
            self._pose_due_s += POSE_PERIOD_S
            self._publish_pose()
            self._publish_state(estimate)
            self._publish_navigation()

    def may_move(self) -> bool:
        """Whether the lease counts. A lost one suspends the mission until it can be had again.

        Raises nothing; when that takes longer than LEASE_PATIENCE_S, the session is closed with cause EXECUTION.
        """
        lost = self._robot.lease_lost()
        if lost is None:
            return True
        now_s = self.context.clock.now()
        if self._lost_since_s is None:
            self._lost_since_s = now_s
            self._top.suspend()
            self._control.lease_lost(self.name, lost)
        if self._robot.regain_lease():
            self._lost_since_s = None
            self._control.lease_lost(self.name, None)
            return True
        if now_s - self._lost_since_s > LEASE_PATIENCE_S:
            message = f"{lost} and did not give it back within {LEASE_PATIENCE_S:g} s"
            self._control.lease_lost(self.name, None)
            self.close(Ending(Outcome.FAILURE, Cause.EXECUTION, message))
        return False

    def tick(self, breakpoints: frozenset[str]) -> bool:
        """Tick the mission under way once; True when a node changed its status. Its end takes up the one before.

        What a mission that was given up always does in the end comes first.
        """
        self._held = False
        if self._cancelled is not None:
            return self._tick_cancelled(*self._cancelled)
        if self._given_up:
            return self._tick_given_up(self._given_up[0])
        changed = self._top.tick(breakpoints)
        if self._top.finished and len(self._stack) > 1:
            self._take_up_the_one_before()
        if self._top.finished and self._later:
            tree, *later = self._later
            self._later = tuple(later)
            self._begin(tree, self._start_of(self._top))
        return changed

    @property
    def waits_for_people(self) -> bool:
        """True while the mission under way waits for somebody to press a button."""
        return self.result is None and self._top.waits_for_people

    @property
    def ends(self) -> bool:
        """True while missions that were ended early still do what is always done in the end."""
        return self.result is None and any(run.ends for run in (*self._given_up, *self._stack))

    def end_early(self) -> None:
        """Stop all missions where they are; what is always done in the end is left to `tick_end`."""
        for run in reversed(self._stack):
            run.end_early()

    def tick_end(self) -> None:
        """Tick once what is always done in the end, of the latest mission first."""
        self._held = False
        run = next((run for run in (*self._given_up, *reversed(self._stack)) if run.ends), None)
        if run is not None:
            run.tick(frozenset())

    def cancel(self, reason: str, limit_s: float) -> None:
        """End all missions of this robot; what they always do in the end is done by `tick`, for so long (s) at most.

        Once more: at once.
        """
        ending = Ending(Outcome.CANCELLED, Cause.CANCELLED, reason)
        if self._cancelled is None:
            self._cancelled = ending, self.context.clock.now() + limit_s
            self._attempt("stop the trees", self.end_early)
            if self.ends:
                return
        self.close(self._cancelled[0])

    def _tick_cancelled(self, ending: Ending, until_s: float) -> bool:
        self.tick_end()
        if not self.ends or self.context.clock.now() >= until_s:
            self.close(ending)
        return True

    def _tick_given_up(self, run: TreeRun) -> bool:
        changed = run.tick(frozenset())
        if not run.ends:
            run.halt(self._attempt)
            self._given_up = self._given_up[1:]
        return changed

    def hold(self) -> None:
        """Suspend the mission and stop the robot; done once until the next tick."""
        if not self._held:
            self._held = True
            for run in (*self._given_up, *self._stack):
                run.suspend()
            if self._lost_since_s is None:
                self.context.robot.stop(lease=self.context.lease)

    def preempt(self, tree: CompiledTree) -> None:
        """Suspend the mission under way and begin another; nothing of the one leaks into the other."""
        self.hold()
        self._begin(tree)

    def later(self, tree: CompiledTree) -> None:
        """Begin another mission when the one that the robot began with is done; it comes back to the same start."""
        self._later += (tree,)

    def replace(self, tree: CompiledTree, instead_of: str | None = None) -> None:
        """Give up the mission under way, or not begin one that waits, and have another in its place, from its start.

        Where the mission called `instead_of` is neither, the other is done first.
        """
        if any(waiting.mission_name == instead_of for waiting in self._later):
            self._later = tuple(tree if one.mission_name == instead_of else one for one in self._later)
        elif instead_of in (None, self.tree.mission_name):
            self._give_up_for(tree)
        else:
            self.preempt(tree)

    def _give_up_for(self, tree: CompiledTree) -> None:
        self.hold()
        given_up = self._top
        self._attempt("stop the tree", given_up.end_early)
        if given_up.ends:
            self._given_up += (given_up,)
        else:
            given_up.halt(self._attempt)
        self._stack = self._stack[:-1]
        self._control.mission_ended(self.name)
        journal = None if self._stack or given_up.journal is None else given_up.journal.replaced(tree)
        given_up.journal = None
        self._begin(tree, self._start_of(given_up), journal)
        message = f"given up for '{tree.mission_name}'"
        self._note_result(given_up.judge(Ending(Outcome.CANCELLED, Cause.CANCELLED, message)))

    def close(self, ending: Ending | None = None) -> RobotResult:
        """Stop the trees and the robot, give the lease back, log the end. Idempotent; raises nothing."""
        if self.result is None:
            for run in (*self._given_up, *reversed(self._stack)):
                run.halt(self._attempt)
            context = self.context
            self._attempt("stop the robot", lambda: context.robot.stop(lease=context.lease))
            self._attempt("return the lease", self._robot.give_lease_back)
            for run in reversed(self._stack[1:]):
                self._note_end(run.judge(ending))
            self._stack = self._stack[:1]
            self.result = self._top.judge(ending, self._preempting)
        return self.result

    def rest(self) -> SkillContext:
        """Claim the lease again after the end: what may be used to step aside for others. Raises LeaseError."""
        self.context = replace(self.context, lease=self._robot.claim(HOLDER))
        return self.context

    def leave(self) -> None:
        """Stop the robot and give back the lease that `rest` claimed."""
        context = self.context
        self._attempt("stop the robot", lambda: context.robot.stop(lease=context.lease))
        self._attempt("return the lease", self._robot.give_lease_back)

    def log_end(self, ticks: int) -> None:
        """Write the outcome to the log."""
        assert self.result is not None
        self._publish_outcome(self.result, ticks)

    @property
    def _top(self) -> TreeRun:
        return self._stack[-1]

    def _start_of(self, run: TreeRun) -> Pose2D | None:
        """Where a mission began: where it noted that, else where the robot stood at first."""
        key = start_key(run.tree.robot_name, run.tree.mission_name)
        start: Pose2D | None = run.context.board.get(key) if key in run.context.board else self._asked_at
        return start

    def _begin(self, tree: CompiledTree, start: Pose2D | None = None, journal: Journal | None = None) -> None:
        self._held = False
        context = replace(self.context, board=Board(slug(tree.robot_name)))
        if start is not None:
            context.board.put(start_key(tree.robot_name, tree.mission_name), start)
        self._stack = (*self._stack, TreeRun(tree, context, journal, self._profile))
        self._control.mission_begun(self.name, tree)

    def _take_up_the_one_before(self) -> None:
        done = self._top
        done.halt(self._attempt)
        self._note_end(done.judge(None))
        self._stack = self._stack[:-1]
        self._top.show()

    def _note_end(self, result: RobotResult) -> None:
        """A mission that came in between is over."""
        self._control.mission_ended(self.name)
        self._note_result(result)

    def _note_result(self, result: RobotResult) -> None:
        self._preempting += (result,)
        self._publish_outcome(result, None)

    def _publish_outcome(self, result: RobotResult, ticks: int | None) -> None:
        end = {"robot": self.name, "outcome": result.outcome, "cause": result.cause, "message": result.message}
        more: Mapping[str, object] = {"mission": result.mission} if ticks is None else {"ticks": ticks}
        self.context.publish(OUTCOME, {**end, "answers": result.answers, **more})

    def _publish_pose(self) -> None:
        X_WB, estimate = self.context.X_WB(), self.context.localiser.estimate()
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
                "covariance": estimate.covariance.ravel().tolist(),
            },
        )

    def _publish_state(self, estimate: LocalisationEstimate) -> None:
        """What an operator looks at: the gripper, the battery, the speed, and how well the place is known."""
        robot = self.context.robot
        self.context.publish(
            STATE,
            {
                "robot": self.name,
                "holding": robot.gripper().holding,
                "charge": round(robot.battery().charge, 4),
                "speed_m_s": round(math.hypot(*robot.odometry().velocity[:2]), 3),
                "localised": estimate.localised,
                "localisation_health": round(estimate.health, 3),
                "position_sigma_m": round(math.sqrt(estimate.covariance[0, 0] + estimate.covariance[1, 1]), 4),
            },
        )

    def _publish_navigation(self) -> None:
        """Where else the robot may be, and what it sees that the map does not have (m); when either is new."""
        localiser, costmap = self.context.localiser, self.context.costmap
        particles = localiser.particles_W(MOST_PARTICLES) if isinstance(localiser, ParticleView) else _NOTHING
        seen = costmap.seen_m() if isinstance(costmap, LayeredView) else _NOTHING
        columns = np.round(np.concatenate([particles[:, :2].T, seen.T], axis=1), 2)
        (x, y), count = columns.tolist(), len(particles)
        new = {"particle_x": x[:count], "particle_y": y[:count], "seen_x": x[count:], "seen_y": y[count:]}
        if new != self._navigation:
            self._navigation = new
            self.context.publish(NAVIGATION, {"robot": self.name, **new})

    def _attempt(self, what: str, call: Callable[[], object]) -> None:
        """Do it; a defect goes to the log, since the rest of the end must still happen."""
        try:
            call()
        except (Exception, VerbHung):
            self.context.publish(ERROR_TOPIC, {"node": self.name, "what": what, "traceback": traceback.format_exc()})
