"""Watch over the object in the gripper: recognises a loss and a slip from the gripper's readings, within 0.3 s."""

import enum
from dataclasses import dataclass, field, replace
from typing import Final

from skills.robot import Capabilities, Clock, CommandId, Gripper, Lease, Robot

GRIP_AGAIN_S: Final = 4.0
"""Expiry of a firmer grip."""
_FIRMER = 1.5
"""Factor by which a firmer grip is stronger."""
_MOST_OF_FORCE = 0.95
"""Largest force of a grip, as a part of the gripper's limit."""
_TOLERANCE_S = 1e-6


class Grip(enum.Enum):
    """State of the object in the gripper."""

    EMPTY = "empty"  # nothing has been held since the watch began
    HELD = "held"  # it stays where it is, as far as can be told
    SLIPPING = "slipping"  # it has begun to slip: grip it again, more firmly
    SLIPS_ON = "slips on"  # it slips although it was gripped again
    LOST = "lost"  # it is out of the gripper, which did not open
    RELEASED = "released"  # the gripper has opened on purpose


@dataclass
class HoldWatch:
    """Monitor of the readings of a gripper that holds an object.

    An empty gripper counts after `patience_s`. An object slips when the gripper has closed by more than `slip_rad`, or
    when its force has been below the part `slip_force` of its first value for `slip_s`. Both times span two readings.
    After a firmer grip, a closing gripper means a further slip, judged `settle_s` later; fingers that stay apart have
    `regrip_s` to feel the object before it counts as lost. A gripper that has opened by `released_rad` releases on
    purpose.
    """

    patience_s: float = 0.05
    slip_rad: float = 0.05
    slip_force: float = 0.5
    slip_s: float = 0.05
    regrip_s: float = 0.2
    settle_s: float = 0.5
    released_rad: float = 0.08
    force_n: float = field(default=0.0, init=False)
    _opening: float | None = field(default=None, init=False)
    _empty_since_s: float | None = field(default=None, init=False)
    _weak_since_s: float | None = field(default=None, init=False)
    _gripped_again_s: float | None = field(default=None, init=False)
    _settling: bool = field(default=False, init=False)
    _released: bool = field(default=False, init=False)

    def judge(self, reading: Gripper, now_s: float) -> Grip:
        """Judges the newest reading at a time on the robot's clock (s).

        `force_n` is the force at the first reading with an object, or after a firmer grip.
        """
        if self._opening is None:
            if not reading.holding:
                return Grip.EMPTY
            self._opening, self.force_n = reading.opening, reading.force_n
        self._released = self._released or reading.opening > self._opening + self.released_rad
        if self._released:
            return Grip.RELEASED
        if not reading.holding:
            return self._missed(reading, now_s)
        self._empty_since_s = None
        return self._held(reading, now_s)

    def _missed(self, reading: Gripper, now_s: float) -> Grip:
        """Judges a reading without an object; fingers that stay apart may still have it between them."""
        self._empty_since_s = now_s if self._empty_since_s is None else self._empty_since_s
        assert self._opening is not None
        apart = reading.opening > self._opening - self.slip_rad
        if apart and self._gripped_again_s is not None and now_s < self._gripped_again_s + self.regrip_s:
            return Grip.HELD
        return Grip.LOST if now_s - self._empty_since_s >= self.patience_s - _TOLERANCE_S else Grip.HELD

    def _held(self, reading: Gripper, now_s: float) -> Grip:
        """Judges a reading with an object between the fingers."""
        if self._settling and self._gripped_again_s is not None:
            if now_s < self._gripped_again_s + self.settle_s:
                return Grip.HELD
            self._settling, self._opening, self.force_n = False, reading.opening, reading.force_n
        assert self._opening is not None
        closes = reading.opening <= self._opening - self.slip_rad
        if self._gripped_again_s is not None:
            return Grip.SLIPS_ON if closes else Grip.HELD
        opens = reading.opening > self._opening + 0.5 * self.released_rad
        weak = reading.force_n < self.slip_force * self.force_n and not opens
        self._weak_since_s = (now_s if self._weak_since_s is None else self._weak_since_s) if weak else None
        weakened = self._weak_since_s is not None and now_s - self._weak_since_s >= self.slip_s - _TOLERANCE_S
        if not (closes or weakened):
            return Grip.HELD
        self._gripped_again_s, self._settling = now_s, True
        return Grip.SLIPPING


def hold_watch(capabilities: Capabilities) -> HoldWatch:
    """Returns a watch with limits that suit a robot's gripper."""
    period_s, gripper = capabilities.sensor_period_s, capabilities.gripper
    usual = HoldWatch(patience_s=period_s, slip_s=period_s)
    if gripper is None:
        return usual
    slip, released = gripper.like_turn(usual.slip_rad), gripper.like_turn(usual.released_rad)
    return replace(usual, slip_rad=slip, released_rad=released)


def firmer_n(force_n: float, capabilities: Capabilities) -> float:
    """Force (N) to grip an object that slips at force_n: 1.5 times as much, within the gripper's limit."""
    most_n = 0.0 if capabilities.gripper is None else _MOST_OF_FORCE * capabilities.gripper.max_force_n
    return min(_FIRMER * force_n, most_n)


def grip_again(robot: Robot, force_n: float, *, clock: Clock, lease: Lease) -> CommandId:
    """Grips an object that slips at force_n more firmly; other motion continues meanwhile."""
    firmly_n = firmer_n(force_n, robot.capabilities())
    return robot.set_gripper(0.0, firmly_n, until_s=clock.now() + GRIP_AGAIN_S, lease=lease)
