"""One robot's missions in a run: their turns, their ticks, and the orderly end."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final, TypeVar

import numpy as np

from executive.record.schemas import DOORS, JOINTS, NAVIGATION, OUTCOME, POSE, SCAN, STATE, stamp
from executive.run.control_state import MissionRequest, Turn
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
from skills.api import Cause, LocalisationEstimate, ObstacleLayerView, ParticleView
from skills.doorway import Doorway, SeenDoor
from skills.inputs.errors import disk_is_full
from skills.navigate.cut_off import DoorWatch
from skills.robot import Pose2D

POSE_PERIOD_S: Final = 0.5
SENSORS_PERIOD_S: Final = 1.0
DOORS_PERIOD_S: Final = 10.0
"""Steps of time in which the log has the age of what is known of a door."""
MOST_PARTICLES: Final = 30
LEASE_PATIENCE_S: Final = 60.0
SILENT_S: Final = 3.0
_EPSILON_S: Final = 1e-9
_NOTHING: Final = np.empty((0, 2))
ResultT = TypeVar("ResultT")


class Session(RunRobot):
    """Robot with a mission. The runner calls `sense`, `may_move` and `tick` or `hold` in turn until `finished`, then
    `close`.

    `gone` is the reason why the robot is left alone after its mission: its lease is lost, or a verb failed. `note`
    holds the changes that the last tick made in the mission that the robot began with.
    """

    def __init__(self, entry: RunEntry, shared: RunShared) -> None:
        """Begins the mission under the robot's lease. Raises LeaseError, and the errors of the robot's verbs."""
        super().__init__(entry, shared)
        context = self.claim()
        try:
            if entry.speaker_W is not None:
                context.board.put(start_key(entry.tree.robot_name, entry.tree.mission_name), entry.speaker_W)
            self._stack: tuple[TreeRun, ...] = (TreeRun(entry.tree, context, shared.visitors),)
        except BaseException:
            self._guarded.give_lease_back()
            raise
        self._after, self._real = entry.after, entry.real
        self._paused_because: str | None = None
        self._control, self._visitors = shared.control, shared.visitors
        self._given_up: tuple[TreeRun, ...] = ()
        self._held = False
        self._lost_since_s: float | None = None
        self._preempting: tuple[RobotResult, ...] = ()
        self._later: tuple[CompiledTree, ...] = ()
        self._cancelled: tuple[Ending, float] | None = None  # and the latest time (s) at which it is over
        self.result: RobotResult | None = None
        self.gone: str | None = None
        self.note: TickNote | None = None
        self._asked_at: Pose2D | None = None
        self._pose_due_s = self._sensors_due_s = shared.clock.now()
        self._matched_s = -math.inf
        self._navigation: Mapping[str, object] = {}
        self._doors = DoorWatch(self.context)
        self._known_doors: tuple[tuple[str, float], ...] = ()

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
        """Returns whether the mission that the robot began with, and all that come after it, have ended."""
        return self.result is not None or (len(self._stack) == 1 and self._top.finished and not self._later)

    @property
    def waiting_at(self) -> str | None:
        """Path id of the breakpoint at which the mission under way waits."""
        return self._top.waiting_at

    def call_guarded(self, call: Callable[[], ResultT]) -> ResultT | None:
        """Returns the call's result, or None where it fails, which ends the mission. Raises OSError for a full disk."""
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
        """Returns whether the robots that the mission waits for are done; ends the mission when one of them failed."""
        for name in self._after:
            if name not in results:
                return False
            if results[name].outcome is not Outcome.SUCCESS:
                message = f"{name} did not finish the part that comes first: {results[name].message}"
                self.close(Ending(Outcome.FAILURE, Cause.PRECONDITION, message))
                return False
        return True

    def sense(self) -> None:
        """Updates the estimators, counts new scan matches, and logs pose and state twice a second."""
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
        if context.clock.now() >= self._sensors_due_s - _EPSILON_S:
            self._sensors_due_s += SENSORS_PERIOD_S
            self._publish_sensors()
            self._watch_doors()

    def may_move(self) -> bool:
        """Returns whether the robot has its lease; a lost lease suspends the mission until the robot has it again.

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
            self._lost_since_s = now_s
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
        """Says that a real robot has not answered for a while; None when it has."""
        silent = self._real and self.context.clock.now() - self.context.robot.odometry().stamp_s > SILENT_S
        return f"{self.name} has not answered for {SILENT_S:g} s" if silent else None

    def _paused(self, why: str, resumed: bool, for_s: float) -> bool:
        """Pauses the run of a real robot that another program may move, or that is silent; returns whether it waits.

        The lease is acquired when it is free and the operator resumes the run, because nobody else knows whether people
        are near; the run goes on by itself when a silent robot answers. An unattended session is closed after
        LEASE_PATIENCE_S.
        """
        if resumed and self._guarded.regain_lease():
            self._lost_since_s = None
            return False
        if self._control.pause_reason in (None, self._paused_because):  # else the operator has paused the run too
            self._paused_because = why
            self._control.pause(why)
        if not self._control.attended and for_s > LEASE_PATIENCE_S:
            self.gone = f"{why}; nobody resumed the mission within {LEASE_PATIENCE_S:g} s"
            self.close(Ending(Outcome.FAILURE, Cause.EXECUTION, self.gone))
        return True

    def _answers_again(self) -> None:
        """Ends the pause of a robot that was silent, unless the operator has paused it too."""
        if self._lost_since_s is not None:
            self._lost_since_s = None
            if self._control.pause_reason == self._paused_because:
                self._control.resume()

    def tick(self, breakpoints: frozenset[str]) -> bool:
        """Ticks the mission under way once; returns whether a node changed its status. After its end, the mission
        below it continues.

        Steps under `always` of missions that were given up or cancelled come first.
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
        """Continues the mission below the one under way after its end, or begins the next."""
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
        """Returns whether the mission under way waits for somebody to press a button."""
        return self.result is None and self._top.waits_for_people

    @property
    def ends(self) -> bool:
        """Returns whether missions that were ended early still run their steps under `always`."""
        return self.result is None and any(run.ends for run in self._runs)

    def cancel(self, ending: Ending, limit_s: float) -> None:
        """Ends all missions of this robot where they are; idempotent.

        `tick` runs their steps under `always`, for `limit_s` at most.
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
        """Suspends the missions and stops the robot, once until the next tick."""
        if not self._held:
            self._held = True
            for run in self._runs:
                run.suspend()
            if self._lost_since_s is None:
                self.context.robot.stop(lease=self.context.lease)

    def take(self, request: MissionRequest) -> None:
        """Takes one more mission in its turn; a mission that waits, or takes the place of another, has its start."""
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
        """Gives up the present mission and begins another in its place."""
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
        """All trees: those that were given up first, then the one under way and those below it."""
        return (*self._given_up, *reversed(self._stack))

    def _start_of(self, run: TreeRun) -> Pose2D | None:
        """Pose at which a mission began: the one that it noted, else the robot's first pose in the run."""
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
        """Notes that a mission that came in between is over."""
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
        """Logs the gripper, the battery, the speed, and the quality of the localisation."""
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

    def _publish_sensors(self) -> None:
        """Logs the joints and the latest LiDAR scan."""
        robot = self.context.robot
        self.context.publish(JOINTS, {"robot": self.name, "joints": robot.joints()})
        if (scan := robot.scan()) is not None:
            self.context.publish(SCAN, {"robot": self.name, "scan": scan})

    def _publish_navigation(self) -> None:
        """Logs particles of the localiser and obstacles that the map lacks (x, y in m), when either is new."""
        localiser, costmap = self.context.localiser, self.context.costmap
        particles = localiser.particles_W(MOST_PARTICLES) if isinstance(localiser, ParticleView) else _NOTHING
        seen = costmap.obstacle_cells() if isinstance(costmap, ObstacleLayerView) else _NOTHING
        columns = np.round(np.concatenate([particles[:, :2].T, seen.T], axis=1), 2)
        (x, y), count = columns.tolist(), len(particles)
        new = {"particle_x": x[:count], "particle_y": y[:count], "seen_x": x[count:], "seen_y": y[count:]}
        if new != self._navigation:
            self._navigation = new
            self.context.publish(NAVIGATION, {"robot": self.name, **new})

    def _watch_doors(self) -> None:
        """Looks at the doors in view; logs the states of all doors when the memory of one is new."""
        self._doors.look()
        doors, memory = self.context.doors, self.context.door_memory
        seen = [memory.last_seen(door) for door in doors]
        known = tuple((one.state.value, max(one.seen_s, 0.0) // DOORS_PERIOD_S) for one in seen)
        if known != self._known_doors:
            self._known_doors = known
            self.context.publish(DOORS, {"robot": self.name, "doors": list(map(_door_message, doors, seen))})


def _door_message(door: Doorway, seen: SeenDoor) -> Mapping[str, object]:
    """State of a door for the log: its two ends (x, y) in metres, and the time when the robot saw it (s)."""
    ends = [[round(float(value), 3) for value in end] for end in door.ends()]
    seen_s = round(seen.seen_s, 1) if math.isfinite(seen.seen_s) else None
    return {"between": list(door.between), "ends": ends, "state": seen.state.value, "seen_s": seen_s}
