"""The referee: the only one that is told the truth. It watches the plant and judges the goal conditions afterwards."""

from plant.referee.referee import Referee
from plant.referee.verdict import Verdict

__all__ = ["Referee", "Verdict"]
