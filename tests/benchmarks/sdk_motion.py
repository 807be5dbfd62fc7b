"""Motion of SDK programs beside what they ask: base, height, hand and gaze, by the plant's truth. Prints JSON.

    python -m tests.benchmarks.sdk_motion [--examples FOLDER] [--only NAME] [--seed 1]

A program of our own (`sdk_moves.py`) always runs. With the folder of the SDK's examples, by the option or the variable
`ERRAND_SDK_EXAMPLES`, those that move run too, unchanged. Each runs alone against a new server in real time. What a
command asks is read from its message with the SDK's own geometry. It is compared when the server reports that the
command is done; a command that another one replaces before is `cut`, and not compared.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final
from unittest import mock

import numpy as np
from bosdyn.api import arm_command_pb2, basic_command_pb2, robot_command_pb2
from bosdyn.api.spot import robot_command_pb2 as spot_command_pb2
from bosdyn.client.frame_helpers import get_a_tform_b
from bosdyn.client.math_helpers import SE2Pose, SE3Pose
from pydrake.math import RigidTransform, RotationMatrix

from executive.app.placed_robots import only_robot
from executive.app.simulated import compile_first, simulate
from executive.app.worlds import open_world
from plant.simulation import Simulation
from plant.spot_api.messages import frame_tree, seconds, transform
from plant.spot_api.server.commands import RobotCommandService
from plant.spot_api.server.identity import credentials
from plant.spot_api.server.server import Options, SpotServer
from skills.manipulation.arm.kinematics import arm_model
from skills.robot import Pose2D

EXAMPLES: Final = "ERRAND_SDK_EXAMPLES"
OWN: Final = Path(__file__).with_name("sdk_moves.py")
PROGRAMS: Final = (
    "hello_spot/hello_spot.py",
    "frame_trajectory_command/frame_trajectory_command.py --dx 0.6 --frame odom",
    "frame_trajectory_command/frame_trajectory_command.py --dyaw 0.8 --frame vision",
    "arm_simple/arm_simple.py",
    "arm_stow_unstow/arm_stow_unstow.py",
    "arm_joint_move/arm_joint_move.py",
    "arm_joint_move/arm_joint_long_trajectory.py",
    "arm_trajectory/arm_trajectory.py",
    "arm_trajectory/arm_long_cartesian_trajectory.py",
    "arm_and_mobility_command/arm_and_mobility_command.py",
    "arm_gaze/arm_gaze.py",
    "arm_with_body_follow/arm_with_body_follow.py",
)
ENDS_WITH_1: Final = ("arm_joint_long_trajectory.py",)
"""Examples whose own last line ends them with 1 whatever has happened."""
MOST_M: Final = 0.1
"""Largest error of a motion; of a gaze in rad."""
BASE: Final = ("base", "height", "velocity")
START: Final = Pose2D(8.6, 3.9, 0.0)
"""Place in the living room with free floor around; the world's start has furniture ahead."""
JOINTS: Final = ("sh0", "sh1", "el0", "el1", "wr0", "wr1")
Error = Callable[[], float]
_LIMIT_S: Final = 150.0


@dataclass
class Asked:
    """One goal of a command: its kind, the error from it, whether it is done, and the error then (m, or rad).

    `cut` is the error of one that another command replaces before it is done: from its path at that time, `on_path`,
    where it has one.
    """

    command: int
    kind: str
    error: Error
    done: Callable[[Any], bool]
    on_path: Error | None = None
    error_then: float | None = None
    cut: float | None = None


@dataclass
class Judge:
    """Reads what commands ask, and compares it with the plant when the server says that they are done."""

    server: SpotServer
    simulation: Simulation
    asked: list[Asked] = field(default_factory=list)

    def X_WB(self) -> RigidTransform:
        """True pose of the body."""
        return self._pose("body")

    def X_WH(self) -> RigidTransform:
        """True pose of the hand."""
        return self._pose("hand")

    def _pose(self, link: str) -> RigidTransform:
        engine = self.simulation.engine
        body = getattr(engine.world.robots["Alice"], link)
        return engine.world.plant.EvalBodyPoseInWorld(engine.context, body)

    def read(self, command: Any, number: int) -> None:
        """Notes what a command asks, between two steps of the plant. Frames are those of the server's last state."""
        snapshot = self.server.computer.snapshot
        tree, named = frame_tree(snapshot.frames), command.synchronized_command
        X_WO = self.X_WB() @ snapshot.X_AB("body", "odom")
        self.asked += [Asked(number, *each) for each in (*self._base(named, tree, X_WO), *self._arm(named, tree, X_WO))]

    def _base(self, named: Any, tree: Any, X_WO: RigidTransform) -> Iterator[tuple[Any, ...]]:
        base, part = named.mobility_command, basic_command_pb2
        if base.HasField("se2_trajectory_request"):
            request = base.se2_trajectory_request
            odom = get_a_tform_b(tree, "odom", request.se2_frame_name)
            goal = odom.get_closest_se2_transform() * SE2Pose.from_proto(request.trajectory.points[-1].pose)
            at_W = (X_WO @ np.array([goal.x, goal.y, 0.0]))[:2]
            done = part.SE2TrajectoryCommand.Feedback.STATUS_AT_GOAL
            yield (
                "base",
                self._base_error(at_W),
                lambda told: told.mobility_command_feedback.se2_trajectory_feedback.status == done,
            )
        if base.HasField("stand_request"):
            params = spot_command_pb2.MobilityParams()
            base.params.Unpack(params)
            points = params.body_control.base_offset_rt_footprint.points
            can = self.server.computer.capabilities
            wanted_m = can.standing_height_m + (points[0].pose.position.z if points else 0.0)
            wanted_m = float(np.clip(wanted_m, *can.height_range_m))
            done = part.StandCommand.Feedback.STATUS_IS_STANDING
            yield (
                "height",
                lambda: abs(float(self.X_WB().translation()[2]) - wanted_m),
                lambda told: told.mobility_command_feedback.stand_feedback.status == done,
            )
        if base.HasField("se2_velocity_request") and base.se2_velocity_request.se2_frame_name in ("body", "flat_body"):
            request = base.se2_velocity_request
            lasts_s = seconds(request.end_time) - self.server.computer.now_s()
            v, w = np.array([request.velocity.linear.x, request.velocity.linear.y]), request.velocity.angular
            turned = w * lasts_s
            along, aside = (math.sin(turned) / w, (1.0 - math.cos(turned)) / w) if abs(w) > 1e-6 else (lasts_s, 0.0)
            moved = [along * v[0] - aside * v[1], aside * v[0] + along * v[1], 0.0]
            at_W = (self.X_WB() @ np.array(moved))[:2]
            done = part.RobotCommandFeedbackStatus.STATUS_COMMAND_TIMED_OUT
            yield "velocity", self._base_error(at_W), lambda told: told.mobility_command_feedback.status == done

    def _base_error(self, at_W: Any) -> Error:
        return lambda: float(np.linalg.norm(self.X_WB().translation()[:2] - at_W))

    def _arm(self, named: Any, tree: Any, X_WO: RigidTransform) -> Iterator[tuple[Any, ...]]:
        arm, part = named.arm_command, arm_command_pb2

        def hand_error(X_FH: RigidTransform, X_WF: Callable[[], RigidTransform], X_HT: RigidTransform) -> Error:
            return lambda: float(
                np.linalg.norm((self.X_WH() @ X_HT).translation() - (X_WF() @ X_FH @ X_HT).translation())
            )

        if arm.HasField("arm_cartesian_command"):
            request = arm.arm_cartesian_command
            tool = SE3Pose(0.19557, 0.0, 0.0, SE3Pose.from_identity().rot)
            if request.HasField("wrist_tform_tool"):
                tool = SE3Pose.from_proto(request.wrist_tform_tool)
            stays = request.root_frame_name in ("odom", "vision")
            root = get_a_tform_b(tree, "odom" if stays else "body", request.root_frame_name)
            task = SE3Pose.from_proto(request.root_tform_task)
            if not request.HasField("root_tform_task"):
                task = SE3Pose.from_identity()
            points = request.pose_trajectory_in_task.points
            goal = root * task * SE3Pose.from_proto(points[-1].pose)
            X_HT = transform(tool.to_proto(), "tool")
            X_FH = transform(goal.to_proto(), "goal") @ X_HT.inverse()
            done = part.ArmCartesianCommand.Feedback.STATUS_TRAJECTORY_COMPLETE
            yield (
                "hand",
                hand_error(X_FH, (lambda: X_WO) if stays else self.X_WB, X_HT),
                lambda told: told.arm_command_feedback.arm_cartesian_feedback.status == done,
                self._off_path(
                    request.pose_trajectory_in_task,
                    [
                        (X_WO @ transform((root * task * SE3Pose.from_proto(each.pose)).to_proto(), "")).translation()
                        for each in points
                    ],
                    lambda wanted_W: float(np.linalg.norm((self.X_WH() @ X_HT).translation() - wanted_W)),
                )
                if stays
                else None,
            )
        if arm.HasField("arm_joint_move_command"):
            trajectory, model = arm.arm_joint_move_command.trajectory, arm_model(self.server.computer.capabilities)
            q = [np.array([getattr(each.position, name).value for name in JOINTS]) for each in trajectory.points]
            X_BH = model.X_BH(q[-1])
            done = part.ArmJointMoveCommand.Feedback.STATUS_COMPLETE
            yield (
                "joints",
                hand_error(X_BH, self.X_WB, RigidTransform()),
                lambda told: told.arm_command_feedback.arm_joint_move_feedback.status == done,
                self._off_path(
                    trajectory, q, lambda wanted: hand_error(model.X_BH(wanted), self.X_WB, RigidTransform())()
                ),
            )
        if arm.HasField("arm_gaze_command"):
            request = arm.arm_gaze_command
            point = request.target_trajectory_in_frame1.points[-1].point
            x, y, z = get_a_tform_b(tree, "odom", request.frame1_name).transform_point(point.x, point.y, point.z)
            done = part.GazeCommand.Feedback.STATUS_TRAJECTORY_COMPLETE
            yield (
                "gaze",
                self._gaze_error(np.asarray(X_WO @ np.array([x, y, z]))),
                lambda told: told.arm_command_feedback.arm_gaze_feedback.status == done,
            )

    def _off_path(self, trajectory: Any, values: Sequence[Any], error: Callable[[Any], float]) -> Error | None:
        """Error from the point of a timed path at the present time; None for a path without times."""
        if not trajectory.HasField("reference_time"):
            return None
        begun_s = seconds(trajectory.reference_time)
        times_s = [begun_s + seconds(each.time_since_reference) for each in trajectory.points]
        columns = np.array(values).T
        return lambda: error(np.array([np.interp(self.server.computer.now_s(), times_s, each) for each in columns]))

    def _gaze_error(self, target_W: Any) -> Error:
        def error() -> float:
            X_WHand = self.X_WH() @ RigidTransform(RotationMatrix(), [0.19557, 0.0, 0.0])
            away = X_WHand.inverse() @ target_W
            return float(math.atan2(math.hypot(away[1], away[2]), away[0]))

        return error

    def look(self, service: RobotCommandService) -> None:
        """Compares what is done now; called before each step of the plant."""
        for each in self.asked:
            if each.error_then is None and each.cut is None:
                request = robot_command_pb2.RobotCommandFeedbackRequest(robot_command_id=each.command)
                told = service.RobotCommandFeedback(request, None).feedback.synchronized_feedback  # type: ignore[arg-type]
                part = told.mobility_command_feedback if each.kind in BASE else told.arm_command_feedback
                if each.done(told):
                    each.error_then = each.error()
                elif part.status == basic_command_pb2.RobotCommandFeedbackStatus.STATUS_COMMAND_OVERRIDDEN:
                    each.cut = (each.on_path or each.error)()


@contextmanager
def judged(seed: int) -> Iterator[Judge]:
    """Serves a simulated Spot whose commands are judged; the caller runs `server.computer`."""
    opened = open_world("flat")
    compile_first()
    simulation = simulate(
        opened, {"Alice": only_robot("Alice", opened, seed=seed, start=START)}, seed=seed, record=False
    )
    robot, judges = simulation.robots["Alice"], list[Judge]()
    take = RobotCommandService.RobotCommand

    def taken(service: RobotCommandService, request: Any, call: Any) -> Any:
        answer = take(service, request, call)
        if answer.robot_command_id:
            judges[0].server.computer.do(lambda: judges[0].read(request.command, answer.robot_command_id)).result()
        return answer

    with tempfile.TemporaryDirectory() as folder, mock.patch.object(RobotCommandService, "RobotCommand", taken):
        solver = arm_model(robot.capabilities())
        server = SpotServer(robot, simulation.clock, solver, credentials(Path(folder)), Options({"user": "simulated"}))
        judges.append(Judge(server, simulation))
        service = next(each for each in server.services if isinstance(each, RobotCommandService))
        server.computer.watchers.append(lambda: judges[0].look(service))
        with server.running():
            yield judges[0]


def run(program: str, *, seed: int = 1) -> Mapping[str, Any]:
    """Runs one program, a script with its arguments, to its end; returns its exit code and the errors by kind."""
    script, *arguments = program.split()
    code, ended = list[int](), threading.Event()
    with judged(seed) as judge:
        server = judge.server
        user = {"BOSDYN_CLIENT_USERNAME": "user", "BOSDYN_CLIENT_PASSWORD": "simulated"}
        launch = [sys.executable, "-m", "plant.spot_api.launch", str(server.certificate), str(server.port), "real"]

        def execute() -> None:
            try:
                command = [*launch, script, *arguments, "127.0.0.1"]
                with tempfile.TemporaryDirectory() as folder:
                    done = subprocess.run(
                        command, env={**os.environ, **user}, cwd=folder, capture_output=True, timeout=_LIMIT_S
                    )
                code.append(done.returncode)
            except subprocess.TimeoutExpired:
                code.append(124)
            finally:
                ended.set()

        thread = threading.Thread(target=execute)
        thread.start()
        server.computer.run(ended)
        thread.join()
        compared = [each for each in judge.asked if each.error_then is not None]
        worst = {
            kind: max(e.error_then or 0.0 for e in compared if e.kind == kind) for kind in {e.kind for e in compared}
        }
        return {
            "program": Path(program.split()[0]).name + " " + " ".join(arguments),
            "exit_code": code[0],
            "compared": len(compared),
            "cut": [(each.kind, each.cut and round(each.cut, 3)) for each in judge.asked if each.error_then is None],
            "worst": {kind: round(error, 3) for kind, error in sorted(worst.items())},
            "ended": code[0] == int(Path(script).name in ENDS_WITH_1),
            "true": bool(compared) and all(error < MOST_M for error in worst.values()),
        }


def main() -> None:
    """Runs the programs of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--examples", type=Path, default=os.environ.get(EXAMPLES))
    parser.add_argument("--only", default="")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    programs = [str(OWN), *(f"{options.examples}/{each}" for each in PROGRAMS if options.examples)]
    results = []
    for program in programs:
        if options.only in program:
            results.append(run(program, seed=options.seed))
            print(json.dumps(results[-1]), flush=True)
    right = sum(bool(each["true"] and each["ended"]) for each in results)
    print(json.dumps({"programs": len(results), "ended and true": right}))


if __name__ == "__main__":
    main()
