"""Base of skills that look at people with the object camera, from one side after another until they are sure."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice

import numpy as np

from errand_people.appearance import PICTURES_S, Look
from errand_people.looks import Appearance, LookedAt, Trait
from skills.api import Cause, InputsT, ObjectKind, ObjectObservation
from skills.footprint import footprint_clear
from skills.geometry import bearing_rad, facing_poses, inside_polygon, line_of_sight, wrap
from skills.manipulation.approach.base_placement import go_to_one
from skills.manipulation.arm.looking_skill import LookingSkill
from skills.manipulation.arm.poses import overview_viewpoints
from skills.navigate.arm_footprint import ArmFootprint
from skills.navigate.surroundings import NavigateInputs
from skills.perception.detector.camera_images import is_dark
from skills.quantities import Count, Length, Turn
from skills.robot import Image, Pose2D
from skills.routine import Routine, SkillFailure

_LATENCY_S = 0.1
_SIZE_M = (0.5, 0.5, 1.7)
_POSES_EACH = 2
_SEAT_M = 1.2
"""Distance from a person within which furniture hides nobody: the one on which they sit or lie."""
_TURNS_RAD = (0.0, 0.35, -0.35)


@dataclass(frozen=True)
class LookOptions:
    """Views of a person: from the first free distance of `apart_m`, up to `views`, each `other_rad` or more aside.

    The robot stays where it stands within `stays_m` of the person and faces them within `facing_rad`.
    """

    apart_m: tuple[Length, ...] = (2.3, 2.7, 1.9)
    stays_m: tuple[Length, Length] = (1.9, 3.0)
    facing_rad: Turn = 1.2
    views: Count = 3
    other_rad: Turn = 0.7


class PeopleLookingSkill(LookingSkill[InputsT]):
    """Routine that looks at a person with the camera that searches for objects."""

    needs_camera = True
    look_options: LookOptions = LookOptions()
    room_W: tuple[tuple[float, float], ...] = ()
    """Outline of the room in which the robot stays while it looks; empty: it may go anywhere."""

    def looked_at(
        self, place_W: tuple[float, float], who: str, asked: Sequence[Trait], wanted: Appearance | None = None
    ) -> Routine[LookedAt | None]:
        """Looks at a person near a place until the traits `asked` are sure, or contradict `wanted`.

        Returns None when nobody is there. Raises SkillFailure when no view is possible.
        """
        found: LookedAt | None = None
        sides_rad = list[float]()
        for view in range(self.look_options.views):
            failure = yield from self.planned(self._go_to_view(place_W, who, sides_rad))
            if failure is not None and view:
                break
            if failure is not None:
                raise failure
            here = self.context.pose()
            sides_rad.append(math.atan2(here.y_m - place_W[1], here.x_m - place_W[0]))
            seen = yield from self._look_from_here(place_W, who)
            if seen is not None:
                found = seen if found is None else found.merged(seen)
                place_W = found.place_W
                is_other = wanted is not None and found.appearance.contradicts(wanted)
                if is_other or all(getattr(found.appearance, trait) is not None for trait in asked):
                    break
        return found

    def planned(self, attempt: Routine[object]) -> Routine[SkillFailure | None]:
        """Makes an attempt; returns its failure when no way to do it was found."""
        try:
            yield from attempt
        except SkillFailure as failure:
            if failure.cause is not Cause.PLANNING:
                raise
            return failure
        return None

    def observation(self, seen: LookedAt, name: str, place: str) -> ObjectObservation:
        """Observation of a person under a name."""
        middle_W = (*seen.place_W, _SIZE_M[2] / 2)
        return ObjectObservation(seen.stamp_s, ObjectKind(name), middle_W, _SIZE_M, 0.0, 1.0, place or None)

    def _look_from_here(self, place_W: tuple[float, float], who: str) -> Routine[LookedAt | None]:
        """Takes series of pictures from the present position; returns None when they show nobody."""
        look, message = Look(place_W), f"looking at {who}"
        while (height_m := look.next_height_m) is not None:
            images = yield from self.series((*place_W, height_m), message, PICTURES_S)
            X_WO = self.context.localiser.estimate().X_WO
            add = partial(look.add, images, X_WO)
            yield from self.compute(add, latency_s=_LATENCY_S, name="appearance", message=message)
        x, y = (float(value) for value in look.place_W)
        return None if look.result.pose is None else LookedAt(look.result, (x, y), self.context.clock.now())

    def series(
        self, point_W: tuple[float, float, float], message: str, times_s: Sequence[float]
    ) -> Routine[list[Image]]:
        """Points the camera at a point, and takes pictures at these times, the first of them with colour.

        Raises SkillFailure when the camera cannot be pointed there, or in the dark.
        """
        robot, p_BT = self.context.robot, self.X_WB().inverse() @ np.array(point_W)
        on_hand = self.object_camera.on_hand
        turns_rad: Iterable[float] = _TURNS_RAD if on_hand else ()
        viewpoints = [p_BC for turn_rad in turns_rad for p_BC in overview_viewpoints(self.p_BS, p_BT, turn_rad)]
        yield from self.look_at(p_BT, viewpoints, message)
        images = [(yield from self.picture(message))]
        if is_dark(images[0]):
            raise SkillFailure(Cause.EXECUTION, "it is too dark to see anybody")
        source = self.object_camera.source
        for time_s in times_s[1:]:
            yield from self.pause(images[0].stamp_s + time_s - _LATENCY_S - self.context.clock.now(), message)
            later = partial(robot.image, source, visual=False)
            images.append((yield from self.sense(later, latency_s=_LATENCY_S, name="again", message=message)))
        return images

    def _go_to_view(self, place_W: tuple[float, float], who: str, sides_rad: Sequence[float]) -> Routine[None]:
        """Drives to a free pose that faces a place from another side than before; the first time it may stay."""
        here, options = self.context.pose(), self.look_options
        away_m, (low_m, high_m) = math.dist(place_W, (here.x_m, here.y_m)), options.stays_m
        faces = abs(bearing_rad(here, place_W)) <= options.facing_rad
        if not sides_rad and low_m <= away_m <= high_m and faces and self._sees(here, place_W):
            return
        yield from self.stow()
        footprint, costmap = ArmFootprint(self.context).now(), self.context.free_space()
        free = list[Pose2D]()
        for apart_m in options.apart_m:
            poses = (pose for pose in facing_poses(place_W, here, apart_m) if footprint_clear(costmap, footprint, pose))
            near = (pose for pose in poses if self._is_in_room(pose) and self._is_other(pose, sides_rad))
            other = (pose for pose in near if self._sees(pose, place_W))
            free += [*islice(other, _POSES_EACH)]
        if not free:
            raise SkillFailure(Cause.PLANNING, f"there is no free place to look at {who} from")
        yield from go_to_one(self, [NavigateInputs(pose, 0.2, 0.3) for pose in free])

    def _is_in_room(self, pose: Pose2D) -> bool:
        """Returns whether a pose is in the room in which the robot stays."""
        return not self.room_W or bool(inside_polygon(np.array([(pose.x_m, pose.y_m)]), self.room_W)[0])

    def _is_other(self, pose: Pose2D, sides_rad: Sequence[float]) -> bool:
        """Returns whether a pose that faces a person does so from another side."""
        side_rad = pose.yaw_rad + math.pi
        return all(abs(wrap(side_rad - each)) >= self.look_options.other_rad for each in sides_rad)

    def _sees(self, pose: Pose2D, place_W: tuple[float, float]) -> bool:
        """Returns whether no wall is between a pose and a person."""
        at_W = np.array([(pose.x_m, pose.y_m)])
        return bool(line_of_sight(self.context.costmap, np.array(place_W), at_W, beyond_m=_SEAT_M)[0])
