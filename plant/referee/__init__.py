"""The referee: the only one that is told the truth. It watches the plant and judges the goal conditions afterwards."""

from plant.referee.judge import Verdict
from plant.referee.referee import Referee

__all__ = ["Referee", "Verdict"]
