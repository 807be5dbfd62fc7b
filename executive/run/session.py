"""Session of one robot in a run: the order of its missions, their ticks, and their orderly end."""

import math
import traceback
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final, TypeVar

from executive.run.control_state import MissionRequest, Turn
from executive.run.guarded_robot import GuardedRobot
from executive.run.outcome import Ending, Outcome, RobotResult, RobotStatus, ending_of
from executive.run.robot_log import RobotLog
from executive.run.tree_run import TreeRun
from executive.run.visitor import RunEntry, RunShared, TickNote
from executive.run.watchdog import VerbHung
from executive.run.work import CountedDetector
from executive.tree.board import Board
from executive.tree.compiler import CompiledTree
from executive.tree.context import RunContext
from executive.tree.node import NodeState, Snapshot
from executive.tree.nodes.skill_leaf import ERROR_TOPIC
from executive.tree.plan import start_key
from executive.words.schemas import OUTCOME
from executive.words.slug import slug
from skills.api import Cause
from skills.doorway import look_at_doors
from skills.footprint import Footprint
from skills.inputs.errors import shortage
from skills.robot import Lease, Pose2D

HOLDER: Final = "errand"
_NO_LEASE: Final = Lease("", "", 0)
LOOK_PERIOD_S: Final = 1.0
"""Time between two looks at the doors in view."""
LEASE_PATIENCE_S: Final = 60.0
SILENT_S: Final = 3.0
_EPSILON_S: Final = 1e-9
ResultT = TypeVar("ResultT")


class RunRobot:
    """Robot in a run, with or without a mission.

    `context` is what the robot's tree may use, under the present lease. `pose` is the pose estimated when the robot
    last sensed (None: not localised).
    """

    def __init__(self, entry: RunEntry, shared: RunShared) -> None:
        """Adds the robot to the table of traffic. Raises the errors of the robot's verbs."""
        self.name: Final = entry.robot.name
        limits, self._traffic = shared.settings, shared.traffic
        self.pose: Pose2D | None = None
        self._guarded = GuardedRobot(
            entry.robot, shared.watchdog, limit_s=limits.verb_limit_s, image_limit_s=limits.image_limit_s
        )
        self._traffic.join(self.name, Footprint.of(self._guarded.capabilities()).discs)
        self.context = self._context(entry, shared)

    def _context(self, entry: RunEntry, shared: RunShared) -> RunContext:
        """Context for the robot's tree, without a lease."""
        name, control, publish = self.name, shared.control, shared.visitors.publish
        return RunContext(
            robot=self._guarded,
            lease=_NO_LEASE,
            clock=shared.clock,
            worker=shared.worker,
            localiser=entry.localiser,
            costmap=entry.costmap,
            publish=lambda topic, message: publish(topic, {"robot": name, **message}),
            seed=shared.settings.seed,
            board=Board(slug(entry.tree.robot_name)),
            ask=lambda question: control.ask(question, shared.clock, name),
            listen=lambda: control.listen(name),
            stop_pressed=lambda: control.stop_pressed(name),
            presses=lambda: control.presses,
            day_began_s=shared.day_began_s,
            detector=CountedDetector(entry.detector, shared.work),
            work=shared.work,
            stack=entry.stack,
            doors=entry.tree.doors,
            tags=entry.tree.tags,
            zones=entry.tree.zones,
            solid_columns=entry.solid_columns,
            traffic=shared.traffic.view_of(name),
        )

    def status(self, *, now: bool = False) -> RobotStatus:
        """Reads the robot's pose (as last sensed, or with `now` as estimated now), gripper and battery.

        Raises the errors of the robot's verbs.
        """
        robot, pose = self.context.robot, self.context.known_pose() if now else self.pose
        return RobotStatus(pose, robot.gripper().holding, robot.battery().charge)

    def sense(self) -> None:
        """Updates the estimators, and reports the estimated pose to the other robots."""
        context = self.context
        if estimators := context.robot_excluders:
            covered_W = self._traffic.covered_W(self.name)
            for estimator in estimators:
                estimator.exclude_robots(covered_W)
        context.localiser.update(context.robot)
        estimate = context.localiser.estimate()
        context.costmap.update(context.robot, estimate)
        self.pose = context.known_pose()
        self._traffic.report(self.name, self.pose)

    def claim(self) -> RunContext:
        """Claims the lease; returns the context under this lease. Raises LeaseError if the lease is taken."""
        self.context = replace(self.context, lease=self._guarded.claim(HOLDER))
        return self.context

    def stop_and_leave(self) -> None:
        """Stops the robot and returns its lease. Never raises."""
        context = self.context
        self.attempt("stop the robot", lambda: context.robot.stop(lease=context.lease))
        self.attempt("return the lease", self._guarded.give_lease_back)

    def attempt(self, what: str, call: Callable[[], object]) -> bool:
        """Calls `call` and returns whether it succeeded; logs an error instead of raising it."""
        try:
            call()
        except (Exception, VerbHung):
            self.context.publish(ERROR_TOPIC, {"node": self.name, "what": what, "traceback": traceback.format_exc()})
            return False
        return True


class Session(RunRobot):
    """Robot with a mission. The runner calls `sense`, `may_move` and `tick` or `hold` in turn until `finished`, then
    `close`.

    `gone` is the reason why the robot is not used after its mission: it lost its lease, or a verb failed. `note`
    holds the changes that the last tick made in the mission that the robot began with.
    """

    def __init__(self, entry: RunEntry, shared: RunShared) -> None:
        """Claims the lease and begins the mission. Raises LeaseError, and the errors of the robot's verbs."""
        super().__init__(entry, shared)
        context = self.claim()
        try:
            if entry.speaker_W is not None:
                context.board.put(start_key(entry.tree.robot_name, entry.tree.mission_name), entry.speaker_W)
            self._stack: tuple[TreeRun, ...] = (TreeRun(entry.tree, context, shared.visitors),)
        except BaseException:
            self._guarded.give_lease_back()
            raise
        self._after, self._real, self._held, self._lost_because = entry.after, entry.real, False, ""
        self._paused_because: str | None = None
        self._control, self._visitors = shared.control, shared.visitors
        self._given_up: tuple[TreeRun, ...] = ()
        self._lost_since_s: float | None = None
        self._preempting: tuple[RobotResult, ...] = ()
        self._later: tuple[CompiledTree, ...] = ()
        self._cancelled: tuple[Ending, float] | None = None  # and the latest time (s) at which it is over
        self.result: RobotResult | None = None
        self.gone: str | None = None
        self.note: TickNote | None = None
        self._asked_at: Pose2D | None = None
        self._log = RobotLog(self.name, self.context)
        self._matched_s, self._look_due_s = -math.inf, shared.clock.now()

    @property
    def tree(self) -> CompiledTree:
        """Tree of the mission under way."""
        return self._top.tree

    @property
    def states(self) -> Snapshot:
        """States of all nodes, including those of suspended missions."""
        if len(self._stack) == 1:
            return self._top.states
        merged: dict[str, NodeState] = {}
        for run in self._stack:
            merged |= run.states
        return merged

    @property
    def finished(self) -> bool:
        """Returns whether the robot's first mission and all later missions have ended."""
        return self.result is not None or (len(self._stack) == 1 and self._top.finished and not self._later)

    @property
    def waiting_at(self) -> str | None:
        """Path id of the breakpoint at which the mission under way waits."""
        return self._top.waiting_at

    def call_guarded(self, call: Callable[[], ResultT]) -> ResultT | None:
        """Returns the call's result; if it fails, ends the mission and returns None. Raises what a shortage caused."""
        try:
            return call()
        except (Exception, VerbHung) as stop:
            if shortage(stop):
                raise
            ending = ending_of(stop, self._visitors.publish)
            self.gone = ending.message
            self.close(ending)
            return None

    def has_its_turn(self, results: Mapping[str, RobotResult]) -> bool:
        """Returns whether the missions that come first have succeeded; ends this mission if one of them has failed."""
        for name in self._after:
            if name not in results:
                return False
            if results[name].outcome is not Outcome.SUCCESS:
                message = f"{name} did not finish the part that comes first: {results[name].message}"
                self.close(Ending(Outcome.FAILURE, Cause.PRECONDITION, message))
                return False
        return True

    def sense(self) -> None:
        """Updates the estimators, counts scan matches, looks at the doors once a second, and writes the robot's log."""
        super().sense()
        self._asked_at = self._asked_at or self.pose
        stamp_s, now_s = self.context.localiser.estimate().stamp_s, self.context.clock.now()
        if stamp_s != self._matched_s:
            self._matched_s = stamp_s
            self.context.work.count("scan_matches")
        if now_s >= self._look_due_s - _EPSILON_S:
            self._look_due_s += LOOK_PERIOD_S
            context = self.context
            look_at_doors(context.doors, context.door_memory, context.robot, context.localiser)
        self._log.write()

    def may_move(self) -> bool:
        """Returns whether the robot has its lease; without a lease, the mission is suspended until one is acquired.

        Raises nothing. After LEASE_PATIENCE_S without the lease, the session is closed with cause EXECUTION. A real
        robot waits as `_paused` says.
        """
        lost, now_s = self._silence() or self._guarded.lease_lost(), self.context.clock.now()
        if self._cancelled is not None and now_s >= self._cancelled[1]:
            self.close()
            return False
        if lost is None:
            self._answers_again()
            return True
        resumed = self._lost_since_s is not None and self._control.pause_reason is None
        if self._lost_since_s is None:
            self._lost_since_s, self._lost_because = now_s, lost
            self._top.suspend()
            if not self._real:
                self._control.note_lease(self.name, lost)
        if self._real:
            return not self._paused(lost, resumed, now_s - self._lost_since_s)
        if self._guarded.regain_lease():
            self._lost_since_s = None
            self._control.note_lease(self.name, None)
            return True
        if now_s - self._lost_since_s > LEASE_PATIENCE_S:
            message = f"{lost} and did not give it back within {LEASE_PATIENCE_S:g} s"
            self._control.note_lease(self.name, None)
            self.gone = message
            self.close(Ending(Outcome.FAILURE, Cause.EXECUTION, message))
        return False

    def _silence(self) -> str | None:
        """Sentence which says that a real robot no longer answers; None if it answers."""
        silent = self._real and self.context.clock.now() - self.context.robot.odometry().stamp_s > SILENT_S
        return f"{self.name} has not answered for {SILENT_S:g} s" if silent else None

    def _paused(self, why: str, resumed: bool, for_s: float) -> bool:
        """Pauses a real robot that another program may move or that does not answer; returns whether the robot waits.

        The lease is acquired when it is free and the operator resumes the run, because only the operator knows whether
        people are near; the run continues by itself when a silent robot answers. An unattended session is closed after
        LEASE_PATIENCE_S.
        """
        if resumed and self._guarded.regain_lease():
            self._lost_since_s = None
            return False
        if self._control.pause_reason in (None, self._paused_because):  # else the operator has paused the run too
            self._paused_because = why
            self._control.pause(why)
        if not self._control.attended and for_s > LEASE_PATIENCE_S:
            reasons = "; ".join(dict.fromkeys((self._lost_because, why)))
            self.gone = f"{reasons}; nobody resumed the mission within {LEASE_PATIENCE_S:g} s"
            self.close(Ending(Outcome.FAILURE, Cause.EXECUTION, self.gone))
        return True

    def _answers_again(self) -> None:
        """Resumes a robot that was silent and answers again, unless the operator has paused it too."""
        if self._lost_since_s is not None:
            self._lost_since_s = None
            if self._control.pause_reason == self._paused_because:
                self._control.resume()

    def tick(self, breakpoints: frozenset[str]) -> bool:
        """Ticks the mission under way once; returns whether a node changed its status. After its end, the mission
        below it continues.

        Steps under `always` come first if they belong to missions that were given up or cancelled.
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
        """When the present mission has ended, continues the mission that it interrupted, or begins the next one."""
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
        """Returns whether the present mission waits for a person to press a button."""
        return self.result is None and self._top.waits_for_people

    @property
    def ends(self) -> bool:
        """Returns whether missions that were ended early still have steps under `always` to run."""
        return self.result is None and any(run.ends for run in self._runs)

    def cancel(self, ending: Ending, limit_s: float) -> None:
        """Ends all missions of this robot at their present step; idempotent.

        Afterwards `tick` runs only the steps under `always` of these missions, for at most `limit_s`.
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
        """Suspends the missions and stops the robot; further calls before the next tick do nothing."""
        if not self._held:
            self._held = True
            for run in self._runs:
                run.suspend()
            if self._lost_since_s is None:
                self.context.robot.stop(lease=self.context.lease)

    def take(self, request: MissionRequest) -> None:
        """Accepts another mission, which begins now, later or in place of a mission, as the request says."""
        tree, old = request.tree, request.instead_of
        if request.turn is Turn.LATER:
            self._later += (tree,)
        elif request.turn is Turn.INSTEAD and any(waiting.mission_name == old for waiting in self._later):
            self._later = tuple(tree if one.mission_name == old else one for one in self._later)
        elif request.turn is Turn.INSTEAD and old in (None, self.tree.mission_name):
            self._replace_top(tree)
        else:
            self.hold()
            self._begin(tree)

    def _replace_top(self, tree: CompiledTree) -> None:
        """Ends the present mission and begins another in its place."""
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
        """Stops the trees and the robot, returns the lease, logs the end. Idempotent; raises nothing."""
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
        """All trees: trees that were given up first, then the present one and the trees that it interrupts."""
        return (*self._given_up, *reversed(self._stack))

    def _start_of(self, run: TreeRun) -> Pose2D | None:
        """Pose at which a mission began: as stored by the mission, else the robot's first pose in the run."""
        key = start_key(run.tree.robot_name, run.tree.mission_name)
        start: Pose2D | None = run.context.board.get(key, self._asked_at)
        return start

    def _begin(self, tree: CompiledTree, start: Pose2D | None = None) -> None:
        self._held = False
        context = replace(self.context, board=Board(slug(tree.robot_name)))
        if start is not None:
            context.board.put(start_key(tree.robot_name, tree.mission_name), start)
        self._stack = (*self._stack, TreeRun(tree, context, self._visitors))
        self._control.mission_begun(self.name, tree)

    def _note_end(self, result: RobotResult) -> None:
        """Records that a mission that interrupted another one has ended."""
        self._control.mission_ended(self.name)
        self._note_result(result)

    def _note_result(self, result: RobotResult) -> None:
        self._preempting += (result,)
        self.context.publish(OUTCOME, {**result.message_of_end(), "mission": result.tree.mission_name})
