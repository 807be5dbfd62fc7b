"""The open_door skill: has a door opened by its plug-in or by the robot's arm, and waits until it is open."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skills.api import Cause, Part, Running, Succeeded
from skills.doorway import DoorState, Doorway
from skills.navigate.door_openers import ArmDoor, DoorCalls
from skills.quantities import Delay
from skills.routine import Routine, RoutineSkill, SkillFailure
from skills.small.check_door import CheckDoorInputs


@dataclass(frozen=True)
class OpenDoorOptions:
    """Times within which a door opens after its plug-in has answered, and the robot opens one with its arm."""

    opens_s: Delay = 15.0
    arm_s: Delay = 60.0


class OpenDoor(RoutineSkill[CheckDoorInputs]):
    """Calls the plug-in of a door, and watches from where the robot stands until the door is open.

    A robot that opens doors itself (`Capabilities.opens_doors`) opens one of plug-in `arm`, and walks through.
    """

    name = "open_door"
    Inputs = CheckDoorInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    Options: ClassVar[type] = OpenDoorOptions
    options: OpenDoorOptions
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "no plug-in serves the door, or the robot cannot open it",
        Cause.EXECUTION: "the plug-in or the arm failed, or the door did not open",
    }
    default_timeout_s = 90.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"scan": 0.5, "localisation": 1.0}

    def run(self, inputs: CheckDoorInputs) -> Routine[Succeeded]:
        """Calls the plug-in, and waits for the door."""
        from skills.navigate.cut_off import DoorWatch  # OpenCV takes its time; trees are compiled without it

        context, begun_s = self.context, self.context.clock.now()
        door = next((each for each in context.doors if each.middle_W == inputs.middle_W), None)
        if door is None or door.opener is None:
            raise SkillFailure(Cause.PRECONDITION, f"nothing opens the {inputs.door} but people")
        if isinstance(door.opener, ArmDoor):
            return (yield from self._with_arm(door, door.opener, inputs.door))
        calls, watch = DoorCalls(context, self.options.opens_s), DoorWatch(context)
        while True:
            watch.look()
            seen = context.door_memory.last_seen(door)
            if seen.state is DoorState.OPEN and seen.seen_s >= begun_s:
                return Succeeded(f"the {inputs.door} is open")
            if not calls.may_open([door]):
                raise SkillFailure(Cause.EXECUTION, calls.reasons([door]))
            yield Running(f"waiting until the {inputs.door} opens")

    def _with_arm(self, door: Doorway, opener: ArmDoor, name: str) -> Routine[Succeeded]:
        """Lets the robot open the door before it. Raises SkillFailure."""
        robot, lease, now = self.context.robot, self.context.lease, self.context.clock.now
        capabilities, message = robot.capabilities(), f"opening the {name}"
        if not capabilities.opens_doors:
            raise SkillFailure(Cause.PRECONDITION, f"this robot cannot open the {name} with an arm")

        def attempt() -> Routine[None]:
            handle = opener.handle_from(self.context.pose(), capabilities.standing_height_m, door.middle_W)
            until_s = now() + self.options.arm_s
            command = self.issue(robot.open_door(handle, until_s=until_s, lease=lease))
            yield from self.finish(command, message, "the robot", until_s=until_s)

        yield from self.persist(attempt, message)
        return Succeeded(f"opened the {name} and walked through")
