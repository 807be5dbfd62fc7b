"""What a stack file may set of the navigate skill."""

from __future__ import annotations

from dataclasses import dataclass, field

from skills.navigate.collision_guard import GuardOptions
from skills.navigate.cut_off import DoorOptions
from skills.navigate.giving_way import GivingWayOptions
from skills.navigate.low_obstacles import WatchOptions
from skills.navigate.people_space import SpaceOptions
from skills.navigate.scan_health import ScanHealthOptions
from skills.patience import PATIENCE_S
from skills.perception.people_watch import PeopleOptions
from skills.quantities import Delay, Duration, Margin, Speed, Tries, TurnRate


@dataclass(frozen=True)
class NavigateOptions:
    """Patience and bounds of the skill, times in seconds of the robot's clock.

    Every `review_s` the path is checked `review_m` ahead, and planned anew, while driving, where something blocks it.
    While people are near, and for `after_person_s` (longer than a costmap remembers them), plans that fail are tried
    again without being counted, up to person_patience_s.
    """

    planning_latency_s: Delay = 0.3
    localising_patience_s: Delay = 3.0
    blind_patience_s: Delay = PATIENCE_S
    blocked_patience_s: Delay = 1.5
    replan_pause_s: Delay = 2.0
    replans: Tries = 6
    stuck_s: Duration = 4.0
    review_s: Duration = 0.2
    review_m: Margin = 0.0
    settle_s: Delay = 2.0
    still_m_s: Speed = 0.03
    still_rad_s: TurnRate = 0.05
    after_person_s: Delay = 14.0
    person_patience_s: Delay = 45.0
    low_obstacles: WatchOptions = field(default_factory=WatchOptions)
    people: PeopleOptions = field(default_factory=PeopleOptions)
    space: SpaceOptions = field(default_factory=SpaceOptions)
    guard: GuardOptions = field(default_factory=GuardOptions)
    scans: ScanHealthOptions = field(default_factory=ScanHealthOptions)
    giving_way: GivingWayOptions = field(default_factory=GivingWayOptions)
    doors: DoorOptions = field(default_factory=DoorOptions)
