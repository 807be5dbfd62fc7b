"""The referee: the only one that is told the truth. It watches the plant and judges the goal conditions afterwards."""

from plant.referee.goal import GoalCondition, GoalKind, Region, Verdict, When
from plant.referee.referee import Referee

__all__ = ["GoalCondition", "GoalKind", "Referee", "Region", "Verdict", "When"]
