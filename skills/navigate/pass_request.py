"""Request to a person who blocks the path: the robot asks to pass, waits, and says thank you."""

import math
from collections.abc import Callable, Sequence

from skills.api import SkillContext, say
from skills.perception.people import SeenPerson
from skills.robot import Pose2D

ASKS_S = 8.0
"""Time for which the robot stands before a person until it asks, and until it asks again or gives up."""
TIMES = 2
_STANDS_M = 0.3
"""Distance within which the robot counts as standing."""
_LEFT_M = 0.4
"""Distance of everybody from where the person stood from which on that person has made way."""


class PassRequest:
    """Asks the person who blocks a standing robot; call `update` at each tick."""

    def __init__(self, context: SkillContext) -> None:
        self._context, self._here, self._tick_s = context, Pose2D(0.0, 0.0, 0.0), -math.inf
        self._since_s, self._asked, self._person_W = -math.inf, 0, (0.0, 0.0)

    @property
    def refused(self) -> bool:
        """Returns whether the person has stayed after every request."""
        return self._asked >= TIMES and self._context.clock.now() - self._since_s >= ASKS_S

    @property
    def awaited_W(self) -> tuple[float, float] | None:
        """Position of the person who has just been asked; None when the robot waits for no answer."""
        waits = self._asked > 0 and self._context.clock.now() - self._since_s < ASKS_S
        return self._person_W if waits else None

    def update(self, find: Callable[[], SeenPerson | None], people: Callable[[], Sequence[SeenPerson]]) -> None:
        """Asks the person whom `find` returns once the robot has stood for `ASKS_S`; thanks a person who made way."""
        now_s, here = self._context.clock.now(), self._context.pose()
        goes_on, self._tick_s = now_s - self._tick_s < ASKS_S, now_s
        if not goes_on or math.dist((here.x_m, here.y_m), (self._here.x_m, self._here.y_m)) > _STANDS_M:
            if goes_on and self._asked and all(math.dist(one.place_W, self._person_W) > _LEFT_M for one in people()):
                say(self._context, "Thank you.")
            self._here, self._since_s, self._asked = here, now_s, 0
        elif now_s - self._since_s >= ASKS_S and self._asked < TIMES:
            self._since_s = now_s
            if (blocker := find()) is not None:
                say(self._context, "May I pass, please?")
                self._asked, self._person_W = self._asked + 1, blocker.place_W
