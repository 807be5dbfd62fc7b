"""The hand-over skill: holds the object out to a person, and releases it when they pull or the operator says so."""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import ClassVar

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from skills.api import Cause, PlanningError, Question, Running, Succeeded
from skills.footprint import footprint_clear
from skills.geometry import facing_poses
from skills.hold import Grip
from skills.manipulation.approach.base_placement import go_to_one
from skills.manipulation.arm.collision import ArmScene, Box
from skills.manipulation.arm.forces import PullWatch
from skills.manipulation.hand_over.verification import HandOverVerification, Release, Seen, release_of
from skills.navigate.arm_footprint import ArmFootprint
from skills.navigate.surroundings import NavigateInputs
from skills.perception.people import SeenPerson, people_in_scan
from skills.quantities import Duration, Force, Height, Length
from skills.robot import FloatArray
from skills.routine import Patience, Routine, SkillFailure
from skills.world_model import PERSON

_FACING_RAD = 0.5
"""Largest bearing of a person who is ahead."""
_SCANS = 3
"""Number of scans in which the person must be seen."""
_SCAN_PATIENCE_S = 2.0
_SCAN_AGE_S = 1.0
_SAME_PERSON_M = 0.25
_PERSON_SIZE_M = (0.6, 0.6, 1.8)
_STILL_S = 0.5
"""Pause in which hand and object come to rest."""
_LETS_GO = "let go"
_KEEPS = "hold on"
_POINTS_DOWN = 0.8
"""Vertical component of the hand's direction from which on the hand points down."""
_TRIES = 2
_HOLD_OUT_RAD_S = 0.8


@dataclass(frozen=True)
class HandOverInputs:
    """Names of the person and of the object, for messages; the skill chooses the nearest person in sight.

    `met`: the robot has just met the person, so that its result need not say that it takes somebody for them.
    """

    person: str
    thing: str = "object"
    met: bool = False


@dataclass(frozen=True)
class HandOverOptions:
    """Positions of the robot and of the object, and the condition for the release.

    `stand_off_m` and `stand_off_range_m`: distance from the person's axis to which the robot drives, and the range
    within which it stays. `height_m`: height of the object. `gaps_m` and `furthest_m`: distances between object and
    person's axis, of which the first reachable one is used, and the largest allowed. `pull_n`: pull beyond which the
    gripper releases. `wait_s`: time after which the arm draws the object in when nobody has taken it.
    """

    stand_off_m: Length = 1.5
    stand_off_range_m: tuple[Length, Length] = (1.25, 1.65)
    height_m: Height = 1.0
    gaps_m: tuple[Length, ...] = (0.55, 0.5, 0.45, 0.62, 0.7, 0.8)
    furthest_m: Length = 0.85
    pull_n: Force = 7.0
    wait_s: Duration = 20.0


class HandOver(HandOverVerification[HandOverInputs]):
    """Finds a person by LiDAR, goes there, holds the object out, releases it when they pull, and checks who has it.

    The output `released_W` is the point of the release, also after a later failure; a failure before it has none.
    """

    name = "hand_over"
    Inputs = HandOverInputs
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "nothing is held, there is no new scan, or nobody is seen near",
        Cause.PLANNING: "no free place before the person, or no free path for the arm",
        Cause.EXECUTION: "the robot or its arm did not reach its goal",
        Cause.POSTCONDITION: "the object was lost, is still in the gripper, or is not seen at rest with the person",
        Cause.TIMEOUT: "the person did not take the object",
    }
    default_timeout_s = 180.0
    Options: ClassVar[type] = HandOverOptions
    options: HandOverOptions

    lost_message = "the {thing} was lost before it was held out"

    def begin(self, inputs: HandOverInputs) -> None:
        """Resets the state of an earlier attempt."""
        self.checkpoint = {}
        super().begin(inputs)

    def run(self, inputs: HandOverInputs) -> Routine[Succeeded]:
        """Finds the person, goes there, holds the object out and releases it; tries again when that fails."""
        if not (yield from self.holds("feeling what the gripper holds")):
            raise SkillFailure(Cause.PRECONDITION, "there is nothing in the gripper to hand over")
        for _ in range(_TRIES):
            seen = yield from self._give(inputs)
            if seen is not Seen.IN_GRIPPER:
                break
            self.checkpoint = {}
        return self._given(inputs, seen)

    def _give(self, inputs: HandOverInputs) -> Routine[Seen]:
        """Holds the object out and releases it; returns the result of the check."""
        self._watch = self.hold_watch()
        person = yield from self._find(inputs.person)
        if not _well_placed(self._ahead(person), self.options.stand_off_range_m):
            yield from self._go_before(person, inputs.person)
            person = yield from self._find(inputs.person)
        q_carrying_rad = self.q_rad()
        yield from self._hold_out(person, inputs.person)
        self._check(person, inputs.person)
        yield from self.pause(_STILL_S, f"holding the {inputs.thing} out to {inputs.person}")
        held_kg = yield from self.weigh(self.p_HT, f"weighing the {inputs.thing}")
        self._watch, self.context.payload.offered = None, True
        if not (yield from self._pulled(inputs)):
            yield from self.move_to(lambda scene, q: q_carrying_rad, f"drawing the {inputs.thing} in")
            why = f"{inputs.person} did not take the {inputs.thing} within {self.options.wait_s:g} s"
            raise SkillFailure(Cause.TIMEOUT, why)
        return (yield from self._let_go(inputs, held_kg))

    def run_again(self, inputs: HandOverInputs) -> Routine[Succeeded]:
        """Continues an interrupted attempt; after the release it only checks whether the person has the object."""
        self._watch = None
        if self.checkpoint.get("lets_go"):
            seen = yield from self._let_go(inputs, None)
            if seen is not Seen.IN_GRIPPER:
                return self._given(inputs, seen)
            self.checkpoint = {}
        return (yield from self.run(inputs))

    def _given(self, inputs: HandOverInputs, seen: Seen) -> Succeeded:
        """Returns success when the person has the object at rest. Raises SkillFailure with cause POSTCONDITION."""
        name, person = inputs.thing, inputs.person
        why = {
            Seen.IN_GRIPPER: f"the {name} is still in the gripper",
            Seen.FELL: f"the {name} fell to the floor before {person}",
            Seen.NOT_SEEN: f"the {name} is not seen where it was released before {person}",
            Seen.MOVES: f"the {name} still moves where it was released before {person}",
        }
        if seen in why:
            raise SkillFailure(Cause.POSTCONDITION, why[seen])
        whom = person if inputs.met or person in ("somebody", PERSON) else f"somebody, taken for {person}"
        return Succeeded(f"gave the {name} to {whom}")

    def _pulled(self, inputs: HandOverInputs) -> Routine[bool]:
        """Waits for a pull at the object or the operator's answer; returns False when `wait_s` is over.

        Also returns True when the object has left the gripper: a person pulled it out, or it has fallen.
        """
        message, robot = f"holding the {inputs.thing} out to {inputs.person}", self.context.robot
        period_s = robot.capabilities().sensor_period_s
        watch, hold = PullWatch(self.model, self.p_HT, self.options.pull_n, period_s), self.hold_watch()
        text = f"{robot.name} holds the {inputs.thing} out to {inputs.person}. Let go?"
        question = Question(f"hand-over/{robot.name}", text, (_LETS_GO, _KEEPS), _KEEPS, self.options.wait_s)
        asked, end_s = self.context.ask(question), self.context.clock.now() + self.options.wait_s
        try:
            while self.context.clock.now() < end_s:
                confirmed = asked.done() and asked.result() == _LETS_GO
                gone = self.grip_by(hold) is Grip.LOST
                if gone or confirmed or watch.feels_pull(robot.joints().stamp_s, self.q_rad(), self.efforts_nm()):
                    return True
                yield Running(message)
            return False
        finally:
            asked.withdraw()

    def _let_go(self, inputs: HandOverInputs, held_kg: float | None) -> Routine[Seen]:
        """Opens the gripper until it feels no object, draws back without dragging the object, and checks who has it."""
        name, message = inputs.thing, f"giving the {inputs.thing} to {inputs.person}"
        if not self.checkpoint.get("lets_go"):
            corners_H = self.context.payload.corners_H
            release = release_of(self.X_WB() @ self.model.X_BH(self.q_rad()), self.p_HT, corners_H)
            self.checkpoint = {"lets_go": True, "release": asdict(release)}
        if not (yield from self.open_hand(message)) or (yield from self.hangs_on_hand(held_kg, message)):
            yield from self.shake_off(f"shaking the {name} off the fingers", turns_hand=True)
        yield from self.leave_object()
        return (yield from self.verify(name, inputs.person, Release(**self.checkpoint["release"])))

    def _find(self, name: str) -> Routine[SeenPerson]:
        """Finds the nearest person in several scans, preferring people ahead; waits for missing scans.

        Raises SkillFailure when there are no new scans, or when they show nobody.
        """
        clock, patience, seen = self.context.clock, Patience(self.context.clock), list[SeenPerson]()
        stamp_s, end_s = -math.inf, clock.now() + _SCAN_PATIENCE_S
        while len(seen) < _SCANS and clock.now() < end_s:
            scan = self.context.robot.scan()
            if scan is None or scan.stamp_s < clock.now() - _SCAN_AGE_S:
                if not patience.is_left():
                    raise SkillFailure(Cause.PRECONDITION, f"there is no new scan to see {name} in")
                end_s = clock.now() + _SCAN_PATIENCE_S
                yield Running(f"looking for {name}; waits for a scan")
                continue
            patience.reset()
            if scan.stamp_s > stamp_s:
                stamp_s = scan.stamp_s
                footprint_m = self.context.robot.capabilities().footprint_m
                people = people_in_scan(scan, self.X_WB(), footprint_m, costmap=self.context.costmap)
                near = (p for p in people if not seen or math.dist(p.place_W, seen[0].place_W) < _SAME_PERSON_M)
                seen += [*near][:1]
            yield Running(f"looking for {name}")
        if len(seen) < _SCANS:
            raise SkillFailure(Cause.PRECONDITION, "nobody is seen near to take the object")
        x, y = (float(np.median([p.place_W[axis] for p in seen])) for axis in (0, 1))
        return replace(seen[-1], place_W=(x, y))

    def _go_before(self, person: SeenPerson, name: str) -> Routine[None]:
        """Drives to the nearest free pose that faces the person."""
        poses = facing_poses(person.place_W, self.context.pose(), self.options.stand_off_m)
        footprint = ArmFootprint(self.context).now()
        space = self.context.free_space()
        free = [pose for pose in poses if footprint_clear(space, footprint, pose)]
        if not free:
            raise SkillFailure(Cause.PLANNING, f"there is no free place to stand before {name}")
        yield from go_to_one(self, [NavigateInputs(pose, 0.08, 0.1, 0.5) for pose in free[:3]])

    def _hold_out(self, person: SeenPerson, name: str) -> Routine[None]:
        """Stretches the arm towards the person, with the object in its grasped pose, or else in its carried pose.

        In the carried pose an object may rest on a finger, where it would stay when the gripper opens.
        """
        grasped_R_BH, R_BH = self.context.payload.R_BH, self.model.X_BH(self.q_rad()).rotation()
        rotations = [R_BH] if grasped_R_BH is None else [grasped_R_BH, R_BH]
        p_BP = self._ahead(person)
        axis = RigidTransform([*p_BP, 0.5 * _PERSON_SIZE_M[2] - self._height_m()])
        self.boxes = [Box(axis, _PERSON_SIZE_M)]
        level_m = self.options.height_m - self._height_m()

        def goal(scene: ArmScene, q: FloatArray) -> FloatArray:
            return hold_out_configuration(scene, rotations, p_BP, self.p_HT, level_m, self.options.gaps_m, q)

        yield from self.move_to(goal, f"holding the object out to {name}", speed_rad_s=_HOLD_OUT_RAD_S)

    def _check(self, person: SeenPerson, name: str) -> None:
        """Raises SkillFailure unless the object is held near the person."""
        if not self.context.robot.gripper().holding:
            raise SkillFailure(Cause.POSTCONDITION, f"the {self.thing} was lost while it was held out to {name}")
        p_BT = self.model.X_BH(self.q_rad()) @ self.p_HT
        off = float(np.linalg.norm(p_BT[:2] - self._ahead(person)))
        if off > self.options.furthest_m:
            raise SkillFailure(Cause.EXECUTION, f"the {self.thing} is held {off:.2f} m from {name}, which is too far")

    def _ahead(self, person: SeenPerson) -> FloatArray:
        """Position (x, y) of the person's axis in the body frame."""
        return np.asarray((self.X_WB().inverse() @ np.array([*person.place_W, 0.0]))[:2])


def hold_out_configuration(
    scene: ArmScene,
    rotations: Sequence[RotationMatrix],
    p_BP: FloatArray,
    p_HT: FloatArray,
    level_m: float,
    gaps_m: Sequence[float],
    q_near_rad: FloatArray,
) -> FloatArray:
    """Returns arm angles (J,) with the object in front of the person; level_m is the object's height in B.

    The hand has the first feasible rotation of `rotations` (R_BH), turned about the vertical towards the person. The
    person's axis is at p_BP (2,), the object's centre at p_HT. Raises PlanningError when the person is out of reach.
    """
    direction = math.atan2(p_BP[1], p_BP[0])
    heading = np.array([math.cos(direction), math.sin(direction), 0.0])
    turned = (each for R_BH in rotations for each in _towards(R_BH, direction))
    for rotation, gap, lower in itertools.product(turned, gaps_m, (0.0, 0.1, 0.2)):
        p_BT = (float(np.linalg.norm(p_BP)) - gap) * heading + np.array([0.0, 0.0, level_m - lower])
        X_BH = RigidTransform(rotation, p_BT - rotation.matrix() @ p_HT)
        found = (scene.model.turned_near(q, q_near_rad) for q in scene.model.inverse(X_BH, margin_rad=0.05))
        free = [q for q in found if scene.free(q)]
        if free:
            return min(free, key=lambda q: float(np.max(np.abs(q - q_near_rad))))
    raise PlanningError("the arm cannot hold the object out near enough to the person from here")


def _towards(R_BH: RotationMatrix, direction_rad: float) -> list[RotationMatrix]:
    """Returns rotations of the hand about the vertical towards a direction; four when the hand points down."""
    x_axis = R_BH.matrix()[:, 0]
    ahead = direction_rad - math.atan2(x_axis[1], x_axis[0])
    turns = (0.0, math.pi / 2, -math.pi / 2, math.pi) if x_axis[2] < -_POINTS_DOWN else (0.0,)
    return [RotationMatrix.MakeZRotation(ahead + turn) @ R_BH for turn in turns]


def _well_placed(p_BP: FloatArray, range_m: tuple[float, float]) -> bool:
    near = range_m[0] <= float(np.linalg.norm(p_BP)) <= range_m[1]
    return near and abs(math.atan2(p_BP[1], p_BP[0])) < _FACING_RAD
