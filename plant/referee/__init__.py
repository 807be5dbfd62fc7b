"""The referee: the only one that is told the truth. It watches the plant and judges promises after the fact."""

from plant.referee.cast import Placed
from plant.referee.promise import Promise, PromiseKind, Region, Verdict
from plant.referee.referee import Referee

__all__ = ["Placed", "Promise", "PromiseKind", "Referee", "Region", "Verdict"]
