"""One robot in a run: its verbs under the watchdog, its lease, its estimators, its missions, and its orderly end."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final, TypeVar

import numpy as np

from executive.record.schemas import NAVIGATION, OUTCOME, POSE, STATE, stamp
from executive.run.outcome import Ending, Outcome, RobotResult, ending_of
from executive.run.run_robot import RunRobot
from executive.run.tree_run import TreeRun
from executive.run.visitor import RunEntry, RunShared, TickNote
from executive.run.watchdog import VerbHung
from executive.tree.board import Board
from executive.tree.compiler import CompiledTree
from executive.tree.node import NodeState, Snapshot
from executive.tree.plan import start_key
from executive.words.slug import slug
from skills.api import Cause, LayeredView, LocalisationEstimate, ParticleView
from skills.files.errors import disk_is_full
from skills.robot import Pose2D

POSE_PERIOD_S: Final = 0.5
MOST_PARTICLES: Final = 30
LEASE_PATIENCE_S: Final = 60.0
_EPSILON_S: Final = 1e-9
_NOTHING: Final = np.empty((0, 2))
ResultT = TypeVar("ResultT")


class Session(RunRobot):
    """One robot with a mission. The runner calls `sense`, `may_move` and `tick` or `hold` in turn until `finished`,
    then `close`.

    `gone` says why nothing more is asked of the robot once its mission is over: its lease is another's, or a verb
    failed. `note` is what the last tick brought of the mission that the robot began with.
    """

    def __init__(self, entry: RunEntry, shared: RunShared) -> None:
        """Opens it under the robot's lease. Raises LeaseError, and what the robot's verbs raise."""
        super().__init__(entry, shared)
        context = self.claim()
        try:
            if entry.speaker_W is not None:
                context.board.put(start_key(entry.tree.robot_name, entry.tree.mission_name), entry.speaker_W)
            self._stack: tuple[TreeRun, ...] = (TreeRun(entry.tree, context, shared.visitors),)
        except BaseException:
            self._guarded.give_lease_back()
            raise
        self._after = entry.after
        self._control, self._visitors = shared.control, shared.visitors
        self._given_up: tuple[TreeRun, ...] = ()
        self._held = False
        self._lost_since_s: float | None = None
        self._preempting: tuple[RobotResult, ...] = ()
        self._later: tuple[CompiledTree, ...] = ()
        self._cancelled: tuple[Ending, float] | None = None  # and when it is over at the latest
        self.result: RobotResult | None = None
        self.gone: str | None = None
        self.note: TickNote | None = None
        self._asked_at: Pose2D | None = None
        self._pose_due_s = shared.clock.now()
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
    def waiting_at(self) -> str | None:
        """The breakpoint that the mission under way waits at."""
        return self._top.waiting_at

    def guarded(self, call: Callable[[], ResultT]) -> ResultT | None:
        """What a call for this robot gives; None where it fails, which ends its mission. Raises OSError: disk full."""
        try:
            return call()
        except (Exception, VerbHung) as stop:
            if disk_is_full(stop):
                raise
            ending = ending_of(stop, self._visitors.publish)
            self.gone = ending.message
            self.close(ending)
            return None

    def has_its_turn(self, results: Mapping[str, RobotResult]) -> bool:
        """Returns whether the robots that the mission waits for are done; it ends when one of them has failed."""
        for name in self._after:
            if name not in results:
                return False
            if results[name].outcome is not Outcome.SUCCESS:
                message = f"{name}, whose part comes first, did not do it: {results[name].message}"
                self.close(Ending(Outcome.FAILURE, Cause.PRECONDITION, message))
                return False
        return True

    def sense(self) -> None:
        """Brings the estimators up to date, counts a new match of the scan, and logs pose and state twice a second."""
        super().sense()
        self._asked_at = self._asked_at or self.pose
        context, estimate = self.context, self.context.localiser.estimate()
        if estimate.stamp_s != self._matched_s:
            self._matched_s = estimate.stamp_s
            context.work.count("scan_matches")
        if context.clock.now() >= self._pose_due_s - _EPSILON_S:
            self._pose_due_s += POSE_PERIOD_S
            self._publish_pose(estimate)
            self._publish_state(estimate)
            self._publish_navigation()

    def may_move(self) -> bool:
        """Returns whether the lease counts. A lost one suspends the mission until it can be had again.

        Raises nothing; when that takes longer than LEASE_PATIENCE_S, the session is closed with cause EXECUTION.
        """
        lost, now_s = self._guarded.lease_lost(), self.context.clock.now()
        if self._cancelled is not None and now_s >= self._cancelled[1]:
            self.close()
            return False
        if lost is None:
            return True
        if self._lost_since_s is None:
            self._lost_since_s = now_s
            self._top.suspend()
            self._control.lease_lost(self.name, lost)
        if self._guarded.regain_lease():
            self._lost_since_s = None
            self._control.lease_lost(self.name, None)
            return True
        if now_s - self._lost_since_s > LEASE_PATIENCE_S:
            message = f"{lost} and did not give it back within {LEASE_PATIENCE_S:g} s"
            self._control.lease_lost(self.name, None)
            self.gone = message
            self.close(Ending(Outcome.FAILURE, Cause.EXECUTION, message))
        return False

    def tick(self, breakpoints: frozenset[str]) -> bool:
        """Ticks the mission under way once; True when a node changed its status. Its end takes up the one before.

        What a mission that was given up or cancelled always does in the end comes first.
        """
        self._held = False
        run = self._top
        if self._cancelled is not None or self._given_up:
            run, breakpoints = next(run for run in self._runs if run.ends), frozenset()
        changed = run.tick(breakpoints)
        self.note = self._stack[0].note(ticked=run is self._stack[0])
        if self._cancelled is not None:
            if not self.ends:
                self.close()
        elif self._given_up:
            if not run.ends:
                run.halt(self.attempt)
                self._given_up = self._given_up[1:]
        else:
            self._go_on_after_the_top()
        return changed

    def _go_on_after_the_top(self) -> None:
        """Where the mission under way has ended, take up the one before, or begin the next."""
        if self._top.finished and len(self._stack) > 1:
            done = self._top
            done.halt(self.attempt)
            self._note_end(done.judge(None))
            self._stack = self._stack[:-1]
            self._top.show()
        if self._top.finished and self._later:
            tree, *later = self._later
            self._later = tuple(later)
            self._begin(tree, self._start_of(self._top))

    @property
    def waits_for_people(self) -> bool:
        """True while the mission under way waits for somebody to press a button."""
        return self.result is None and self._top.waits_for_people

    @property
    def ends(self) -> bool:
        """True while missions that were ended early still do what is always done in the end."""
        return self.result is None and any(run.ends for run in self._runs)

    def cancel(self, ending: Ending, limit_s: float) -> None:
        """Ends all missions of this robot where they are; idempotent.

        What they always do in the end is done by `tick`, for so long (s) at most.
        """
        if self._cancelled is None:
            self._cancelled = ending, self.context.clock.now() + limit_s
            for run in reversed(self._stack):
                self.attempt("stop the tree", run.end_early)
            if not self.ends:
                self.close()

    @property
    def cancelled(self) -> bool:
        """Returns whether the missions were ended early."""
        return self._cancelled is not None

    def hold(self) -> None:
        """Suspend the mission and stop the robot; done once until the next tick."""
        if not self._held:
            self._held = True
            for run in self._runs:
                run.suspend()
            if self._lost_since_s is None:
                self.context.robot.stop(lease=self.context.lease)

    def preempt(self, tree: CompiledTree) -> None:
        """Suspend the mission under way and begin another; nothing of the one leaks into the other."""
        self.hold()
        self._begin(tree)

    def later(self, tree: CompiledTree) -> None:
        """Begins another mission when the one that the robot began with is done; it comes back to the same start."""
        self._later += (tree,)

    def replace(self, tree: CompiledTree, instead_of: str | None = None) -> None:
        """Gives up the mission under way, or not begin one that waits, and have another in its place, from its start.

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
        self.attempt("stop the tree", given_up.end_early)
        if given_up.ends:
            self._given_up += (given_up,)
        else:
            given_up.halt(self.attempt)
        self._stack = self._stack[:-1]
        self._control.mission_ended(self.name)
        self._begin(tree, self._start_of(given_up))
        message = f"given up for '{tree.mission_name}'"
        self._note_result(given_up.judge(Ending(Outcome.CANCELLED, Cause.CANCELLED, message)))

    def close(self, ending: Ending | None = None) -> RobotResult:
        """Stops the trees and the robot, gives the lease back, logs the end. Idempotent; raises nothing."""
        if self.result is None:
            ending = ending if self._cancelled is None else self._cancelled[0]
            for run in self._runs:
                run.halt(self.attempt)
            self.stop_and_leave()
            for run in reversed(self._stack[1:]):
                self._note_end(run.judge(ending))
            self._stack = self._stack[:1]
            self.result = self._top.judge(ending, self._preempting)
        return self.result

    @property
    def _top(self) -> TreeRun:
        return self._stack[-1]

    @property
    def _runs(self) -> tuple[TreeRun, ...]:
        """All trees, those that were given up first, then the one under way and those below it."""
        return (*self._given_up, *reversed(self._stack))

    def _start_of(self, run: TreeRun) -> Pose2D | None:
        """Where a mission began: where it noted that, else where the robot stood at first."""
        key = start_key(run.tree.robot_name, run.tree.mission_name)
        start: Pose2D | None = run.context.board.get(key) if key in run.context.board else self._asked_at
        return start

    def _begin(self, tree: CompiledTree, start: Pose2D | None = None) -> None:
        self._held = False
        context = replace(self.context, board=Board(slug(tree.robot_name)))
        if start is not None:
            context.board.put(start_key(tree.robot_name, tree.mission_name), start)
        self._stack = (*self._stack, TreeRun(tree, context, self._visitors))
        self._control.mission_begun(self.name, tree)

    def _note_end(self, result: RobotResult) -> None:
        """A mission that came in between is over."""
        self._control.mission_ended(self.name)
        self._note_result(result)

    def _note_result(self, result: RobotResult) -> None:
        self._preempting += (result,)
        self.context.publish(OUTCOME, {**result.message_of_end(), "mission": result.tree.mission_name})

    def _publish_pose(self, estimate: LocalisationEstimate) -> None:
        X_WB = self.context.X_WB()
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
