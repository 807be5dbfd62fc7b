"""Paths of robots and people for the referee, and its finding about them."""

import numpy as np

from plant.referee.judge import judge
from plant.referee.object_history import TimedPath, Truth


def path(*points):
    """Path through points (x, y, t)."""
    return TimedPath(np.array([(x, y, 0.0, t) for x, y, t in points], dtype=np.float64))


def walked(x_from, x_to, from_s=0.0, y=0.0, speed_m_s=1.0):
    """Path along x at a speed."""
    along = np.arange(x_from, x_to, 0.1)
    return path(*((x, y, from_s + (x - x_from) / speed_m_s) for x in along))


def finding(condition, robot, **people):
    """The referee's report on one condition, at 60 s, of Alice's path and those of people."""
    return judge([condition], Truth(60.0, (), {"alice": robot}, people, {}), collisions=())
