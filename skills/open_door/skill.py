"""The open_door skill: has a door opened by its plug-in, and waits until it is open."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skills.api import Cause, Part, Running, Succeeded
from skills.check_door.skill import CheckDoorInputs
from skills.navigate.cut_off import DoorWatch
from skills.open_door.calls import DoorCalls
from skills.perception.doorway import DoorState
from skills.quantities import Delay
from skills.routine import Routine, RoutineSkill, SkillFailure


@dataclass(frozen=True)
class OpenDoorOptions:
    """Time within which a door opens after its plug-in has answered."""

    opens_s: Delay = 15.0


class OpenDoor(RoutineSkill[CheckDoorInputs]):
    """Calls the plug-in of a door, and watches from where the robot stands until the door is open."""

    name = "open_door"
    Inputs = CheckDoorInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    Options: ClassVar[type] = OpenDoorOptions
    options: OpenDoorOptions
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "no plug-in serves the door",
        Cause.EXECUTION: "the plug-in failed, or the door did not open",
    }
    max_data_age_s: ClassVar[Mapping[str, float]] = {"scan": 0.5, "localisation": 1.0}

    def run(self, inputs: CheckDoorInputs) -> Routine[Succeeded]:
        """Calls the plug-in, and waits for the door."""
        context, begun_s = self.context, self.context.clock.now()
        door = next((each for each in context.doors if each.middle_W == inputs.middle_W), None)
        if door is None or door.opener is None:
            raise SkillFailure(Cause.PRECONDITION, f"nothing opens the {inputs.door} but people")
        calls, watch = DoorCalls(context, self.options.opens_s), DoorWatch(context)
        while True:
            watch.look()
            seen = context.door_memory.last_seen(door)
            if seen.state is DoorState.OPEN and seen.seen_s >= begun_s:
                return Succeeded(f"the {inputs.door} is open")
            if not calls.may_open([door]):
                raise SkillFailure(Cause.EXECUTION, calls.reasons([door]))
            yield Running(f"waiting until the {inputs.door} opens")
