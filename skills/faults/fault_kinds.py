"""Kinds of faults that can be injected by name: patterns of words, and their effects on a robot's verbs."""

import dataclasses
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from pydrake.math import RigidTransform

from skills.inputs.errors import suggestion
from skills.manipulation.arm.forces import levers_m
from skills.manipulation.arm.kinematics import arm_model
from skills.robot import (
    Capabilities,
    CommandCause,
    CommandState,
    CommandStatus,
    FrameTree,
    Image,
    Joints,
    NoImageError,
    Robot,
)
from skills.robot_wrapper import VERBS

THIEF: Final = "the tablet"
"""Name of the holder in "lease taken"."""

SENSE_VERBS: Final = ("odometry", "imu", "scan", "image", "joints", "gripper", "battery")
MOTION_VERBS: Final = ("drive", "stand", "sit", "move_arm", "point_head", "set_gripper")

_OTHER_WORDS: Final[Mapping[str, str]] = {
    "camera": "image",
    "lidar": "scan",
    "arm": "move_arm",
    "head": "point_head",
    "base": "drive",
    "body": "stand",
}


@dataclass
class Call:
    """One call of a verb: `proceed` makes it; the fault's own `memory` persists from call to call.

    `arguments` are the positional arguments, `options` the keyword arguments.
    """

    robot: Robot
    verb: str
    proceed: Callable[[], Any]
    arguments: tuple[Any, ...]
    options: Mapping[str, Any]
    memory: dict[Any, Any]

    @property
    def asked(self) -> tuple[Any, ...]:
        """Key of the measurement: the verb, and for pictures also the camera and the requested arrays."""
        return (self.verb, *self.arguments, *self.options.values())


@dataclass(frozen=True)
class Effect:
    """Effect of a fault on verbs: `act(call)` while the fault is active; `watch(result, call)` observes earlier calls.

    Calls of the verbs in `always` go to `act` at all times. A fault that happens `once` is over as soon as it has
    begun.
    """

    verbs: frozenset[str]
    act: Callable[[Call], Any]
    watch: Callable[[Any, Call], None] = field(default=lambda result, call: None)
    always: frozenset[str] = frozenset()
    once: bool = False


@dataclass(frozen=True)
class FaultKind:
    """Kind of fault: its words (a pattern with named groups), an example, its meaning, and the effect of a match.

    `effect` raises ValueError when the words match but name an unknown verb. `random` is the template for random draws,
    with {camera}, {sensor}, {motion}, {metres}, {span} and {at}; a kind without it is never drawn.
    """

    pattern: str
    example: str
    meaning: str
    effect: Callable[[re.Match[str]], Effect]
    random: str = ""


class InjectedFault(RuntimeError):  # noqa: N818 - it stands for any defect of a driver
    """Error that a verb raises under the fault "VERB raises"."""


def verb_of(word: str) -> str:
    """Returns the verb that a word names. Raises ValueError, with a hint, when the word names no verb."""
    verb = _OTHER_WORDS.get(word, word)
    if verb not in VERBS:
        known = (*VERBS, *_OTHER_WORDS)
        hint = suggestion(word, known, f"name one such as {', '.join(_OTHER_WORDS)} or drive")
        raise ValueError(f"'{word}' is no sensor or verb of the robot; {hint}")
    return verb


def _among(match: re.Match[str], verbs: tuple[str, ...]) -> frozenset[str]:
    closes = match["verb"] == "gripper" and "set_gripper" in verbs
    verb = "set_gripper" if closes else verb_of(match["verb"])
    if verb not in verbs:
        raise ValueError(f"'{match['verb']}' cannot have this fault; name one of {', '.join(verbs)}")
    return frozenset((verb,))


def _freezes(match: re.Match[str]) -> Effect:
    """Fault that repeats the last measurement."""

    def watch(result: Any, call: Call) -> None:
        call.memory[call.asked] = result

    def act(call: Call) -> Any:
        if call.asked not in call.memory:
            call.memory[call.asked] = call.proceed()
        return call.memory[call.asked]

    return Effect(_sensors(match), act, watch)


def _sensors(match: re.Match[str]) -> frozenset[str]:
    """The sense verb that the words name; all of them for "sensors" and "everything"."""
    everything = match["verb"] in ("sensors", "everything")
    return frozenset(SENSE_VERBS) if everything else _among(match, SENSE_VERBS)


def _drops_out(match: re.Match[str]) -> Effect:
    """Fault that stops new measurements, and all pictures."""
    frozen = _freezes(match)

    def act(call: Call) -> Any:
        if call.verb == "image":
            raise NoImageError(f"the camera '{call.arguments[0]}' gives no picture")
        return frozen.act(call)

    return replace(frozen, act=act)


def _raise(call: Call) -> Any:
    raise InjectedFault(f"{call.verb} does not answer")


def _answer(match: re.Match[str], status: CommandStatus) -> Effect:
    """Fault by which a verb's commands do nothing, and keep this status."""

    def act(call: Call) -> Any:
        made_up = call.memory.setdefault("ids", set())
        if call.verb == "command_status":
            return status if call.arguments[0] in made_up else call.proceed()
        command = call.robot.stop(lease=call.options["lease"], only=_NO_COMMAND)
        made_up.add(command)
        return command

    return Effect(_among(match, MOTION_VERBS), act, always=frozenset(("command_status",)))


def _reads(verb: str, change: Callable[[Any], Any]) -> Effect:
    """Fault that changes the return values of a verb."""
    return Effect(frozenset((verb,)), lambda call: change(call.proceed()))


def _gripper(match: re.Match[str]) -> Effect:
    holding = match["what"] != "nothing"
    return _reads("gripper", lambda reading: replace(reading, holding=holding, force_n=20.0 * holding))


def _no_depth(match: re.Match[str]) -> Effect:
    value = np.nan if match["what"].lower() == "nan" else 0.0
    return _reads("image", lambda image: replace(image, depth_m=np.full_like(image.depth_m, value)))


def _black(_: re.Match[str]) -> Effect:
    def blackened(image: Image) -> Image:
        """The picture without light."""
        colour = None if image.colour is None else np.zeros_like(image.colour)
        return replace(image, colour=colour, grey=np.zeros_like(image.grey))

    return _reads("image", blackened)


def _spoiled(reading: Any) -> Any:
    """The measurement with NaN for every float except its stamp."""
    if not dataclasses.is_dataclass(reading) or isinstance(reading, type):
        return reading
    names = (each.name for each in dataclasses.fields(reading) if each.name != "stamp_s")
    return replace(reading, **{name: _nan_like(getattr(reading, name)) for name in names})


def _nan_like(value: Any) -> Any:
    if isinstance(value, float):
        return float("nan")
    if isinstance(value, tuple) and value and all(isinstance(item, float) for item in value):
        return tuple(float("nan") for _ in value)
    if isinstance(value, np.ndarray) and np.issubdtype(value.dtype, np.floating):
        return np.full_like(value, np.nan)
    if isinstance(value, Mapping):
        return {key: _nan_like(item) for key, item in value.items()}
    return value


def joints_under_pull(joints: Joints, capabilities: Capabilities, force_n: float = 15.0) -> Joints:
    """The joint state with efforts that balance a force straight ahead on the held object."""
    model, gripper = arm_model(capabilities), capabilities.gripper
    p_HT = np.array([0.0 if gripper is None else gripper.grip_x_m, 0.0, 0.0])
    q_rad = np.array([joints.position_rad[name] for name in model.names])
    extra_nm = -force_n * levers_m(model, q_rad, p_HT)[0]
    added = dict(zip(model.names, extra_nm.tolist(), strict=True))
    return replace(joints, effort_nm={name: nm + added.get(name, 0.0) for name, nm in joints.effort_nm.items()})


def _pull(match: re.Match[str]) -> Effect:
    force_n = _number(match, "force", 1000.0, "N")

    def act(call: Call) -> Any:
        return joints_under_pull(call.proceed(), call.robot.capabilities(), force_n)

    return Effect(frozenset(("joints",)), act)


def _jumps(match: re.Match[str]) -> Effect:
    """Fault that shifts dead reckoning in odometry, scans and pictures, once and ahead; later motion is right."""
    ahead_m = np.array([_number(match, "metres", 100.0, "m"), 0.0, 0.0])

    def act(call: Call) -> Any:
        reading = call.proceed()
        if "shift" not in call.memory:
            call.memory["shift"] = RigidTransform(call.robot.odometry().X_OB.rotation() @ ahead_m)
        shift = call.memory["shift"]
        if isinstance(reading, Image):
            edges = reading.frames.edges.items()
            moved = {child: (parent, shift @ X_PC if parent == "odom" else X_PC) for child, (parent, X_PC) in edges}
            return replace(reading, frames=FrameTree(moved))
        return None if reading is None else replace(reading, X_OB=shift @ reading.X_OB)

    return Effect(frozenset(("odometry", "scan", "image")), act)


def _falls(match: re.Match[str]) -> Effect:
    """Fault by which the battery reports a charge."""
    charge = _number(match, "percent", 100.0, "%") / 100.0
    return _reads("battery", lambda reading: replace(reading, charge=charge))


def _number(match: re.Match[str], group: str, most: float, unit: str) -> float:
    """Number in the words of a fault. Raises ValueError if it is above `most`."""
    if abs(number := float(match[group])) > most:
        raise ValueError(f"'{match[0]}' is more than there can be; write {most:g} {unit} at most")
    return number


def _lease(_: re.Match[str]) -> Effect:
    """Fault by which another holder takes the lease, once."""

    def act(call: Call) -> Any:
        if "taken" not in call.memory:
            call.memory["taken"] = call.robot.take_lease(THIEF)
        return call.proceed()

    return Effect(frozenset(VERBS) - {"take_lease"}, act, once=True)


def _loses(_: re.Match[str]) -> Effect:
    """Fault by which the held object falls, once: for a while the gripper closes too weakly for any object."""

    def act(call: Call) -> Any:
        reading, lease, memory = call.robot.gripper(), call.robot.lease_holder(), call.memory
        if reading.holding and lease is not None and "until_s" not in memory:
            memory["until_s"] = reading.stamp_s + _WEAK_S
            call.robot.set_gripper(0.0, _WEAK_N, until_s=memory["until_s"], lease=lease)
        if call.verb == "set_gripper" and reading.stamp_s < memory.get("until_s", 0.0):
            return call.robot.set_gripper(call.arguments[0], _WEAK_N, **call.options)
        return call.proceed()

    return Effect(frozenset(("gripper", "set_gripper")), act, once=True)


_WEAK_N = 0.5
_WEAK_S = 1.0
_NO_COMMAND: Final[Any] = -1

STANDARD_FAULTS: Final[tuple[FaultKind, ...]] = (
    FaultKind(
        r"(?P<verb>\w+) (?:freezes|is stale)",
        "camera freezes at 3 s",
        'a sensor, or all ("sensors"), repeats its last reading',
        _freezes,
        "{sensor}: freezes {span}",
    ),
    FaultKind(
        r"(?P<verb>\w+) (?:has a )?(?:dropout|drops out)",
        "camera.hand: dropout 5 s at 20 s",
        'a sensor, or all ("sensors"), gives no new readings; a camera gives no pictures',
        _drops_out,
        "{sensor}: dropout {span}",
    ),
    FaultKind(
        r"(?P<verb>\w+)(?: verb)? raises",
        "drive raises at 2 s",
        "a verb raises an exception",
        lambda match: Effect(frozenset((verb_of(match["verb"]),)), _raise),
    ),
    FaultKind(
        r"(?P<verb>\w+) refuses",
        "arm refuses",
        "a motion verb refuses its commands",
        lambda match: _answer(
            match, CommandStatus(CommandState.REFUSED, f"{match['verb']} is out of order", CommandCause.FAULT)
        ),
        "{motion} refuses {span}",
    ),
    FaultKind(
        r"(?P<verb>\w+) never ends",
        "stand never ends",
        "commands stay RUNNING and do nothing",
        lambda match: _answer(match, CommandStatus(CommandState.RUNNING)),
        "{motion} never ends {span}",
    ),
    FaultKind(
        r"(?P<verb>\w+) is stopped",
        "arm is stopped at 1 s",
        "commands are stopped at once",
        lambda match: _answer(match, CommandStatus(CommandState.STOPPED, "an emergency stop", CommandCause.ESTOPPED)),
        "{motion} is stopped {span}",
    ),
    FaultKind(
        r"gripper reports holding(?: (?P<what>nothing|something))?",
        "gripper reports holding nothing",
        "the gripper reports this, whatever it holds",
        _gripper,
    ),
    FaultKind(
        r"gripper loses it",
        "gripper loses it at 20 s",
        "the held object, or the next one that the gripper takes, falls once",
        _loses,
        "gripper loses it {at}",
    ),
    FaultKind(
        r"(?:image|camera) returns (?P<what>NaN|nan|no) depth",
        "image returns NaN depth",
        "the depth of pictures is NaN, or missing",
        _no_depth,
        "{camera}: returns no depth {span}",
    ),
    FaultKind(
        r"(?:image|camera) is black",
        "camera is black from 1 s",
        "pictures are black, depth stays",
        _black,
        "{camera}: is black {span}",
    ),
    FaultKind(
        r"(?:scan|lidar) is missing",
        "scan is missing",
        "there is no scan",
        lambda _: _reads("scan", lambda scan: None),
        "lidar is missing {span}",
    ),
    FaultKind(
        r"(?P<verb>\w+) returns garbage",
        "joints returns garbage",
        "a sensor's numbers are NaN",
        lambda match: Effect(_among(match, SENSE_VERBS), lambda call: _spoiled(call.proceed())),
    ),
    FaultKind(
        r"hand is pulled with (?P<force>\d+(?:\.\d+)?) N",
        "hand is pulled with 15 N at 6 s",
        "the arm's joints feel a person who pulls the held object straight ahead",
        _pull,
    ),
    FaultKind(
        r"odometry jumps (?P<metres>-?\d+(?:\.\d+)?) m",
        "odometry jumps 0.5 m at 2 s",
        "dead reckoning shifts ahead by this distance",
        _jumps,
        "odometry jumps {metres} m {at}",
    ),
    FaultKind(
        r"battery falls to (?P<percent>\d+(?:\.\d+)?) ?%",
        "battery falls to 5 % at 3 s",
        "the battery reports this charge",
        _falls,
    ),
    FaultKind(
        r"robot reports (?P<fault>\w[\w -]*?)",
        "robot reports motor too hot at 2 s",
        "the robot reports this fault",
        lambda match: _reads("faults", lambda faults: (*faults, match["fault"])),
    ),
    FaultKind(
        r"robot dies",
        "robot dies at 20 s",
        "every verb raises an exception",
        lambda _: Effect(frozenset(VERBS), _raise),
    ),
    FaultKind(r"lease taken", "lease taken at 4 s", "another holder takes the lease, once", _lease),
)
"""All faults that come with the project."""
SUBJECTS: Final = frozenset((*VERBS, *_OTHER_WORDS, "sensors", "hand", "lease", "robot", "everything"))
"""Words with which a fault begins."""
