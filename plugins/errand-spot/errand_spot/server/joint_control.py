"""Joint control: positions of all joints from a stream of the client, in its simple form.

The stream sets joint positions with gains. The arm and the gripper follow them. The legs stand on the floor: their
joints set the body's pose over the feet, which is height, pitch, turn and shift. Torques alone are not simulated.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from threading import Lock
from typing import Any, Final

import numpy as np
from bosdyn.api import basic_command_pb2, full_body_command_pb2, robot_command_pb2
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from scipy.spatial.transform import Rotation

from errand_spot.messages import InvalidRequestError, our_joint, seconds
from errand_spot.server.arm import JOINTS
from errand_spot.server.calls import Call, Service
from errand_spot.server.computer import PERIOD_S, Computer, Snapshot
from errand_spot.server.identity import DOMAIN
from errand_spot.server.leases import ARM, GRIPPER, MOBILITY
from errand_spot.server.mobility import FEET_M, drive, error_to
from errand_spot.server.posture import ROLL_RAD, SHIFT_M, TWIST_RAD
from errand_spot.server.refusals import RefusedError, check_values, end_of, unsupported
from plant.robots.spot.description import spot_facts
from skills.geometry import compose
from skills.robot import ArmTrajectory, FloatArray, Pose2D

_Answer = robot_command_pb2.JointControlStreamResponse
_Response = robot_command_pb2.RobotCommandResponse
_Progress = basic_command_pb2.RobotCommandFeedbackStatus
_Feedback = basic_command_pb2.JointCommand.Feedback
LEG_JOINTS: Final = tuple(f"{foot}.{joint}" for foot in FEET_M for joint in ("hx", "hy", "kn"))
ARM_JOINTS: Final = tuple(f"arm0.{joint}" for joint in (*JOINTS, "f1x"))
"""Joints in the order of the API's streams; those of the arm follow those of the legs."""
_WAIT_S: Final = 1.0
"""Longest time that a stream waits for joint control, and joint control for a message in time."""
_SLIP_M: Final = 0.06
"""Largest distance of a foot from its place on the floor; from 0.06 m on the legs would lift or slide it."""
_SET_M, _SET_RAD, _GAIN_1_S, _MOST = 0.008, 0.015, 2.0, 0.3
_FASTEST_RAD_S, _FORCE_N, _MOVES_RAD = 3.6, 40.0, 0.005


@dataclass(frozen=True)
class Target:
    """Goal of one message, until a robot time: body over the feet (x, y, yaw, height, pitch), arm (6,) and finger."""

    body: FloatArray
    arm_rad: FloatArray
    finger_rad: float
    end_s: float
    most_rad_s: float | None = None


@dataclass
class Updates:
    """Messages of joint control: how many have come, the key and time of the last, and the running motion."""

    received: int = 0
    last_key: int = 0
    last_s: float = 0.0
    motion: JointControl | None = None


def joint_names(computer: Computer) -> tuple[str, ...]:
    """Names of all joints in the order of the API's streams."""
    return LEG_JOINTS + (ARM_JOINTS if computer.solver is not None else ())


def positions(snapshot: Snapshot, names: Sequence[str]) -> list[float]:
    """Measured positions of joints (rad); 0 for one that the robot does not measure."""
    return [snapshot.joints.position_rad.get(our_joint(name), 0.0) for name in names]


def feet_B(legs_rad: FloatArray) -> FloatArray:
    """Positions (4, 3) of the feet in the body frame for leg joints (12,)."""
    made, facts = [], spot_facts()["legs"]
    thigh, shin = np.array(facts["lower_leg"]["offset"]), np.array(facts["foot"]["xyz"])
    for (x, y), (hx, hy, kn) in zip(np.sign([*FEET_M.values()]), legs_rad.reshape(4, 3), strict=True):
        side, mirror = np.array([x, y, 1.0]), np.array([1.0, y, 1.0])
        knee = RotationMatrix.MakeYRotation(hy) @ (mirror * thigh + RotationMatrix.MakeYRotation(kn) @ (mirror * shin))
        leg = RotationMatrix.MakeXRotation(hx) @ (mirror * np.array(facts["upper_leg"]["offset"]) + knee)
        made.append(side * np.array(facts["hip"]["offset"]) + leg)
    return np.array(made)


class JointControl:
    """Motion of all parts that follows the stream of a client."""

    keeps_feet = True

    def __init__(self, updates: Updates) -> None:
        self._updates, self._before = updates, updates.received
        self._target: Target | None = None
        self._given: tuple[float, float] | None = None
        self.status: int = _Progress.STATUS_PROCESSING

    def begin_alone(self, computer: Computer) -> None:
        """Takes all parts, with the feet where they stand."""
        snapshot = computer.snapshot
        legs_rad = np.array(positions(snapshot, LEG_JOINTS))
        self._computer, self._last_s = computer, computer.now_s()
        self._feet_O = computer.feet_O or snapshot.odometry.pose
        self._feet_F = (self._feet_O.transform().inverse() @ snapshot.odometry.X_OB) @ feet_B(legs_rad).T
        self._arm_rad = None if computer.solver is None else computer.arm_rad(snapshot.joints)
        self._finger_rad = -snapshot.gripper.opening
        computer.move(dict.fromkeys((MOBILITY, ARM, GRIPPER), self))
        self._updates.motion = self

    def begin(self, _computer: Computer) -> None:
        """Holds everything until the first message."""

    def take(self, target: Target) -> None:
        """Takes the goal of a message."""
        self._target = target

    def tick(self, computer: Computer) -> None:
        """Moves body, arm and gripper towards the last goal, until its end time."""
        target, now_s = self._target, computer.now_s()
        if self.status != _Progress.STATUS_PROCESSING:
            return
        if target is not None and target.end_s > now_s:
            self._last_s = now_s
            self._move_body(computer, target.body)
            if self._arm_rad is not None:
                self._move_arm(computer, self._arm_rad, target)
            measured = computer.snapshot.joints.velocity_rad_s.values()
            if target.most_rad_s is not None and max(map(abs, measured), default=0.0) > target.most_rad_s:
                computer.switch_off()
        elif now_s - self._last_s > _WAIT_S:
            self.end(_Progress.STATUS_COMMAND_TIMED_OUT)

    def _move_body(self, computer: Computer, body: FloatArray) -> None:
        """Moves the body over the feet."""
        posture, odometry = (float(body[3]), float(body[4])), computer.snapshot.odometry
        if self._given is None or np.abs(np.subtract(posture, self._given)).max() > _MOVES_RAD:
            self._given = posture
            computer.stand(*posture)
        error = error_to(odometry.pose, compose(self._feet_O, Pose2D(*body[:3].tolist())))
        if np.abs(error[:2]).max() > _SET_M or abs(error[2]) > _SET_RAD:
            drive(computer, np.clip(_GAIN_1_S * error, -_MOST, _MOST), np.inf)

    def _move_arm(self, computer: Computer, before_rad: FloatArray, target: Target) -> None:
        """Moves the arm by one step, and the finger."""
        most = _FASTEST_RAD_S * PERIOD_S
        self._arm_rad = before_rad + np.clip(target.arm_rad - before_rad, -most, most)
        now_s, lease = computer.clock.now(), computer.lease
        trajectory = ArmTrajectory(np.array([0.0, PERIOD_S]), np.array([before_rad, self._arm_rad]))
        computer.robot.move_arm(trajectory, until_s=now_s + _WAIT_S, lease=lease)
        if abs(target.finger_rad - self._finger_rad) > _MOVES_RAD:
            if target.finger_rad < self._finger_rad:
                computer.grip.holding = None
            self._finger_rad = target.finger_rad
            until_s = computer.forever()
            computer.robot.set_gripper(max(-target.finger_rad, 0.0), _FORCE_N, until_s=until_s, lease=lease)

    def end(self, status: int) -> None:
        """Ends it with a status; the robot holds its posture."""
        if self.status == _Progress.STATUS_PROCESSING:
            self.status = status
            if self._updates.motion is self:
                self._updates.motion = None

    @property
    def feedback(self) -> Any:
        """The message of how many messages have come, and whether they are obeyed."""
        active = self.status == _Progress.STATUS_PROCESSING
        made = full_body_command_pb2.FullBodyCommand.Feedback(status=self.status)
        made.joint_feedback.status = _Feedback.STATUS_ACTIVE if active else _Feedback.STATUS_ERROR
        made.joint_feedback.num_messages_received = self._updates.received - self._before
        return made

    def body_over_feet(self, legs_rad: FloatArray) -> FloatArray:
        """Body over its feet (x, y, yaw, height, pitch) for leg joints (12,) on feet that stay where they stand.

        Raises InvalidRequestError where a foot would lift or slide, or the body leave its range.
        """
        p_BF = feet_B(legs_rad)
        R_FB = Rotation.align_vectors(self._feet_F.T - self._feet_F.mean(axis=1), p_BF - p_BF.mean(axis=0))[0]
        X_FB = RigidTransform(RotationMatrix(R_FB.as_matrix()), self._feet_F.mean(axis=1))
        X_FB = X_FB @ RigidTransform(-p_BF.mean(axis=0))
        angles, (x, y, height) = RollPitchYaw(X_FB.rotation()), X_FB.translation()
        off_m = float(np.linalg.norm(X_FB @ p_BF.T - self._feet_F, axis=0).max())
        can, slack = self._computer.capabilities, 0.01
        ranges: Mapping[str, tuple[float, float, float]] = {
            "a foot's distance from its place on the floor (m)": (off_m, 0.0, _SLIP_M),
            "the body's roll (rad)": (angles.roll_angle(), -ROLL_RAD, ROLL_RAD),
            "the body's shift ahead (m)": (x, -SHIFT_M, SHIFT_M),
            "the body's shift to the left (m)": (y, -SHIFT_M, SHIFT_M),
            "the body's turn (rad)": (angles.yaw_angle(), -TWIST_RAD, TWIST_RAD),
            "the body's height (m)": (height, *can.height_range_m),
            "the body's pitch (rad)": (angles.pitch_angle(), *can.pitch_range_rad),
        }
        for name, (value, low, high) in ranges.items():
            if not low - slack <= value <= high + slack:
                said = f"joint_command.position: of the legs, {name} is {value:.3f}; {low:g} to {high:g} is simulated"
                raise InvalidRequestError(said)
        posture = np.clip([height, angles.pitch_angle()], *np.transpose([can.height_range_m, can.pitch_range_rad]))
        return np.array([x, y, angles.yaw_angle(), *posture])


def activation(computer: Computer, updates: Updates) -> JointControl:
    """Motion that a command for joint control starts. Raises RefusedError."""
    if not computer.upright:
        raise unsupported("full_body_command.joint_request for a robot that does not stand")
    return JointControl(updates)


class RobotCommandStreamingService(Service):
    """Takes streams of joint commands."""

    name, type, authority = "robot-command-streaming", "bosdyn.api.RobotCommandStreamingService", f"command.{DOMAIN}"
    live = True

    def __init__(self, computer: Computer, updates: Updates) -> None:
        self._computer, self._updates, self._lock = computer, updates, Lock()

    def JointControlStream(self, requests: Iterable[Any], _call: Call) -> Any:
        """Takes messages until their end, or the first that cannot be obeyed."""
        if not self._lock.acquire(blocking=False):
            return _Answer(status=_Answer.STATUS_INVALID_REQUEST, message="another stream of joint commands is open")
        try:
            self._take_all(requests)
        except RefusedError as refused:
            return _Answer(status=refused.status, message=str(refused))
        except InvalidRequestError as invalid:
            return _Answer(status=_Answer.STATUS_INVALID_REQUEST, message=str(invalid))
        finally:
            self._lock.release()
        return _Answer(status=_Answer.STATUS_OK)

    def _take_all(self, requests: Iterable[Any]) -> None:
        """Hands the goals of messages to the motion. Raises RefusedError or InvalidRequestError.

        A message that comes before joint control is active, or late, is only counted, for a second.
        """
        updates, computer, gains, obeyed = self._updates, self._computer, False, 0
        obeyed_s, late = computer.now_s(), False
        status, said = _Answer.STATUS_INACTIVE, "the robot is not in joint control: send a joint_request"
        for request in requests:
            command, now_s = request.joint_command, computer.now_s()
            check_values(request)
            gains |= self._check(request, gains=gains)
            updates.received += 1
            updates.last_key, updates.last_s = command.user_command_key, now_s
            if (motion := updates.motion) is not None:
                try:
                    end_s = end_of(command, now_s, "joint_command")
                    motion.take(replace(self._target(command, motion, now_s), end_s=end_s))
                    obeyed, obeyed_s = obeyed + 1, now_s
                except RefusedError as refused:  # by its end time
                    if refused.status != _Response.STATUS_EXPIRED:
                        raise RefusedError(_Answer.STATUS_TOO_DISTANT, str(refused)) from refused
                    status, said = _Answer.STATUS_EXPIRED, str(refused)
            if late := now_s - obeyed_s > _WAIT_S:
                break
        if late or not obeyed:
            raise RefusedError(status, said)

    def _check(self, request: Any, *, gains: bool) -> bool:
        """Returns whether a message has gains. Raises InvalidRequestError for a wrong number of values, and so on."""
        command, names = request.joint_command, joint_names(self._computer)
        fields = {"position": command.position, "velocity": command.velocity, "load": command.load}
        if command.HasField("gains") or not gains:
            fields |= {"gains.k_q_p": command.gains.k_q_p, "gains.k_qd_p": command.gains.k_qd_p}
        for name, values in fields.items():
            if len(values) != len(names):
                said = f"joint_command.{name} has {len(values)} values; {len(names)} are needed, one a joint"
                raise InvalidRequestError(said)
        if limp := [name for name, gain in zip(names, command.gains.k_q_p, strict=False) if gain <= 0.0]:
            raise InvalidRequestError(f"joint_command.gains.k_q_p of {limp[0]} is 0: torque control is not simulated")
        if command.HasField("velocity_safety_limit") and command.velocity_safety_limit.value <= 0.0:
            raise InvalidRequestError("joint_command.velocity_safety_limit must be above 0")
        if len(request.contact_advice.contact_advice) not in (0, len(FEET_M)):
            raise InvalidRequestError(f"contact_advice must have {len(FEET_M)} values, or none")
        return bool(command.HasField("gains"))

    def _target(self, command: Any, motion: JointControl, now_s: float) -> Target:
        """Goal of a message, ahead by its velocities as it asks. Raises InvalidRequestError."""
        since_s = now_s - seconds(command.reference_time) if command.HasField("reference_time") else PERIOD_S
        ahead_s = min(max(since_s, 0.0), seconds(command.extrapolation_duration))
        joints = np.array(command.position) + ahead_s * np.array(command.velocity)
        legs, arm_rad, finger_rad = joints[:12], joints[12:18], float(joints[18]) if len(joints) > 18 else 0.0
        solver, can = self._computer.solver, self._computer.capabilities.gripper
        if solver is not None:
            arm_rad = np.clip(arm_rad, solver.lower_rad, solver.upper_rad)
        finger_rad = min(max(finger_rad, 0.0 if can is None else -can.widest), 0.0)
        limit = command.velocity_safety_limit
        most = limit.value if command.HasField("velocity_safety_limit") else None
        return Target(motion.body_over_feet(legs), arm_rad, finger_rad, now_s, most)
