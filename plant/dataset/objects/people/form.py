"""A person's build and stance, and the joints that follow from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from skills.robot import FloatArray

SEAT_HEIGHT_M = 0.45
STANCES = ("standing", "arms out", "walking", "sitting", "hands on hips", "reaching", "relaxed")


@dataclass(frozen=True)
class Build:
    """Height (m); girth, shoulder and hip widths as factors of the average; stance; heading of the head (rad)."""

    height_m: float
    girth: float
    shoulders: float
    hips: float
    stance: str
    look_rad: float
    nod_rad: float

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Self:
        """An adult."""
        slim = float(rng.normal(0, 1))
        return cls(
            height_m=float(np.clip(rng.normal(1.72, 0.09), 1.48, 1.98)),
            girth=float(np.clip(1.0 + 0.13 * slim + 0.03 * max(slim, 0) ** 2, 0.84, 1.4)),
            shoulders=float(rng.uniform(0.88, 1.1)),
            hips=float(rng.uniform(0.92, 1.12)),
            stance=str(rng.choice(STANCES, p=[0.22, 0.1, 0.22, 0.14, 0.1, 0.12, 0.1])),
            look_rad=float(rng.normal(0, 0.3)),
            nod_rad=float(rng.normal(0.05, 0.12)),
        )

    @property
    def mass_kg(self) -> float:
        """What such a person weighs."""
        return float(22.0 * self.girth**1.7 * self.height_m**2)


@dataclass(frozen=True)
class Limb:
    """Three joints: shoulder, elbow, wrist; or hip, knee, ankle (m)."""

    root: FloatArray
    middle: FloatArray
    end: FloatArray


@dataclass(frozen=True)
class Skeleton:
    """Joints in the person's frame: x forward, y left, z up from the floor. Limbs are (left, right)."""

    pelvis: FloatArray
    chest: FloatArray
    neck: FloatArray
    head: FloatArray
    arms: tuple[Limb, Limb]
    legs: tuple[Limb, Limb]
    head_turn: FloatArray


def _way(pitch: float, roll: float) -> FloatArray:
    """The direction of a limb that hangs down, swung forward by pitch and outward (to +y) by roll."""
    return np.array([np.sin(pitch) * np.cos(roll), np.sin(roll), -np.cos(pitch) * np.cos(roll)])


def skeleton(build: Build, rng: np.random.Generator) -> Skeleton:
    """The joints of a build in its stance."""
    h = build.height_m
    swing, lean = float(rng.uniform(0.25, 0.55)), float(rng.normal(0.03, 0.04))
    legs, drop = _legs(build, rng, swing)
    pelvis = np.array([0.0, 0.0, drop])
    up = np.array([np.sin(lean), 0.0, np.cos(lean)])
    chest, neck = pelvis + up * 0.19 * h, pelvis + up * 0.315 * h
    arms = _arms(build, rng, chest + up * 0.082 * h, swing)
    c, s = np.cos(build.look_rad), np.sin(build.look_rad)
    cn, sn = np.cos(build.nod_rad), np.sin(build.nod_rad)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[cn, 0, sn], [0, 1, 0], [-sn, 0, cn]])
    head = neck + up * 0.075 * h + np.array([0.012 * h, 0, 0])
    return Skeleton(pelvis, chest, neck, head, arms, legs, turn)


def _legs(build: Build, rng: np.random.Generator, swing: float) -> tuple[tuple[Limb, Limb], float]:
    """Legs, the pelvis' height such that the lower foot stands on the floor."""
    h, stance = build.height_m, build.stance
    thigh, shin, ankle = 0.245 * h, 0.235 * h, 0.045 * h
    spread = float(rng.uniform(0.01, 0.10))
    angles = [(0.0, spread, 0.02), (0.0, spread, 0.02)]
    if stance == "walking":
        angles = [(swing, 0.03, 0.08), (-swing * 0.8, 0.03, swing * float(rng.uniform(0.3, 1.1)))]
    elif stance == "sitting":
        angles = [(np.pi / 2 - 0.05, 0.12 + spread, np.pi / 2 - 0.1 + float(rng.normal(0, 0.12)))] * 2
    elif stance == "relaxed":
        angles = [(0.16, 0.06 + spread, 0.30), (-0.02, 0.05, 0.02)]
    limbs, lowest = [], 0.0
    for side, (pitch, roll, bend) in zip((1, -1), angles, strict=True):
        root = np.array([0.0, side * 0.048 * h * build.hips, -0.015 * h])
        flip = np.array([1, side, 1])
        middle = root + thigh * _way(pitch, roll) * flip
        end = middle + shin * _way(pitch - bend, roll * 0.6) * flip
        limbs.append((root, middle, end))
        lowest = min(lowest, float(end[2]))
    lift = ankle - lowest
    if stance == "sitting":
        lift = SEAT_HEIGHT_M + 0.06 * h * build.girth
        limbs = [(r, m, np.array([e[0], e[1], ankle - lift])) for r, m, e in limbs]
    rise = np.array([0, 0, lift])
    left, right = (Limb(r + rise, m + rise, e + rise) for r, m, e in limbs)
    return (left, right), lift


def _arms(build: Build, rng: np.random.Generator, shoulders: FloatArray, swing: float) -> tuple[Limb, Limb]:
    h, stance = build.height_m, build.stance
    hang = float(rng.uniform(0.08, 0.2))
    angles = [(float(rng.normal(0, 0.06)), hang, float(rng.uniform(0.1, 0.35)))] * 2
    if stance == "arms out":
        raised = float(rng.uniform(0.9, 1.5))
        angles = [(0.05, raised, 0.1), (0.05, raised + float(rng.normal(0, 0.1)), 0.1)]
    elif stance == "walking":
        angles = [(-swing, hang, 0.3), (swing, hang, 0.5)]
    elif stance == "sitting":
        angles = [(0.45, 0.12, 0.8), (0.45, 0.12, float(rng.uniform(0.5, 1.3)))]
    elif stance == "reaching":
        angles = [(float(rng.uniform(0.9, 1.7)), 0.1, float(rng.uniform(0.1, 0.6))), angles[1]]
    elif stance == "relaxed":
        angles = [(0.1, hang, float(rng.uniform(1.0, 1.9))), angles[1]]
    limbs = []
    for side, (pitch, roll, bend) in zip((1, -1), angles, strict=True):
        flip = np.array([1, side, 1])
        root = shoulders + np.array([0.0, side * 0.108 * h * build.shoulders, 0.0])
        middle = root + 0.172 * h * _way(pitch, roll) * flip
        way = _way(pitch + bend, roll * 0.6)
        if stance == "hands on hips":
            middle = root + 0.172 * h * _way(-0.25, 0.75) * flip
            way = np.array([0.45, -0.85, -0.45])
        limbs.append(Limb(root, middle, middle + 0.148 * h * way / np.linalg.norm(way) * flip))
    return limbs[0], limbs[1]
