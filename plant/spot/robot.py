"""The simulated Spot behind the Robot protocol."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from pydrake.systems.framework import Context

from plant.locomotion.floating_base import Velocity
from plant.locomotion.trot import BodyMotion, Trot
from plant.models.spot.description import spot_facts
from plant.snapshot.values import State, array_of
from plant.spot.capabilities import nominal_footholds, spot_capabilities
from plant.spot.commands import CommandTable, Part
from plant.spot.leases import LeaseManager
from plant.spot.model import SpotModel
from plant.spot.sensing import SpotSensors
from plant.spot.servos import GripperGoal, LegServos, arm_set_point, gripper_set_point
from skills.robot import (
    ArmTrajectory,
    Battery,
    Capabilities,
    CommandId,
    CommandState,
    CommandStatus,
    FloatArray,
    Gripper,
    Image,
    Imu,
    Joints,
    Lease,
    Odometry,
    Scan,
)

_ARM_ARRIVED_RAD = 0.03
_ARM_STILL_RAD_S = 0.06
_MAX_ARM_RATE_RAD_S = 4.0
_TRAJECTORY_START_RAD = 0.25
_GRIPPER_ARRIVED_RAD = 0.03
_GRIPPER_STALL_RAD_S = 0.03
_GRIPPER_STALL_S = 0.25


class SpotRobot:
    """One Spot: takes commands under a lease and turns them into set points of the plant's servos."""

    def __init__(self, model: SpotModel, sensors: SpotSensors, context: Context) -> None:
        """Take over the robot as it stands in the plant's `context` at time 0."""
        self._model = model
        self._sensors = sensors
        self._context = context
        self._index = model.index()
        self._commands = CommandTable()
        self._leases = LeaseManager(model.name)
        self._now_s = 0.0
        positions = self._positions()
        joints = positions[self._index.positions]
        self._arm_hold = joints[self._index.arm]
        self._arm_rate = np.zeros(len(self._arm_hold))
        self._gripper_goal = self._gripper_goal_before = GripperGoal(
            max(0.0, -float(joints[self._index.gripper])), 20.0
        )
        self._gripper_still_s = 0.0
        self._posture = (float(spot_facts()["capabilities"]["standing_height"]), 0.0)
        self._leg_servos = LegServos(self._index, joints[self._index.legs])
        self._trot = Trot(nominal_footholds())
        self._trot.reset(self._motion(self._base(positions)))
        self._capabilities = spot_capabilities()
        self._tip_radius_m = float(spot_facts()["gripper"]["tip_radius"])

    # -- know and sense -------------------------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """The robot's name."""
        return self._model.name

    def capabilities(self) -> Capabilities:
        """What this Spot is and can do."""
        return self._capabilities

    def odometry(self) -> Odometry:
        """Latest dead reckoning."""
        return self._sensors.odometry

    def imu(self) -> Imu:
        """Latest inertial measurement."""
        return self._sensors.imu

    def scan(self) -> Scan | None:
        """Latest LiDAR revolution, None before the first."""
        return self._sensors.scan

    def image(self, source: str, *, visual: bool = True, depth: bool = True) -> Image:
        """Take a picture with depth now, or only one of the two. Raises ValueError for an unknown source."""
        return self._sensors.image(source, visual=visual, depth=depth)

    def joints(self) -> Joints:
        """Latest joint state."""
        return self._sensors.joints

    def gripper(self) -> Gripper:
        """Latest gripper state."""
        return self._sensors.gripper

    def battery(self) -> Battery:
        """Latest battery state."""
        return self._sensors.battery

    def faults(self) -> tuple[str, ...]:
        """Present faults, empty when well."""
        return ()

    # -- act ------------------------------------------------------------------------------------------------------

    def drive(self, vx: float, vy: float, wz: float, *, until_s: float, lease: Lease) -> CommandId:
        """Walk at a body-frame velocity until the clock reads until_s."""
        if not all(math.isfinite(value) for value in (vx, vy, wz)):
            return self._commands.refuse(f"drive: velocity ({vx}, {vy}, {wz}) is not finite")
        if self._posture[0] < spot_facts()["capabilities"]["height_range"][0] - 0.02:
            return self._commands.refuse("drive: the robot sits; stand up first")
        return self._begin(Part.VELOCITY, Velocity(vx, vy, wz), until_s, lease)

    def stand(self, height_m: float, pitch_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Hold the body origin at a height above the floor and a pitch."""
        low, high = self._capabilities.height_range_m
        least, most = self._capabilities.pitch_range_rad
        if not (low <= height_m <= high and least <= pitch_rad <= most):
            return self._commands.refuse(
                f"stand: height {height_m:.2f} m must lie in [{low}, {high}] "
                f"and pitch {pitch_rad:.2f} rad in [{least}, {most}]"
            )
        return self._begin(Part.POSTURE, (height_m, pitch_rad), until_s, lease)

    def sit(self, *, until_s: float, lease: Lease) -> CommandId:
        """Lower the body to the floor; driving stops."""
        command = self._begin(Part.POSTURE, (spot_facts()["capabilities"]["sitting_height"], 0.0), until_s, lease)
        if self._commands.status(command).state is CommandState.RUNNING:
            self._commands.finish(Part.VELOCITY, CommandState.STOPPED, "the robot sits down")
        return command

    def move_arm(self, trajectory: ArmTrajectory, *, until_s: float, lease: Lease) -> CommandId:
        """Follow a joint trajectory; done when its end is reached and the arm is still."""
        reason = self._trajectory_refusal(trajectory)
        return self._commands.refuse(reason) if reason else self._begin(Part.ARM, trajectory, until_s, lease)

    def point_head(self, pan_rad: float, tilt_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Spot has no head."""
        return self._commands.refuse("point_head: the robot has no head")

    def set_gripper(self, opening: float, force_n: float, *, until_s: float, lease: Lease) -> CommandId:
        """Move the gripper to an opening with at most force_n at its tip; the force stays after the command's end."""
        gripper = spot_facts()["gripper"]
        if not (0.0 <= opening <= gripper["open"] and 0.0 < force_n <= gripper["max_force"]):
            return self._commands.refuse(
                f"set_gripper: opening {opening:.2f} rad must lie in [0, {gripper['open']}] "
                f"and force {force_n:.0f} N in (0, {gripper['max_force']}]"
            )
        command = self._begin(Part.GRIPPER, GripperGoal(opening, force_n), until_s, lease)
        if self._commands.status(command).state is CommandState.RUNNING:
            self._gripper_goal_before, self._gripper_goal = self._gripper_goal, GripperGoal(opening, force_n)
            self._gripper_still_s = 0.0
        return command

    def stop(self, *, lease: Lease, only: CommandId | None = None) -> CommandId:
        """Stop all motion, or only the given command if it still runs."""
        refusal = self._leases.refusal(lease)
        if refusal:
            return self._commands.refuse(f"stop: {refusal}")
        part = self._commands.part_of(only) if only is not None else None
        for candidate in Part if only is None else ([part] if part else []):
            self._halt(candidate, "stopped by command")
        return self._commands.note(CommandState.DONE)

    def command_status(self, command: CommandId) -> CommandStatus:
        """What became of a command. Raises KeyError for an id never given."""
        return self._commands.status(command)

    # -- own ------------------------------------------------------------------------------------------------------

    def lease_holder(self) -> Lease | None:
        """The lease that counts now; None while it is free."""
        return self._leases.current

    def acquire_lease(self, holder: str) -> Lease:
        """Take a free lease. Raises LeaseError when another holds it."""
        return self._leases.acquire(holder)

    def take_lease(self, holder: str) -> Lease:
        """Take the lease from whoever holds it; the robot stops."""
        self._halt_all("the lease was taken by " + repr(holder))
        return self._leases.take(holder)

    def return_lease(self, lease: Lease) -> None:
        """Give the lease back; the robot stops. A lease that was taken away is ignored."""
        if self._leases.give_back(lease):
            self._halt_all("the lease was returned")

    # -- called by the simulation ---------------------------------------------------------------------------------

    def control(self, now_s: float, dt_s: float) -> None:
        """Command all servos for the next dt_s of simulated time."""
        self._now_s = now_s
        self._expire()
        plant, index, positions = self._model.plant, self._index, self._positions()
        joints, base = positions[index.positions], self._base(positions)
        rates = plant.GetVelocities(self._context)[index.velocities]
        self._follow_up(joints, rates, base, dt_s)
        desired = np.concatenate([joints, np.zeros(len(joints))])
        desired[index.arm], desired[index.arm_rates] = self._arm_hold, self._arm_rate
        desired[index.gripper] = gripper_set_point(
            self._gripper_goal, float(joints[index.gripper]), index.gripper_gain, self._tip_radius_m
        )
        self._drive_body(base, dt_s)
        desired[index.legs], desired[index.leg_rates] = self._legs(base, dt_s)
        gravity = plant.CalcGravityGeneralizedForces(self._context)[index.velocities]
        instance = self._model.instance
        plant.get_desired_state_input_port(instance).FixValue(self._context, desired)
        feed_forward = np.minimum(np.maximum(-gravity, -index.efforts), index.efforts)
        plant.get_actuation_input_port(instance).FixValue(self._context, feed_forward)

    def sense(self, now_s: float) -> None:
        """Take new sensor readings."""
        self._now_s = now_s
        self._sensors.update(now_s)

    def state(self) -> State:
        """What the robot itself keeps: servos, gait, sensors. Commands and leases do not outlive its computer."""
        floating_base = self._model.floating_base
        return {
            "arm_hold": None if self._commands.running(Part.ARM) is not None else self._arm_hold.tolist(),
            "gripper": [self._gripper_goal.opening_rad, self._gripper_goal.force_n, self._gripper_still_s],
            "posture": list(self._posture),
            "legs": self._leg_servos.state(),
            "trot": self._trot.state(),
            "floating_base": None if floating_base is None else floating_base.state_kept(),
            "sensors": self._sensors.state(),
        }

    def restore(self, state: State, now_s: float) -> None:
        """Power up in such a state: nobody has the lease, no command runs, the gripper keeps its clamp.

        An arm that was moving holds where it is; a body that was moving slows down.
        """
        self._now_s = now_s
        self._commands, self._leases = CommandTable(), LeaseManager(self._model.name)
        joints = self._positions()[self._index.positions]
        hold = state["arm_hold"]
        self._arm_hold = joints[self._index.arm] if hold is None else array_of(hold)
        self._arm_rate = np.zeros(len(self._arm_hold))
        opening_rad, force_n, self._gripper_still_s = state["gripper"]
        self._gripper_goal = self._gripper_goal_before = GripperGoal(opening_rad, force_n)
        self._posture = (state["posture"][0], state["posture"][1])
        self._leg_servos.restore(state["legs"])
        self._trot.restore(state["trot"])
        if self._model.floating_base is not None:
            self._model.floating_base.restore(state["floating_base"])
        self._sensors.restore(state["sensors"], now_s)

    # -- inside ---------------------------------------------------------------------------------------------------

    def _begin(self, part: Part, payload: object, until_s: float, lease: Lease) -> CommandId:
        refusal = self._leases.refusal(lease)
        if refusal:
            return self._commands.refuse(f"{part.value}: {refusal}")
        if until_s <= self._now_s:
            return self._commands.refuse(
                f"{part.value}: expires at {until_s:.2f} s, and it is {self._now_s:.2f} s already"
            )
        return self._commands.begin(part, payload, self._now_s, until_s)

    def _trajectory_refusal(self, trajectory: ArmTrajectory) -> str | None:
        positions = trajectory.positions_rad
        if positions.shape[1] != len(self._index.arm):
            return f"move_arm: {positions.shape[1]} joints given, the arm has {len(self._index.arm)}"
        lower, upper = self._index.lower[self._index.arm] - 1e-3, self._index.upper[self._index.arm] + 1e-3
        if np.any(positions < lower) or np.any(positions > upper):
            return "move_arm: the trajectory leaves the joint limits"
        if np.any(np.abs(positions[0] - self._arm_hold) > _TRAJECTORY_START_RAD):
            return "move_arm: the trajectory begins away from where the arm is"
        rates = np.abs(np.diff(positions, axis=0)) / np.diff(trajectory.times_s)[:, None]
        if rates.size and rates.max() > _MAX_ARM_RATE_RAD_S:
            return f"move_arm: a joint would move at {rates.max():.1f} rad/s; at most {_MAX_ARM_RATE_RAD_S} is allowed"
        return None

    def _halt_all(self, reason: str) -> None:
        for part in Part:
            self._halt(part, reason)

    def _halt(self, part: Part, reason: str) -> None:
        if self._commands.running(part) is not None:
            self._hold_still(part)
        self._commands.finish(part, CommandState.STOPPED, reason)

    def _hold_still(self, part: Part) -> None:
        """Make where a part is the place where it stays; a gripper that clamps something goes on clamping."""
        joints = self._positions()[self._index.positions]
        if part is Part.ARM:
            self._arm_hold, self._arm_rate = joints[self._index.arm], np.zeros(len(self._index.arm))
        if part is Part.GRIPPER:
            self._gripper_goal = self._stopped_gripper(max(0.0, -float(joints[self._index.gripper])))
        if part is Part.POSTURE and self._model.floating_base is not None:
            self._posture = self._model.floating_base.posture

    def _stopped_gripper(self, opening_rad: float) -> GripperGoal:
        """A moving gripper stays where it is; one that holds an object keeps its force, or gets that of before."""
        rates = self._model.plant.GetVelocities(self._context)[self._index.velocities]
        if abs(float(rates[self._index.gripper])) >= _GRIPPER_STALL_RAD_S:
            return GripperGoal(opening_rad, self._gripper_goal.force_n)
        return self._gripper_goal_before if self._gripper_goal.opening_rad > opening_rad else self._gripper_goal

    def _expire(self) -> None:
        for part in Part:
            active = self._commands.running(part)
            if active is None or self._now_s < active.until_s - 1e-9:
                continue
            if part is Part.VELOCITY:
                self._commands.finish(part, CommandState.DONE)
            else:
                self._halt(part, "expired before it was done")

    def _follow_up(self, joints: FloatArray, rates: FloatArray, base: Sequence[float], dt_s: float) -> None:
        self._follow_arm(joints, rates)
        self._follow_gripper(joints, rates, dt_s)
        posture = self._commands.running(Part.POSTURE)
        if posture is not None and isinstance(posture.payload, tuple):
            self._posture = posture.payload
            height, pitch = base[3:]
            if abs(height - self._posture[0]) < 0.01 and abs(pitch - self._posture[1]) < 0.02:
                self._commands.finish(Part.POSTURE, CommandState.DONE)

    def _follow_arm(self, joints: FloatArray, rates: FloatArray) -> None:
        active = self._commands.running(Part.ARM)
        self._arm_rate = np.zeros(len(self._index.arm))
        if active is None or not isinstance(active.payload, ArmTrajectory):
            return
        trajectory, elapsed = active.payload, self._now_s - active.since_s
        self._arm_hold, self._arm_rate = arm_set_point(trajectory, elapsed)
        if elapsed < trajectory.times_s[-1]:
            return
        off = np.abs(joints[self._index.arm] - trajectory.positions_rad[-1]).max()
        if off < _ARM_ARRIVED_RAD and np.abs(rates[self._index.arm]).max() < _ARM_STILL_RAD_S:
            self._commands.finish(Part.ARM, CommandState.DONE)

    def _follow_gripper(self, joints: FloatArray, rates: FloatArray, dt_s: float) -> None:
        opening, rate = -float(joints[self._index.gripper]), abs(float(rates[self._index.gripper]))
        self._gripper_still_s = self._gripper_still_s + dt_s if rate < _GRIPPER_STALL_RAD_S else 0.0
        if self._commands.running(Part.GRIPPER) is None:
            return
        arrived = abs(opening - self._gripper_goal.opening_rad) < _GRIPPER_ARRIVED_RAD
        if arrived or self._gripper_still_s > _GRIPPER_STALL_S:
            self._commands.finish(
                Part.GRIPPER, CommandState.DONE, "" if arrived else "stopped by an object in the gripper"
            )

    def _drive_body(self, base: Sequence[float], dt_s: float) -> None:
        floating_base = self._model.floating_base
        if floating_base is None:
            return
        active = self._commands.running(Part.VELOCITY)
        wanted = active.payload if active is not None and isinstance(active.payload, Velocity) else Velocity()
        floating_base.control(self._context, base, wanted, self._posture, dt_s, stopping=active is None)

    def _legs(self, base: Sequence[float], dt_s: float) -> tuple[FloatArray, FloatArray]:
        if self._model.floating_base is None:
            return self._leg_servos.rest_rad, np.zeros_like(self._leg_servos.rest_rad)
        motion = self._motion(base)
        feet_W = self._trot.step(motion, dt_s)
        X_WB = self._model.plant.EvalBodyPoseInWorld(self._context, self._model.body).GetAsMatrix34()
        return self._leg_servos.set_points(_feet_ahead(feet_W, motion, X_WB, dt_s), dt_s)

    def _motion(self, base: Sequence[float]) -> BodyMotion:
        floating_base = self._model.floating_base
        velocity = floating_base.velocity if floating_base is not None else Velocity()
        return BodyMotion(base[0], base[1], base[2], velocity.vx, velocity.vy, velocity.wz)

    def _base(self, positions: FloatArray) -> Sequence[float]:
        """The floating base's (x, y, yaw, height, pitch)."""
        floating_base = self._model.floating_base
        return (0.0,) * 5 if floating_base is None else floating_base.state(positions)

    def _positions(self) -> FloatArray:
        positions: FloatArray = self._model.plant.GetPositions(self._context)
        return positions


def _feet_ahead(
    feet_W: Sequence[Sequence[float]], motion: BodyMotion, X_WB: FloatArray, dt_s: float
) -> list[tuple[float, float, float]]:
    """Feet in the frame of a body that, from X_WB (3, 4), moves on for dt_s at the same height and tilt."""
    x, y, yaw = motion.ahead(dt_s)
    c, s = math.cos(yaw - motion.yaw_rad), math.sin(yaw - motion.yaw_rad)
    (xx, xy, xz, x0), (yx, yy, yz, y0), (zx, zy, zz, z0) = X_WB.tolist()
    feet_B = []
    for foot_x, foot_y, foot_z in feet_W:
        ahead_x, ahead_y = foot_x - x, foot_y - y
        dx = c * ahead_x + s * ahead_y + motion.x_m - x0
        dy = c * ahead_y - s * ahead_x + motion.y_m - y0
        dz = foot_z - z0
        feet_B.append((xx * dx + yx * dy + zx * dz, xy * dx + yy * dy + zy * dz, xz * dx + yz * dy + zz * dz))
    return feet_B
