"""Monitor of the object in the gripper: detects a loss and a slip from the gripper's measurements, within 0.5 s."""

import enum
from dataclasses import dataclass, field, replace
from typing import Final

from skills.robot import Capabilities, Clock, CommandId, Gripper, Lease, Robot

GRIP_AGAIN_S: Final = 4.0
"""Expiry of a firmer grip."""
_FIRMER = 1.5
"""Factor by which a firmer grip is stronger."""
_MOST_OF_FORCE = 0.95
"""Largest force of a grip, as a fraction of the gripper's limit."""
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
    """Monitors the measurements of a gripper that holds an object.

    `patience_s`: how long the gripper reports no object until the object counts as lost. `slip_rad`: closing by more
    than this is a slip. `slip_force` and `slip_s`: so is a force below this fraction of its first value for this time.
    `settle_s`: after a firmer grip, further closing is judged only after this time. `regrip_s`: after a firmer grip,
    fingers wider than `shut_rad` have this long to feel the object again. `released_rad`: opening by more than this is
    a deliberate release.
    """

    patience_s: float = 0.05
    slip_rad: float = 0.05
    slip_force: float = 0.5
    slip_s: float = 0.05
    regrip_s: float = 0.5
    shut_rad: float = 0.03
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
        """Classifies the newest measurement, at a time on the robot's clock (s).

        `force_n` is the force when the object was first felt, or after a firmer grip.
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
        """Classifies a measurement without an object; fingers that stay apart may still have it between them."""
        self._empty_since_s = now_s if self._empty_since_s is None else self._empty_since_s
        assert self._opening is not None
        apart = reading.opening > self.shut_rad
        if apart and self._gripped_again_s is not None and now_s < self._gripped_again_s + self.regrip_s:
            return Grip.HELD
        return Grip.LOST if now_s - self._empty_since_s >= self.patience_s - _TOLERANCE_S else Grip.HELD

    def _held(self, reading: Gripper, now_s: float) -> Grip:
        """Classifies a measurement with an object between the fingers."""
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
    """Returns a monitor with limits that suit a robot's gripper."""
    period_s, gripper = capabilities.sensor_period_s, capabilities.gripper
    usual = HoldWatch(patience_s=period_s, slip_s=period_s)
    if gripper is None:
        return usual
    slip, shut, released = map(gripper.like_turn, (usual.slip_rad, usual.shut_rad, usual.released_rad))
    return replace(usual, slip_rad=slip, shut_rad=shut, released_rad=released)


def firmer_n(force_n: float, capabilities: Capabilities) -> float:
    """Grip force (N) for an object that slips at force_n: 1.5 times as much, within the gripper's limit."""
    most_n = 0.0 if capabilities.gripper is None else _MOST_OF_FORCE * capabilities.gripper.max_force_n
    return min(_FIRMER * force_n, most_n)


def grip_again(robot: Robot, force_n: float, *, clock: Clock, lease: Lease) -> CommandId:
    """Grips an object that slips at force_n more firmly, while other motion continues."""
    firmly_n = firmer_n(force_n, robot.capabilities())
    return robot.set_gripper(0.0, firmly_n, until_s=clock.now() + GRIP_AGAIN_S, lease=lease)
