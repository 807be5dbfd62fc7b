"""The statistics of a report: intervals for rates, and whether two results differ."""

from __future__ import annotations

from dataclasses import dataclass

from scipy.stats import binomtest, fisher_exact

__all__ = ["Rate", "fisher", "mcnemar"]

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Rate:
    """So many successes of so many."""

    successes: int
    total: int

    @property
    def value(self) -> float:
        """The share, 0 where there was none."""
        return self.successes / self.total if self.total else 0.0

    def interval(self) -> tuple[float, float]:
        """Wilson's score interval, 95 %; (0, 1) where there was none (Wilson 1927)."""
        if not self.total:
            return 0.0, 1.0
        found = binomtest(self.successes, self.total).proportion_ci(CONFIDENCE, method="wilson")
        return float(found.low), float(found.high)


def mcnemar(only_first: int, only_second: int) -> float:
    """The exact two-sided p of McNemar's test for pairs of which only one succeeded; 1 where there are none."""
    discordant = only_first + only_second
    return 1.0 if discordant == 0 else float(binomtest(only_first, discordant, 0.5).pvalue)


def fisher(first: Rate, second: Rate) -> float:
    """The two-sided p of Fisher's exact test that two rates are one."""
    table = [[rate.successes, rate.total - rate.successes] for rate in (first, second)]
    return float(fisher_exact(table).pvalue)
