"""The simulated Spot behind the Robot protocol."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from pydrake.systems.framework import Context

from plant.control.arm import ArmServos
from plant.control.commands import Part
from plant.control.gripper import Closing, GripperServo, GripperTolerances, gripper_set_point
from plant.control.robot import CommandedRobot
from plant.kept import State
from plant.locomotion.floating_base import Velocity
from plant.locomotion.trot import BodyMotion, Trot
from plant.models.spot.description import spot_facts
from plant.spot.capabilities import nominal_footholds, spot_capabilities
from plant.spot.model import SpotModel
from plant.spot.sensing import SpotSensors
from plant.spot.servos import LegServos
from skills.robot import ArmTrajectory, CommandId, CommandState, FloatArray, Lease

_MAX_ARM_RATE_RAD_S = 4.0
_GRIPPER_TOLERANCES = GripperTolerances(arrived=0.03, stall_rate=0.03)


class SpotRobot(CommandedRobot):
    """One Spot: takes commands under a lease and turns them into set points of the plant's servos."""

    def __init__(self, model: SpotModel, sensors: SpotSensors, context: Context) -> None:
        """Take over the robot as it stands in the plant's `context` at time 0."""
        super().__init__(model.name, spot_capabilities(), sensors)
        self._model, self._context = model, context
        self._index = model.index()
        positions = self._positions()
        joints = positions[self._index.positions]
        fastest = np.full(len(self._index.arm), _MAX_ARM_RATE_RAD_S)
        self._arm = ArmServos(self._index, self._index.arm, fastest, joints)
        self._gripper = GripperServo(max(0.0, -float(joints[self._index.gripper])), _GRIPPER_TOLERANCES)
        self._posture = (float(spot_facts()["capabilities"]["standing_height"]), 0.0)
        self._leg_servos = LegServos(self._index, joints[self._index.legs])
        self._trot = Trot(nominal_footholds())
        self._trot.reset(self._motion(self._base(positions)))
        self._tip_radius_m = float(spot_facts()["gripper"]["tip_radius"])

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
        if self._runs(command):
            self._commands.finish(Part.VELOCITY, CommandState.STOPPED, "the robot sits down")
        return command

    def move_arm(self, trajectory: ArmTrajectory, *, until_s: float, lease: Lease) -> CommandId:
        """Follow a joint trajectory; done when its end is reached and the arm is still."""
        reason = self._arm.refusal(trajectory)
        return self._commands.refuse(reason) if reason else self._begin(Part.ARM, trajectory, until_s, lease)

    def point_head(self, pan_rad: float, tilt_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Spot has no head."""
        return self._commands.refuse("point_head: the robot has no head")

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
        desired[index.arm], desired[index.arm_rates] = self._arm.goal_rad, self._arm.rate_rad_s
        goal = self._gripper.goal
        lead_rad = goal.force_n * self._tip_radius_m / index.gripper_gain
        desired[index.gripper] = gripper_set_point(-goal.opening, float(joints[index.gripper]), lead_rad)
        self._drive_body(base, dt_s)
        desired[index.legs], desired[index.leg_rates] = self._legs(base, dt_s)
        gravity = plant.CalcGravityGeneralizedForces(self._context)[index.velocities]
        instance = self._model.instance
        plant.get_desired_state_input_port(instance).FixValue(self._context, desired)
        feed_forward = np.minimum(np.maximum(-gravity, -index.efforts), index.efforts)
        plant.get_actuation_input_port(instance).FixValue(self._context, feed_forward)

    def state(self) -> State:
        """What the robot itself keeps: servos, gait, sensors. Commands and leases do not outlive its computer."""
        floating_base = self._model.floating_base
        return {
            "arm_hold": None if self._commands.running(Part.ARM) is not None else self._arm.goal_rad.tolist(),
            "gripper": self._gripper.state(),
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
        self._forget_commands(now_s)
        self._arm.restore(state["arm_hold"], self._positions()[self._index.positions])
        self._gripper.restore(state["gripper"])
        self._posture = (state["posture"][0], state["posture"][1])
        self._leg_servos.restore(state["legs"])
        self._trot.restore(state["trot"])
        if self._model.floating_base is not None:
            self._model.floating_base.restore(state["floating_base"])
        self._sensors.restore(state["sensors"], now_s)

    # -- inside ---------------------------------------------------------------------------------------------------

    def _hold_still(self, part: Part) -> None:
        """Make where a part is the place where it stays; a gripper that clamps something goes on clamping."""
        joints = self._positions()[self._index.positions]
        if part is Part.ARM:
            self._arm.hold(joints)
        if part is Part.GRIPPER:
            rates = self._model.plant.GetVelocities(self._context)[self._index.velocities]
            gripper = self._index.gripper
            self._gripper.halt(max(0.0, -float(joints[gripper])), abs(float(rates[gripper])))
        if part is Part.POSTURE and self._model.floating_base is not None:
            self._posture = self._model.floating_base.posture

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
        trajectory = active.payload if active is not None and isinstance(active.payload, ArmTrajectory) else None
        elapsed_s = 0.0 if active is None else self._now_s - active.since_s
        if self._arm.follow(trajectory, elapsed_s, joints, rates):
            self._commands.finish(Part.ARM, CommandState.DONE)

    def _follow_gripper(self, joints: FloatArray, rates: FloatArray, dt_s: float) -> None:
        gripper = self._index.gripper
        closing = self._gripper.follow(-float(joints[gripper]), abs(float(rates[gripper])), dt_s)
        if closing is not Closing.MOVING:
            reason = "" if closing is Closing.ARRIVED else "stopped by an object in the gripper"
            self._commands.finish(Part.GRIPPER, CommandState.DONE, reason)

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
