"""The find_people skill: turns in place and looks for people in an area."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import shapely

from skills.api import Cause, ObjectKind, ObjectObservation, Running, Succeeded, SurveyView
from skills.detect.descriptions import count_sentence
from skills.detect.messages import detections_message
from skills.navigate.arm_footprint import ArmFootprint
from skills.navigate.base import MovingSkill
from skills.navigate.footprint import SAFE_MARGIN_M, footprint_clearance_m, pose_array
from skills.perception.class_forms import PERSON
from skills.perception.detector.camera_images import DETECTION_LATENCY_S, is_dark, turn_upright
from skills.perception.people import SeenPerson, located_people, people_detections, people_in_scan
from skills.perception.people_tracking import SCAN_APART_M, PeopleTracker
from skills.ports import FindPeopleInputs, FindPeoplePorts
from skills.quantities import Count, Delay, Length, Share, Turn, TurnRate
from skills.robot import Image
from skills.routine import Patience, Routine, SkillFailure

_SCAN_AGE_S = 1.0
_AHEAD_RAD = 0.2
_SIZE_M = (0.5, 0.5, 1.7)
_AVOID_M = 0.9
"""Distance within which somebody counts as a person who is already known."""


@dataclass(frozen=True)
class FindPeopleOptions:
    """Search in `looks` directions, with turns of `turn_rad` in between.

    A person counts when seen twice within `same_m`: in two directions, or in one by both a camera and the LiDAR. A
    detection needs `least_score`, within `reach_m` of the camera.
    """

    looks: Count = 5
    turn_rad: Turn = 0.5
    turn_rad_s: TurnRate = 0.4
    settle_s: Delay = 0.5
    same_m: Length = 0.7
    least_score: Share = 0.5
    reach_m: Length = 6.0


class FindPeople(FindPeoplePorts, MovingSkill[FindPeopleInputs]):
    """Implementation of `FindPeoplePorts`."""

    Options: ClassVar[type] = FindPeopleOptions
    options: FindPeopleOptions

    def run(self, inputs: FindPeopleInputs) -> Routine[Succeeded]:
        """Looks and turns until enough people were seen twice."""
        area, same_m = shapely.Polygon(inputs.area_W), self.options.same_m
        area = area.difference(shapely.MultiPoint([one.position_W[:2] for one in inputs.avoid]).buffer(_AVOID_M))
        tracker, found = PeopleTracker(same_m), list[SeenPerson]()
        for look in range(self.options.looks):
            if look:
                yield from self._turn()
            by_lidar = yield from self._in_scan(f"looking for people in the {inputs.place}")
            by_camera = yield from self._in_pictures(f"looking for people in the {inputs.place}")
            tracker.update(by_lidar, by_scan=True, apart_m=SCAN_APART_M)
            for people in by_camera or ():
                tracker.update(people, by_scan=False, apart_m=same_m)
            if inputs.unpictured:
                again = yield from self._in_scan(f"looking for people in the {inputs.place}")
                tracker.update(again, by_scan=True, apart_m=SCAN_APART_M)
            least = 0 if by_camera is None or inputs.unpictured else 1
            inside = (one for one in tracker.people if area.covers(shapely.Point(one.place_W)))
            found = [one for one in inside if one.looks >= least and one.looks + one.scans > 1]
            found.sort(key=lambda one: by_camera is not None and one.looks == 0)
            if 0 < inputs.count <= len(found):
                break
        return self._ended(inputs, tuple(_observation(one, inputs) for one in found))

    def _turn(self) -> Routine[None]:
        """Turns in place as far as the footprint stays clear."""
        turn_rad_s, for_s = self.options.turn_rad_s, self.options.turn_rad / self.options.turn_rad_s
        costmap, footprint = self.context.free_space(), ArmFootprint(self.context).now()

        def lacks_clearance() -> bool:
            here = self.context.pose()
            ahead = replace(here, yaw_rad=here.yaw_rad + math.copysign(_AHEAD_RAD, turn_rad_s))
            here_m, ahead_m = footprint_clearance_m(costmap, footprint, pose_array([here, ahead]))
            return bool(ahead_m < min(here_m, SAFE_MARGIN_M))

        command, rest_s = (0.0, 0.0, turn_rad_s), self.options.settle_s
        yield from self.move(command, for_s, "turning to see more", settle_s=rest_s, enough=lacks_clearance)

    def _ended(self, inputs: FindPeopleInputs, found: tuple[ObjectObservation, ...]) -> Succeeded:
        """Returns the result. Raises SkillFailure when too few people were found."""
        if not found or len(found) < inputs.count:
            else_ = " else" if inputs.avoid else ""
            few = count_sentence(found, ()) if found else f"nobody{else_} is seen in the {inputs.place} from here"
            raise SkillFailure(Cause.POSTCONDITION, few)
        who = "somebody" if found[0].kind.name == PERSON else found[0].kind.name
        said = f"saw {who} in the {found[0].surface}" if inputs.count == 1 else count_sentence(found, ())
        return Succeeded(said, {"observation": found[0], "observations": found})

    def _in_pictures(self, message: str) -> Routine[Sequence[Sequence[SeenPerson]] | None]:
        """Detects people in pictures of the body cameras, and publishes each picture with people, or else the first.

        Returns None if the detector has no class of people.

        Raises SkillFailure in the dark.
        """
        robot, detector, options = self.context.robot, self.context.detector, self.options
        cameras = robot.capabilities().body_cameras
        if PERSON not in detector.class_names or not cameras:
            return None
        X_WO, here_W = self.context.localiser.estimate().X_WO, self.context.pose()
        images: list[Image] = yield from self.sense(
            lambda: [robot.image(camera.source) for camera in cameras],
            latency_s=0.0,
            name="pictures",
            message=message,
        )
        if all(map(is_dark, images)):
            raise SkillFailure(Cause.EXECUTION, "it is too dark to see anybody")
        detected = yield from self.compute(
            lambda: people_detections(detector, images, options.least_score),
            latency_s=DETECTION_LATENCY_S,
            name="look for people",
            message=message,
        )
        for shown in [each for each in images if any(image is each for image, _ in detected)] or images[:1]:
            picture, found = turn_upright(shown, [one for image, one in detected if image is shown])
            self.context.publish("detections", {**detections_message(shown, found, ()), "image": picture})
        pairs = ([each for each in detected if each[0] is image] for image in images)
        return [located_people(each, X_WO, here_W, options.reach_m) for each in pairs]

    def _in_scan(self, message: str) -> Routine[Sequence[SeenPerson]]:
        """Detects people in the newest scan. Raises SkillFailure when there is no new scan."""
        robot, patience = self.context.robot, Patience(self.context.clock)
        while (scan := robot.scan()) is None or scan.stamp_s < self.context.clock.now() - _SCAN_AGE_S:
            if not patience.is_left():
                raise SkillFailure(Cause.PRECONDITION, "there is no new scan to see people in")
            yield Running(f"{message}; waits for a scan")
        X_WB, costmap = self.context.localiser.estimate().X_WO @ scan.X_OB, self.context.costmap
        survey = costmap if isinstance(costmap, SurveyView) else None
        return people_in_scan(scan, X_WB, robot.capabilities().footprint_m, survey=survey)


def _observation(seen: SeenPerson, inputs: FindPeopleInputs) -> ObjectObservation:
    """Observation of a person under the wanted name."""
    x_m, y_m = seen.place_W
    middle_W = (x_m, y_m, _SIZE_M[2] / 2)
    return ObjectObservation(seen.stamp_s, ObjectKind(inputs.person), middle_W, _SIZE_M, 0.0, seen.score, inputs.place)
