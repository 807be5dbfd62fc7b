"""Door skills: check_door measures whether a door is open; open_door opens it by its plug-in or the robot's arm."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from skills.api import Cause, Part, Running, Succeeded
from skills.doorway import DoorState, Doorway, Opening, measure_opening
from skills.navigate.door_openers import ArmDoor, DoorCalls
from skills.quantities import Angle, Coordinate, Count, Delay, Length, Margin, Turn
from skills.robot import Scan
from skills.routine import PATIENCE_S, Routine, RoutineSkill, SkillFailure

if TYPE_CHECKING:
    from pydrake.math import RigidTransform

_SCAN_PATIENCE_S = PATIENCE_S
_CLOSED_M = 0.1
"""A door with a gap up to this is closed."""
_FEW_RAYS = 50
"""Number of rays below which hardly anything is seen."""


@dataclass(frozen=True)
class CheckDoorInputs:
    """Doorway: its centre `middle_W` (x, y), clear width, the direction through it (either way), and name."""

    middle_W: tuple[Coordinate, Coordinate]
    width_m: Length
    through_rad: Angle
    door: str = "door"


@dataclass(frozen=True)
class CheckDoorOptions:
    """Measurement with `scans` scans, repeated up to `looks` times with `pause_s` in between, until the state is known.

    `reach_m` and `flattest_rad`: largest distance and view angle at which the state can be known. `margin_m`: the door
    is open when the robot's outline fits through with this margin on each side.
    """

    scans: Count = 5
    looks: Count = 3
    pause_s: Delay = 3.0
    reach_m: Length = 4.0
    flattest_rad: Turn = 1.1
    margin_m: Margin = 0.05


class CheckDoor(RoutineSkill[CheckDoorInputs]):
    """Measures with the LiDAR whether a door is open, from where the robot stands.

    A gap too narrow for the robot does not count as open. Rays that end clearly beyond the doorway show where it is
    free. Objects on the floor are not judged.
    """

    name = "check_door"
    Inputs = CheckDoorInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    Options: ClassVar[type] = CheckDoorOptions
    options: CheckDoorOptions
    outputs: ClassVar[Mapping[str, type]] = {"open": bool, "free_m": float}
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "there is no new scan, or the robot does not know where it is",
        Cause.POSTCONDITION: "it cannot tell: too far, seen too flat, or something stands in the doorway or before it",
    }
    default_timeout_s = 30.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"scan": 0.5, "localisation": 1.0}

    def run(self, inputs: CheckDoorInputs) -> Routine[Succeeded]:
        """Measures until the state is known."""
        door = Doorway(inputs.middle_W, inputs.width_m, inputs.through_rad)
        for look in range(self.options.looks):
            if look:
                yield from self.pause(self.options.pause_s, f"waiting until more is seen of the {inputs.door}")
            seen = yield from self._look(door, inputs.door)
            if seen.least_m >= self._needed_m() or seen.most_m < self._needed_m():
                answer = self._answer(inputs, seen)
                state = DoorState.OPEN if answer.outputs["open"] else DoorState.CLOSED
                self.context.door_memory.note(door, state, self.context.clock.now())
                return answer
        few = f"the scan shows hardly anything of the {inputs.door}"
        why = few if seen.rays < _FEW_RAYS else f"something stands in the {inputs.door} or before it"
        raise SkillFailure(Cause.POSTCONDITION, why)

    def _look(self, door: Doorway, name: str) -> Routine[Opening]:
        """Measures the opening in the next scans.

        Raises SkillFailure when there are none, the robot is lost, or its distance or view angle is too large.
        """
        scans: list[tuple[Scan, RigidTransform]] = []
        while len(scans) < self.options.scans:
            scan = yield from self._next_scan(f"looking at the {name}")
            estimate = self.context.localiser.estimate()
            if not estimate.localised:
                raise SkillFailure(Cause.PRECONDITION, "the robot does not know where it is")
            scans.append((scan, estimate.X_WO @ scan.X_OB @ scan.X_BL))
        x_m, y_m, _ = (float(value) for value in scans[-1][1].translation())
        if (far_m := door.distance_m((x_m, y_m))) > self.options.reach_m:
            raise SkillFailure(Cause.POSTCONDITION, f"the {name} is {far_m:.1f} m away, too far to tell")
        if door.view_angle_rad((x_m, y_m)) > self.options.flattest_rad:
            raise SkillFailure(Cause.POSTCONDITION, f"the {name} is seen at too flat an angle from here to tell")
        return measure_opening(door, scans)

    def _next_scan(self, message: str) -> Routine[Scan]:
        """Returns the first scan taken from now on. Raises SkillFailure when none arrives."""
        now_s = self.context.clock.now()
        while (scan := self.context.robot.scan()) is None or scan.stamp_s <= now_s:
            if self.context.clock.now() > now_s + _SCAN_PATIENCE_S:
                raise SkillFailure(Cause.PRECONDITION, "there is no new scan to see the door in")
            yield Running(message)
        return scan

    def _needed_m(self) -> float:
        """Width of the robot with a margin on each side."""
        sides = [y for _, y in self.context.robot.capabilities().footprint_m]
        return max(sides) - min(sides) + 2.0 * self.options.margin_m

    def _answer(self, inputs: CheckDoorInputs, seen: Opening) -> Succeeded:
        """Returns the success with the door's state."""
        door, needed_m = inputs.door, self._needed_m()
        outputs = {"open": seen.least_m >= needed_m, "free_m": seen.least_m}
        if outputs["open"]:
            return Succeeded(f"the {door} is open: {seen.least_m:.2f} m of {inputs.width_m:.2f} m are free", outputs)
        if seen.most_m <= _CLOSED_M:
            return Succeeded(f"the {door} is closed", outputs)
        gap = f"at most {seen.most_m:.2f} m are free, and the robot needs {needed_m:.2f} m"
        return Succeeded(f"the {door} is not open: {gap}", outputs)


@dataclass(frozen=True)
class OpenDoorOptions:
    """Time limits: for a door to open after its plug-in has answered, and for the robot to open one with its arm."""

    opens_s: Delay = 15.0
    arm_s: Delay = 60.0


class OpenDoor(RoutineSkill[CheckDoorInputs]):
    """Calls the plug-in of a door, and watches from where the robot stands until the door is open.

    A robot with `Capabilities.opens_doors` opens a door that has the plug-in `arm` itself, and walks through.
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
        """Lets the robot open the door in front of it. Raises SkillFailure when the door does not open."""
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
