"""Motion of SDK programs beside what they ask: base, height, hand and gaze, by the plant's truth. Prints JSON.

    python -m tests.benchmarks.sdk_motion [--examples FOLDER] [--wrapper FOLDER] [--only NAME] [--seed 1]
                                          [--pace real|client] [--python COMMAND]

A program of our own (`sdk_moves.py`) always runs. With the folder of a clone of `spot_wrapper`, by the option or the
variable `ERRAND_SPOT_WRAPPER`, a program of ours drives through it, under the interpreter COMMAND that has what
`spot_wrapper` needs. With the folder of the SDK's examples, by the option or the variable
`ERRAND_SDK_EXAMPLES`, those that move run too, unchanged. Each runs alone against a new server in real time. What a
command asks is read from its message with the SDK's own geometry. It is compared when the server reports that the
command is done; a command that another one replaces before is `cut`, and not compared. What a program says as a whole
stands in `sdk_promises.py`, and is compared with the whole path of body and hand.
"""

import math
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal
from unittest import mock

import numpy as np
from bosdyn.api import arm_command_pb2, basic_command_pb2, robot_command_pb2
from bosdyn.api.spot import robot_command_pb2 as spot_command_pb2
from bosdyn.client.frame_helpers import get_a_tform_b
from bosdyn.client.math_helpers import SE2Pose, SE3Pose
from pydrake.math import RigidTransform, RollPitchYaw

from errand_spot.commands import LAUNCH
from errand_spot.messages import frame_tree, seconds, transform
from errand_spot.server.commands import RobotCommandService
from errand_spot.server.computer import Pace
from errand_spot.server.identity import credentials
from errand_spot.server.server import Options, SpotServer
from executive.app.prepare.placed_robots import only_robot
from executive.app.prepare.worlds import open_world
from executive.app.runs.simulated import compile_first, simulate
from plant.simulation import Simulation
from skills.geometry import compose, inverse
from skills.manipulation.arm.kinematics import arm_model
from skills.robot import Pose2D
from tests.benchmarks.harness import command, show
from tests.benchmarks.sdk_promises import COLUMNS, OWN, PERIOD_S, PROGRAMS, WRAPPER, deviation

EXAMPLES, SPOT_WRAPPER = "ERRAND_SDK_EXAMPLES", "ERRAND_SPOT_WRAPPER"
MOST_M = 0.1
"""Largest error of a motion; of a gaze in rad."""
BASE = ("base", "height", "velocity")
START = Pose2D(8.6, 3.9, 0.0)
"""Place in the living room with free floor around; the world's start has furniture ahead."""
HAND_M = 0.19557
"""Distance of the hand's frame from the wrist's."""
JOINTS = ("sh0", "sh1", "el0", "el1", "wr0", "wr1")
Error = Callable[[], float]
_LIMIT_S = 150.0
_ACHIEVED = basic_command_pb2.SE2TrajectoryCommand.Feedback.FINAL_GOAL_STATUS_ACHIEVABLE


@dataclass
class Asked:
    """One goal of a command: its kind, the error from it (m, or rad), and the status of a feedback when it is done.

    `cut` is the error of one that another command replaces before it is done: from its path at that time, `on_path`,
    where it has one.
    """

    command: int
    kind: str
    error: Error
    feedback: str
    status: int
    on_path: Error | None = None
    error_then: float | None = None
    cut: float | None = None


@dataclass
class Judge:
    """Reads what commands ask, and compares it with the plant when the server says that they are done."""

    server: SpotServer
    simulation: Simulation
    asked: list[Asked] = field(default_factory=list)
    track: list = field(default_factory=list)
    X_WS: RigidTransform | None = None

    def X_W(self, link):
        """True pose of a link."""
        engine = self.simulation.engine
        body = getattr(engine.world.robots["Alice"], link)
        return engine.world.plant.EvalBodyPoseInWorld(engine.context, body)

    def read(self, command, number):
        """Notes what a command asks, between two steps of the plant. Frames are those of the server's last state."""
        snapshot = self.server.computer.snapshot
        tree, named = frame_tree(snapshot.frames), command.synchronized_command
        X_WO = self.X_W("body") @ snapshot.X_AB("body", "odom")
        goals = (*self._base(named.mobility_command, tree, X_WO), *self._arm(named.arm_command, tree, X_WO))
        self.asked += [Asked(number, *each) for each in goals]

    def _base(self, base, tree, X_WO):
        if base.HasField("se2_trajectory_request"):
            request = base.se2_trajectory_request
            odom = get_a_tform_b(tree, "odom", request.se2_frame_name)
            goal = odom.get_closest_se2_transform() * SE2Pose.from_proto(request.trajectory.points[-1].pose)
            done = basic_command_pb2.SE2TrajectoryCommand.Feedback.STATUS_AT_GOAL
            yield "base", self._base_error(X_WO @ np.array([goal.x, goal.y, 0.0])), "se2_trajectory_feedback", done
        if base.HasField("stand_request"):
            params, can = spot_command_pb2.MobilityParams(), self.server.computer.capabilities
            base.params.Unpack(params)
            points = params.body_control.base_offset_rt_footprint.points
            wanted_m = can.standing_height_m + (points[0].pose.position.z if points else 0.0)
            wanted_m = float(np.clip(wanted_m, *can.height_range_m))
            done = basic_command_pb2.StandCommand.Feedback.STATUS_IS_STANDING
            yield "height", lambda: abs(float(self.X_W("body").translation()[2]) - wanted_m), "stand_feedback", done
        if base.HasField("se2_velocity_request") and base.se2_velocity_request.se2_frame_name in ("body", "flat_body"):
            request = base.se2_velocity_request
            lasts_s = seconds(request.end_time) - self.server.computer.now_s()
            (x, y), w = (request.velocity.linear.x, request.velocity.linear.y), request.velocity.angular
            turned = w * lasts_s
            along, aside = (math.sin(turned) / w, (1.0 - math.cos(turned)) / w) if abs(w) > 1e-6 else (lasts_s, 0.0)
            moved = np.array([along * x - aside * y, aside * x + along * y, 0.0])
            done = basic_command_pb2.RobotCommandFeedbackStatus.STATUS_COMMAND_TIMED_OUT
            yield "velocity", self._base_error(self.X_W("body") @ moved), "", done

    def _base_error(self, at_W):
        return lambda: float(np.linalg.norm(self.X_W("body").translation()[:2] - at_W[:2]))

    def _arm(self, arm, tree, X_WO):
        if arm.HasField("arm_cartesian_command"):
            request, one = arm.arm_cartesian_command, SE3Pose.from_identity()
            tool, task = SE3Pose(HAND_M, 0.0, 0.0, one.rot), one
            if request.HasField("wrist_tform_tool"):
                tool = SE3Pose.from_proto(request.wrist_tform_tool)
            if request.HasField("root_tform_task"):
                task = SE3Pose.from_proto(request.root_tform_task)
            stays, trajectory = request.root_frame_name in ("odom", "vision"), request.pose_trajectory_in_task
            root = get_a_tform_b(tree, "odom" if stays else "body", request.root_frame_name) * task
            X_HT = transform(tool.to_proto(), "tool")
            X_FT = [transform((root * SE3Pose.from_proto(p.pose)).to_proto(), "goal") for p in trajectory.points]
            path_W = [(X_WO @ X).translation() for X in X_FT]
            done = arm_command_pb2.ArmCartesianCommand.Feedback.STATUS_TRAJECTORY_COMPLETE
            on_path = self._off_path(trajectory, path_W, lambda p_W: self._hand_error_m(p_W, X_HT)) if stays else None

            def error():
                X_WF = X_WO if stays else self.X_W("body")
                return self._hand_error_m((X_WF @ X_FT[-1]).translation(), X_HT)

            yield "hand", error, "arm_cartesian_feedback", done, on_path
        if arm.HasField("arm_joint_move_command"):
            trajectory, model = arm.arm_joint_move_command.trajectory, arm_model(self.server.computer.capabilities)
            q = [self.server.computer.arm_rad()]
            for each in trajectory.points:  # an omitted joint keeps its angle
                given = [each.position.HasField(name) for name in JOINTS]
                q.append(np.where(given, [getattr(each.position, name).value for name in JOINTS], q[-1]))
            q = q[1:]

            def joint_error(wanted):
                return self._hand_error_m((self.X_W("body") @ model.X_BH(wanted)).translation())

            done = arm_command_pb2.ArmJointMoveCommand.Feedback.STATUS_COMPLETE
            on_path = self._off_path(trajectory, q, joint_error)
            yield "joints", lambda: joint_error(q[-1]), "arm_joint_move_feedback", done, on_path
        if arm.HasField("arm_gaze_command"):
            request = arm.arm_gaze_command
            point = request.target_trajectory_in_frame1.points[-1].point
            target = get_a_tform_b(tree, "odom", request.frame1_name).transform_point(point.x, point.y, point.z)
            done = arm_command_pb2.GazeCommand.Feedback.STATUS_TRAJECTORY_COMPLETE
            yield "gaze", self._gaze_error(X_WO @ np.array(target)), "arm_gaze_feedback", done

    def _hand_error_m(self, p_W, X_HT=RigidTransform()):  # noqa: B008
        return float(np.linalg.norm((self.X_W("hand") @ X_HT).translation() - p_W))

    def _off_path(self, trajectory, values, error):
        """Error from the point of a timed path at the present time; None for a path without times."""
        if not trajectory.HasField("reference_time"):
            return None
        begun_s = seconds(trajectory.reference_time)
        times_s = [begun_s + seconds(each.time_since_reference) for each in trajectory.points]
        columns = np.array(values).T
        return lambda: error(np.array([np.interp(self.server.computer.now_s(), times_s, each) for each in columns]))

    def _gaze_error(self, target_W):
        def error():
            away = (self.X_W("hand") @ RigidTransform([HAND_M, 0.0, 0.0])).inverse() @ target_W
            return float(math.atan2(math.hypot(away[1], away[2]), away[0]))

        return error

    def look(self, service):
        """Compares what is done now, and records the track; called before each step of the plant."""
        now_s = self.server.computer.clock.now()
        if self.asked and (not self.track or now_s - self.track[-1][0] > PERIOD_S - 1e-6):
            self.track.append((now_s, self._row()))
        for each in (each for each in self.asked if each.error_then is None and each.cut is None):
            request = robot_command_pb2.RobotCommandFeedbackRequest(robot_command_id=each.command)
            told = service.RobotCommandFeedback(request, None).feedback.synchronized_feedback
            part = told.mobility_command_feedback if each.kind in BASE else told.arm_command_feedback
            done = getattr(part, each.feedback) if each.feedback else part
            if done.status == each.status and getattr(done, "final_goal_status", _ACHIEVED) == _ACHIEVED:
                each.error_then = each.error()
            elif part.status == basic_command_pb2.RobotCommandFeedbackStatus.STATUS_COMMAND_OVERRIDDEN:
                each.cut = (each.on_path or each.error)()

    def _row(self):
        """The values of `COLUMNS` now."""
        X_WB, X_WH = self.X_W("body"), self.X_W("hand") @ RigidTransform([HAND_M, 0.0, 0.0])
        if self.X_WS is None:
            self.X_WS = Pose2D.from_transform(X_WB).transform(self.server.computer.capabilities.standing_height_m)
        X_SB, X_SH = self.X_WS.InvertAndCompose(X_WB), self.X_WS.InvertAndCompose(X_WH)
        angles, held = RollPitchYaw(X_SB.rotation()).vector(), X_WB.InvertAndCompose(X_WH)
        return np.concatenate([X_SB.translation(), angles, X_SH.translation(), held.translation()])


@contextmanager
def judged(seed, start=START, pace=Pace.REAL):
    """Serves a simulated Spot whose commands are judged; the caller runs `server.computer`."""
    opened = open_world("flat")
    compile_first()
    robots = {"Alice": only_robot("Alice", opened, seed=seed, start=start)}
    simulation = simulate(opened, robots, seed=seed, record=False)
    robot, judges = simulation.robots["Alice"], []
    take = RobotCommandService.RobotCommand

    def taken(service, request, call):
        answer = take(service, request, call)
        if answer.robot_command_id:
            judges[0].server.computer.do(lambda: judges[0].read(request.command, answer.robot_command_id)).result()
        return answer

    with tempfile.TemporaryDirectory() as folder, mock.patch.object(RobotCommandService, "RobotCommand", taken):
        solver = arm_model(robot.capabilities())
        dock_O = compose(inverse(start), robots["Alice"].dock)
        options = Options({"user": "simulated"}, dock_O=dock_O, pace=pace)
        server = SpotServer(robot, simulation.clock, solver, credentials(Path(folder)), options)
        judges.append(Judge(server, simulation))
        service = next(each for each in server.services if isinstance(each, RobotCommandService))
        server.computer.watchers.append(lambda: judges[0].look(service))
        with server.running():
            yield judges[0]


def run(program, folder, *, seed=1, pace=Pace.REAL, python=sys.executable, imports=()):
    """Runs one program of a folder to its end; returns its exit code, the errors by kind, and those of its promises.

    The program may import from the folders `imports`.
    """
    script, *arguments = f"{folder}/{program.line}".split()
    code, ended, pace = [], threading.Event(), Pace.REAL if program.real_time else pace
    with judged(seed, START if program.start is None else Pose2D(*program.start), pace) as judge:
        server = judge.server
        user = {"BOSDYN_CLIENT_USERNAME": "user", "BOSDYN_CLIENT_PASSWORD": "simulated"}
        path = os.pathsep.join([*map(str, imports), os.environ.get("PYTHONPATH", "")])
        launch = [python, LAUNCH, str(server.certificate), str(server.port)]

        def execute():
            line = [*launch, pace.value, script, *arguments, "127.0.0.1"]
            environment = {**os.environ, **user, "PYTHONPATH": path}
            try:
                with tempfile.TemporaryDirectory() as folder:
                    done = subprocess.run(line, env=environment, cwd=folder, capture_output=True, timeout=_LIMIT_S)
                code.append(done.returncode)
            except subprocess.TimeoutExpired:
                code.append(124)
            finally:
                ended.set()

        thread = threading.Thread(target=execute)
        thread.start()
        (server.computer.run if pace is Pace.REAL else server.computer.serve)(ended)
        thread.join()
        compared = [each for each in judge.asked if each.error_then is not None]
        kinds = sorted({each.kind for each in compared})
        worst = {kind: max(e.error_then or 0.0 for e in compared if e.kind == kind) for kind in kinds}
        track = np.array([row for _, row in judge.track] or [np.zeros(len(COLUMNS))])
        off = [deviation(track, promise) for promise in program.promises]
        kept = all(error < promise.most for error, promise in zip(off, program.promises, strict=True))
        return {
            "program": program.line,
            "exit_code": code[0],
            "compared": len(compared),
            "cut": [(each.kind, each.cut and round(each.cut, 3)) for each in judge.asked if each.error_then is None],
            "worst": {kind: round(error, 3) for kind, error in worst.items()},
            "promises": [(p.columns, round(error, 3), p.most) for p, error in zip(program.promises, off, strict=True)],
            "ended": code[0] == program.exit_code,
            "true": bool(compared or off) and kept and all(error < MOST_M for error in worst.values()),
        }


def measure(
    examples: Path | None = Path(os.environ[EXAMPLES]) if EXAMPLES in os.environ else None,
    wrapper: Path | None = Path(os.environ[SPOT_WRAPPER]) if SPOT_WRAPPER in os.environ else None,
    only: str = "",
    seed: int = 1,
    pace: Literal["real", "client"] = "real",
    python: str = sys.executable,
):
    own = [OWN, *([WRAPPER] if wrapper else [])]
    programs = [*((each, Path(__file__).parent) for each in own), *((each, examples) for each in PROGRAMS if examples)]
    results, imports = [], [wrapper] if wrapper else []
    for program, folder in programs:
        if only in program.line:
            results.append(run(program, folder, seed=seed, pace=Pace(pace), python=python, imports=imports))
            show(results[-1])
    return {"programs": len(results), "ended_and_true": sum(each["true"] and each["ended"] for each in results)}


if __name__ == "__main__":
    command(measure)
