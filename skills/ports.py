"""Inputs, outputs and causes of the skills with heavy imports, from which trees are compiled without them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skills.api import Cause, ObjectObservation, Part, Skill, Surface
from skills.quantities import Angle, Coordinate, Cosine, Duration, Height, Length, Speed, Tries, Turn
from skills.robot import Pose2D
from skills.world_model import IN_THE_WAY, PERSON


@dataclass(frozen=True)
class NavigateInputs:
    """The goal (the body's pose in the world), tolerances and the maximum speed.

    Poses at `nearby_m`, forward and left of the goal, count as reached too: a failure is final only if none is
    reachable.
    """

    goal: Pose2D
    position_tolerance_m: Length = 0.10
    yaw_tolerance_rad: Turn = 0.10
    max_speed_m_s: Speed = 0.8
    nearby_m: tuple[tuple[Coordinate, Coordinate], ...] = ()


class NavigatePorts(Skill[NavigateInputs]):
    """Drives to a pose: plans a path for the whole footprint, follows it, and stands still at the goal."""

    done_by: ClassVar[str] = "skills.navigate.skill:Navigate"
    name: ClassVar[str] = "navigate"
    Inputs: ClassVar[type] = NavigateInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "localisation is lost, the LiDAR does not work, or the robot refuses to drive",
        Cause.PLANNING: "the goal is blocked, or there is no path, even after waiting for what stands there to move",
        Cause.EXECUTION: "the robot makes no progress, loses localisation or its LiDAR, or refuses to drive on",
        Cause.POSTCONDITION: "it stands still, but not at the goal",
    }
    default_timeout_s: ClassVar[float] = 180.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 0.5}


@dataclass(frozen=True)
class BackOffInputs:
    """Distance (m), and the least distance (m) that counts as success."""

    distance_m: Length = 0.4
    least_m: Length = 0.15


class BackOffPorts(Skill[BackOffInputs]):
    """Drives a short distance out of a tight place: straight, slowly, in the first direction with enough clearance."""

    done_by: ClassVar[str] = "skills.small.back_off:BackOff"
    name: ClassVar[str] = "back_off"
    Inputs: ClassVar[type] = BackOffInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "the LiDAR does not work",
        Cause.PLANNING: "there is no clearance in any direction",
        Cause.EXECUTION: "the robot refuses to drive or makes no progress",
    }
    default_timeout_s: ClassVar[float] = 15.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 0.5}


@dataclass(frozen=True)
class RelocaliseInputs:
    """Largest numbers of headings to search in, an eighth of a turn apart, and of drives elsewhere."""

    turns: Tries = 8
    drives: Tries = 3


class RelocalisePorts(Skill[RelocaliseInputs]):
    """Finds the robot's pose on the map again. A pose counts once new scans agree with it for a second."""

    done_by: ClassVar[str] = "skills.small.relocalise:Relocalise"
    name: ClassVar[str] = "relocalise"
    Inputs: ClassVar[type] = RelocaliseInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "there are no new scans, or this robot's localiser cannot search",
        Cause.EXECUTION: "the robot refuses to move, or a camera gives no picture",
        Cause.POSTCONDITION: "no pose on the map fits what the robot sees",
    }
    default_timeout_s: ClassVar[float] = 240.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"localisation": 1.0}


@dataclass(frozen=True)
class DetectInputs:
    """Wanted objects (any of `classes`, with all `attributes`) and the surfaces to search.

    The class "thing" is any object, whether the detector knows its class or not; objects at the positions of `avoid`
    are the last choice.

    The search ends with the first `count` objects; a count of 0 searches all surfaces and counts all objects. With
    `expected_W` it searches only that position, and only objects within 0.35 m of it count. With `floor`, visible
    objects on the floor beside the surfaces count too.
    """

    classes: tuple[str, ...]
    surfaces: tuple[Surface, ...]
    attributes: tuple[str, ...] = ()
    expected_W: tuple[Coordinate, Coordinate, Height] | None = None
    count: Tries = 1
    floor: bool = False
    avoid: tuple[ObjectObservation, ...] = ()
    seen_before: ObjectObservation | None = None


class DetectPorts(Skill[DetectInputs]):
    """Searches surfaces for objects without driving. Stows the arm when it finds too few."""

    done_by: ClassVar[str] = "skills.detect.skill:Detect"
    name = "detect"
    Inputs = DetectInputs
    outputs: ClassVar[Mapping[str, type]] = {
        "observation": ObjectObservation,
        "observations": tuple[ObjectObservation, ...],
    }
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "a class, attribute or surface cannot be searched for from here, or there is no arm",
        Cause.PLANNING: "the arm reaches no viewpoint",
        Cause.EXECUTION: "the arm did not reach its viewpoint, or the camera shows nothing",
        Cause.POSTCONDITION: "no such object is seen, or fewer than asked for",
    }
    default_timeout_s = 90.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"observation": 3.0}


@dataclass(frozen=True)
class FindPeopleInputs:
    """Area to search: the corners (x, y) of `area_W`, with the name `place`.

    `person` is the name of the wanted person; any person counts, since the skill recognises no faces. A `count` of 0
    counts all people. People near the positions of `avoid` do not count. A person counts once a picture shows them;
    with `unpictured`, bodies that two scans show count too, after all others. With `moves`, the robot drives to
    viewpoints that show the rest of the area, until enough people are found.
    """

    area_W: tuple[tuple[Coordinate, Coordinate], ...]
    place: str
    person: str = PERSON
    count: Tries = 1
    avoid: tuple[ObjectObservation, ...] = ()
    unpictured: bool = False
    moves: bool = False


class FindPeoplePorts(Skill[FindPeopleInputs]):
    """Looks for people with body cameras and LiDAR; with the LiDAR alone if the detector has no class of people."""

    done_by: ClassVar[str] = "skills.people.find_people:FindPeople"
    name = "find_people"
    Inputs = FindPeopleInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    outputs: ClassVar[Mapping[str, type]] = {
        "observation": ObjectObservation,
        "observations": tuple[ObjectObservation, ...],
    }
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "there is no new scan",
        Cause.EXECUTION: "it is dark, there is no picture, the robot refuses to turn, or part of the area is hidden",
        Cause.POSTCONDITION: "nobody is seen, or fewer than asked for",
    }
    default_timeout_s = 150.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"localisation": 1.0}


@dataclass(frozen=True)
class MeetPersonInputs:
    """Name of a person and of their room, and the point (x, y) where they were seen; None: the nearest one ahead.

    With `within_m`, the robot may stop at this distance (m) where nothing nearer is free.
    """

    person: str
    place_W: tuple[Coordinate, Coordinate] | None = None
    place: str = ""
    within_m: Length | None = None


class MeetPersonPorts(Skill[MeetPersonInputs]):
    """Goes beside a person, also if they move on, and faces them. The output `person` is where they are."""

    done_by: ClassVar[str] = "skills.people.meet_person:MeetPerson"
    name = "meet_person"
    Inputs = MeetPersonInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    outputs: ClassVar[Mapping[str, type]] = {"person": ObjectObservation}
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "there is no new scan",
        Cause.PLANNING: "there is no free place to stand beside the person, or no path",
        Cause.EXECUTION: "the robot did not reach the place to stand",
        Cause.POSTCONDITION: "nobody is seen there, or the person walks on",
    }
    default_timeout_s = 180.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 0.5, "person": 2.0}


@dataclass(frozen=True)
class GuidePersonInputs:
    """Name of a person for messages, the robot's pose at the goal, and the name of the goal.

    The person was seen at `place_W` (x, y); None: the nearest one ahead. They must stand in the outline `area_W` in the
    end; without one, near the robot.
    """

    person: str
    goal: Pose2D
    place: str
    place_W: tuple[Coordinate, Coordinate] | None = None
    area_W: tuple[tuple[Coordinate, Coordinate], ...] = ()


class GuidePersonPorts(Skill[GuidePersonInputs]):
    """Goes ahead of a person to a place: at their pace, waits for them, and goes back for them."""

    done_by: ClassVar[str] = "skills.people.guide_person:GuidePerson"
    name = "guide_person"
    Inputs = GuidePersonInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE, Part.VOICE})
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "there is no new scan, or localisation is lost",
        Cause.PLANNING: "there is no path to the place, or back to the person",
        Cause.EXECUTION: "the robot makes no progress or refuses to drive",
        Cause.POSTCONDITION: "the person is lost, does not come along, or ends it on the way",
    }
    default_timeout_s = 600.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 0.5}


@dataclass(frozen=True)
class FollowPersonInputs:
    """The person's name for messages, and `place_W` (x, y), where they were seen last; None: the nearest one ahead.

    With the corners `until_W` of the place `until`, the skill ends once the person has stood there for 5 s. It ends
    when somebody tells it to, and after `time_limit_s` at the latest.
    """

    person: str = "the person"
    place_W: tuple[Coordinate, Coordinate] | None = None
    until_W: tuple[tuple[Coordinate, Coordinate], ...] | None = None
    until: str = ""
    time_limit_s: Duration = 600.0
    max_speed_m_s: Speed = 1.2


class FollowPersonPorts(Skill[FollowPersonInputs]):
    """Keeps behind a walking person by LiDAR and body cameras; searches for a person whom it has lost, and asks."""

    done_by: ClassVar[str] = "skills.people.follow_person:FollowPerson"
    name = "follow_person"
    Inputs = FollowPersonInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE, Part.VOICE})
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "nobody is seen, localisation is lost, or the robot refuses to drive",
        Cause.PLANNING: "no path leads to the person",
        Cause.EXECUTION: "the person is lost, or the robot loses localisation or its LiDAR, or refuses to drive on",
        Cause.TIMEOUT: "the person has not stood still in the place within the time limit",
    }
    default_timeout_s: ClassVar[float] = 1800.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 0.5}


@dataclass(frozen=True)
class ApproachInputs:
    """Object as it was seen, and the surfaces near it, including the one that it lies on."""

    observation: ObjectObservation
    surfaces: tuple[Surface, ...]


class ApproachPorts(Skill[ApproachInputs]):
    """Drives slowly, with the arm stowed, to where the arm can grasp an object, and looks at the object again."""

    done_by: ClassVar[str] = "skills.manipulation.approach.skill:Approach"
    name = "approach"
    Inputs = ApproachInputs
    outputs: ClassVar[Mapping[str, type]] = {"observation": ObjectObservation}
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PLANNING: "no free place to stand is near enough to the object, or no path leads there",
        Cause.EXECUTION: "the robot did not reach the place to stand",
        Cause.POSTCONDITION: "the object is not seen again from there",
    }
    default_timeout_s = 150.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 0.5, "observation": 3.0}


@dataclass(frozen=True)
class TriedGrasp:
    """Grasp in the world's axes: directions of the fingers and of their closing, the hand from the object (m)."""

    pointing_W: tuple[Cosine, Cosine, Cosine]
    closing_W: tuple[Cosine, Cosine, Cosine]
    hand_from_object_W: tuple[Coordinate, Coordinate, Coordinate]


@dataclass(frozen=True)
class GraspInputs:
    """Object as it was seen; grasps like those in `avoid` are the last choice."""

    observation: ObjectObservation
    avoid: tuple[TriedGrasp, ...] = ()


class GraspPorts(Skill[GraspInputs]):
    """Grasps an object and holds it near the body. On failure it opens the gripper and stows the arm.

    The output `tried` is `avoid` and the grasp of this attempt, also after a failure. After a failure for want of a
    plan, `in_the_way` are the objects that block every grasp, the nearest first; else it is empty.
    """

    done_by: ClassVar[str] = "skills.manipulation.grasp.skill:Grasp"
    name = "grasp"
    Inputs = GraspInputs
    outputs: ClassVar[Mapping[str, type]] = {"tried": tuple[TriedGrasp, ...], IN_THE_WAY: tuple[ObjectObservation, ...]}
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "the object is not where it was seen or too heavy, the gripper is full, or there is no arm",
        Cause.PLANNING: "no grasp is within reach and free",
        Cause.EXECUTION: "the arm or the gripper did not reach its goal",
        Cause.POSTCONDITION: "the gripper closed on nothing, or the object slipped out",
    }
    default_timeout_s = 120.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"joints": 0.5, "gripper": 0.5}
    changes_world = True
    gripper_before = False
    gripper_after = True


@dataclass(frozen=True)
class PlaceInputs:
    """Surface to put the object on.

    The object's centre comes to rest in none of the circles `clear_of` (x, y, radius) of the world.
    """

    surface: Surface
    clear_of: tuple[tuple[Coordinate, Coordinate, Length], ...] = ()


class PlacePorts(Skill[PlaceInputs]):
    """Puts the held object down on a surface and stows the arm. Goes nearer when no free spot is within reach.

    The output `released_W` is where the hand has let the object go, also after a failure; a failure before has none.
    """

    done_by: ClassVar[str] = "skills.manipulation.place.skill:Place"
    name = "place"
    Inputs = PlaceInputs
    outputs: ClassVar[Mapping[str, type]] = {"released_W": tuple[Coordinate, Coordinate, Height]}
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "nothing is held",
        Cause.PLANNING: "no free spot of the surface is seen within reach, or the arm finds no path to it",
        Cause.EXECUTION: "the robot or its arm did not reach its goal",
        Cause.POSTCONDITION: "it was let go and is not seen at rest where it was put down, or is still in the gripper",
    }
    default_timeout_s = 240.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"joints": 0.5, "gripper": 0.5}
    changes_world = True
    gripper_before = True
    gripper_after = False


@dataclass(frozen=True)
class HandOverInputs:
    """Names of the person and of the object, for messages; the skill takes the nearest person in sight."""

    person: str
    thing: str = "object"


class HandOverPorts(Skill[HandOverInputs]):
    """Finds a person by LiDAR, goes there, holds the object out, lets go when they take it, and checks who has it.

    The output `released_W` is where the hand has let the object go, also after a failure; a failure before has none.
    """

    done_by: ClassVar[str] = "skills.manipulation.hand_over.skill:HandOver"
    name = "hand_over"
    Inputs = HandOverInputs
    outputs: ClassVar[Mapping[str, type]] = {"released_W": tuple[Coordinate, Coordinate, Height]}
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "nothing is held, there is no new scan, or nobody is seen near",
        Cause.PLANNING: "no free place before the person, or no free path for the arm",
        Cause.EXECUTION: "the robot or its arm did not reach its goal",
        Cause.POSTCONDITION: "the object was lost, is still in the gripper, or is not seen at rest with the person",
        Cause.TIMEOUT: "the person did not take the object",
    }
    default_timeout_s = 180.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"joints": 0.5, "gripper": 0.5}
    changes_world = True
    gripper_before = True
    gripper_after = False


@dataclass(frozen=True)
class PoseArmInputs:
    """Joint angles from the shoulder on, and an opening (0 closed).

    None, or a held object, leaves the gripper as it is.
    """

    joints_rad: tuple[Angle, ...]
    opening: Turn | None = None


class PoseArmPorts(Skill[PoseArmInputs]):
    """Moves the arm on a free path to joint angles, then the gripper to an opening."""

    done_by: ClassVar[str] = "skills.manipulation.posture:PoseArm"
    name = "pose_arm"
    Inputs = PoseArmInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.ARM})
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "the pose is not one of this robot's arm",
        Cause.PLANNING: "the arm finds no free path",
        Cause.EXECUTION: "the arm did not reach its goal",
    }
    default_timeout_s = 30.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"joints": 0.5}


@dataclass(frozen=True)
class StowInputs:
    """No inputs."""


class StowPorts(Skill[StowInputs]):
    """Brings the arm near the body, and the body to its usual height. An arm that is near the body stays there."""

    done_by: ClassVar[str] = "skills.manipulation.posture:Stow"
    name = "stow"
    Inputs = StowInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.ARM})
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PLANNING: "the arm finds no free path",
        Cause.EXECUTION: "the arm did not reach its goal",
    }
    default_timeout_s = 30.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"joints": 0.5, "gripper": 0.5}
