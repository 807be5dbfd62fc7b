"""Goal conditions: what must hold when a mission ends, as plain data that a referee judges."""

import enum
from collections.abc import Iterable
from dataclasses import dataclass

from executive.words.outlines import inside
from skills.relations import Relation
from skills.robot import Pose2D


class GoalKind(enum.Enum):
    """Kind of a goal condition."""

    GRASPED = "grasped"  # taken from a source region and lifted, and still held
    HANDED_OVER = "handed over"  # on the tray of a person, let go
    PLACED = "placed"  # resting in a goal region, let go
    WENT = "went"  # the robot's body in a goal region
    ANSWERED = "answered"  # the answer is what is true of the source regions
    DOOR_OPEN = "door open"  # the answer is whether the door in the source region is open
    DOOR_OPENED = "door opened"  # the door in the source region is open
    CLEARED = "cleared"  # nothing rests in the source regions; with goal regions, all that did rests there, let go
    MET = "met"  # the robot is close to the person
    PICTURED = "pictured"  # pictures show the middle of a goal region or an object of a class, from a source region
    OWN = "own"  # what the page of the task `task` judges


class When(enum.Enum):
    """Times at which a goal condition must hold. The step ran from `began_s` to `ended_s`."""

    SOME_TIME = "at some time"  # once while the step ran
    END_OF_STEP = "at the end of the step"
    END_OF_MISSION = "at the end of the mission"  # and at the end of the step
    ALWAYS = "always"  # all the time while the step ran


@dataclass(frozen=True)
class Region:
    """Part of the world: an outline seen from above, (x, y) corners in order, and a range of heights (m).

    An object or a robot is in a region when the origin of its body frame is: for a table 0.75 m high, on which origins
    are up to 0.25 m above an object's base, the range is 0.70 to 1.00. `viewer` sees left and right. What is thrown
    into a bin falls.
    """

    name: str
    polygon_W: tuple[tuple[float, float], ...]
    z_min_m: float = -0.1
    z_max_m: float = 3.0
    viewer: Pose2D | None = None
    is_bin: bool = False

    def __post_init__(self) -> None:
        if len(self.polygon_W) < 3 or not self.z_min_m < self.z_max_m:
            raise ValueError(f"region {self.name!r} needs three corners or more and z_min_m below z_max_m")

    def contains(self, p_W: Iterable[float]) -> bool:
        """Returns whether a point (x, y, z) in the world frame lies in the region."""
        x, y, z = p_W
        return self.z_min_m <= z <= self.z_max_m and inside(self.polygon_W, (x, y))


@dataclass(frozen=True)
class GoalCondition:
    """One goal condition.

    `classes` are the object classes that fulfil the condition (none: any), `wanted` is their common name (empty: the
    classes), and `count` the number of objects (0 counts as 1). The robot takes the objects from `source` (empty:
    anywhere) or, for an answer, looks there; an answer may count or miss objects in `maybe`. `goal` is the destination
    of the objects or of the robot (any of the regions). `person` receives the object or, if the class is "person", is
    searched for (None: anyone); to be met, `person` must stand in `goal` (empty: anywhere). `task` is the word of the
    task whose page judges an OWN condition, for which `spoken_s` has the times at which the robot spoke, and `said`
    what it said. `answer` is the answer that the robot gave to `question` at `answered_s` (None: now): yes, no, or a
    number, perhaps `at_least` so many; `negated` says that yes stands for what is not so. `looked_s` has its looks: the
    name of the source, begin and end (s). `robot` must act (None: any). `relations` say which objects of the source are
    meant, or for PLACED where in the goal.

    `when` says at which times the condition must hold. The step ran from `began_s` (None: since `since_s`) to `ended_s`
    (None: it ends now). A later step of the same mission may lift the objects again within the intervals `taken_s`.
    Events before `since_s` (simulated time) belong to another mission and do not count.
    """

    kind: GoalKind
    classes: tuple[str, ...] = ()
    count: int = 1
    source: tuple[Region, ...] = ()
    goal: tuple[Region, ...] = ()
    maybe: tuple[Region, ...] = ()
    person: str | None = None
    question: str = ""
    answer: int | None = None
    negated: bool = False
    at_least: bool = False
    answered_s: float | None = None
    looked_s: tuple[tuple[str, float, float], ...] = ()
    spoken_s: tuple[float, ...] = ()
    said: tuple[str, ...] = ()
    robot: str | None = None
    wanted: str = ""
    when: When = When.END_OF_MISSION
    began_s: float | None = None
    ended_s: float | None = None
    taken_s: tuple[tuple[float, float], ...] = ()
    since_s: float = 0.0
    relations: tuple[Relation, ...] = ()
    task: str = ""

    @property
    def from_s(self) -> float:
        """Time when the step that the condition belongs to began."""
        return self.since_s if self.began_s is None else max(self.began_s, self.since_s)

    @property
    def needed(self) -> int:
        """Number of objects that fulfil the condition."""
        return max(1, self.count)


@dataclass(frozen=True)
class RefereeReport:
    """Verdict of the referee on all goal conditions, with counts and a sentence for each lift, drop and collision.

    `success` is None when the referee could not judge every condition; `why` has a sentence for each condition.
    `collisions` counts those that robots caused: `people_hit` of them are with people, `robots_hit` between two robots.
    `hit_by_people` counts the people who walked into a standing robot. For a failed run, `holds` says whether the goal
    conditions hold nevertheless.
    """

    success: bool | None
    why: str
    collisions: int
    drops: int
    people_hit: int = 0
    hit_by_people: int = 0
    robots_hit: int = 0
    holds: bool | None = None
    events: tuple[str, ...] = ()
