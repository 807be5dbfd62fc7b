"""Counting what several looks saw, each object once."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from skills.api import ObjectObservation

SAME_WITHIN_M = 0.12


def told_apart(looks: Iterable[Sequence[ObjectObservation]]) -> tuple[ObjectObservation, ...]:
    """The different objects of several looks, those of the first look first.

    What a later look saw of the same class within `SAME_WITHIN_M` of a known object is that object; the nearest pairs
    are taken first and each object is in one pair only, so that two that stand close together stay two.
    """
    known: list[ObjectObservation] = []
    for look in looks:
        known += _new(known, look)
    return tuple(known)


def _new(known: Sequence[ObjectObservation], look: Sequence[ObjectObservation]) -> list[ObjectObservation]:
    pairs = sorted(
        (apart_m, k, n)
        for k, old in enumerate(known)
        for n, seen in enumerate(look)
        if old.thing.name == seen.thing.name and (apart_m := math.dist(old.position_W, seen.position_W)) < SAME_WITHIN_M
    )
    paired_old, paired_new = set[int](), set[int]()
    for _, k, n in pairs:
        if k not in paired_old and n not in paired_new:
            paired_old.add(k)
            paired_new.add(n)
    return [seen for n, seen in enumerate(look) if n not in paired_new]
