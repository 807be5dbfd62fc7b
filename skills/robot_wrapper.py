"""Base class of robots that wrap another robot and change the behaviour of single verbs."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any, Concatenate, Final, ParamSpec, TypeVar, cast

from skills.robot import CommandId, Robot

AnswerT = TypeVar("AnswerT")
VerbP = ParamSpec("VerbP")
VERBS: Final = tuple(name for name in vars(Robot) if not name.startswith("_") and name != "name")
"""Names of all verbs of the Robot protocol."""


def _forward(
    verb: Callable[Concatenate[Robot, VerbP], AnswerT], through: str = "_call"
) -> Callable[Concatenate[RobotWrapper, VerbP], AnswerT]:
    """Method that passes a verb to the wrapped robot through `RobotWrapper._call` or `RobotWrapper._command`."""
    name, signature = verb.__name__, inspect.signature(verb)

    @functools.wraps(verb)
    def method(self: RobotWrapper, /, *arguments: VerbP.args, **options: VerbP.kwargs) -> AnswerT:
        call, make_call = getattr(self._robot, name), cast(Callable[..., AnswerT], getattr(self, through))
        if not arguments and not options:
            return make_call(name, call)
        given = signature.bind(self, *arguments, **options)
        given.apply_defaults()  # a call is the same however its caller writes it
        return make_call(name, call, *given.args[1:], **given.kwargs)

    return method


class RobotWrapper(Robot):
    """Robot that wraps another one: every verb goes through `_call`, and verbs that move the robot through `_command`.

    By default both make the call unchanged; a subclass overrides them, or single verbs.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot

    def _call(self, verb: str, call: Callable[..., AnswerT], *arguments: Any, **options: Any) -> AnswerT:
        """Calls `call`, the wrapped robot's method for a verb."""
        return call(*arguments, **options)

    def _command(self, verb: str, call: Callable[..., CommandId], *arguments: Any, **options: Any) -> CommandId:
        """Calls `call`, the wrapped robot's method for a verb that moves the robot."""
        return self._call(verb, call, *arguments, **options)

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self._robot.name

    capabilities = _forward(Robot.capabilities)
    odometry = _forward(Robot.odometry)
    own_localisation = _forward(Robot.own_localisation)
    imu = _forward(Robot.imu)
    scan = _forward(Robot.scan)
    image = _forward(Robot.image)
    joints = _forward(Robot.joints)
    gripper = _forward(Robot.gripper)
    battery = _forward(Robot.battery)
    faults = _forward(Robot.faults)
    drive = _forward(Robot.drive, "_command")
    stand = _forward(Robot.stand, "_command")
    sit = _forward(Robot.sit, "_command")
    dock = _forward(Robot.dock, "_command")
    undock = _forward(Robot.undock, "_command")
    open_door = _forward(Robot.open_door, "_command")
    move_arm = _forward(Robot.move_arm, "_command")
    point_head = _forward(Robot.point_head, "_command")
    set_gripper = _forward(Robot.set_gripper, "_command")
    carry = _forward(Robot.carry)
    stop = _forward(Robot.stop, "_command")
    command_status = _forward(Robot.command_status)
    lease_holder = _forward(Robot.lease_holder)
    acquire_lease = _forward(Robot.acquire_lease)
    take_lease = _forward(Robot.take_lease)
    return_lease = _forward(Robot.return_lease)
