"""The body as fields: trunk, limbs, hands, head with a face."""

from __future__ import annotations

import numpy as np

from plant.dataset.objects.people.form import Build, Limb, Skeleton
from plant.models.builder.implicit import Field, ball, cut, join, limb
from skills.robot import FloatArray


def trunk(build: Build, s: Skeleton) -> Field:
    """Pelvis, waist, chest and shoulders."""
    h, g = build.height_m, build.girth
    belly = max(0.0, g - 1.08) * 0.16
    up = (s.neck - s.pelvis) / np.linalg.norm(s.neck - s.pelvis)
    parts = [
        ball(s.pelvis + [0.0, 0, 0.005 * h], (0.068 * h * g, 0.096 * h * build.hips * (0.55 + 0.45 * g), 0.072 * h)),
        ball(
            s.pelvis + up * 0.095 * h + [belly * 0.5 + 0.004 * h, 0, 0],
            (0.062 * h * g + belly * 0.5, 0.080 * h * g, 0.095 * h),
        ),
        ball(
            s.chest + [0.006 * h, 0, 0.012 * h],
            (0.066 * h * (0.5 + 0.5 * g), 0.090 * h * build.shoulders * (0.7 + 0.3 * g), 0.115 * h),
        ),
        limb(s.arms[1].root, s.arms[0].root, 0.029 * h, 0.029 * h),
        limb(s.neck - up * 0.055 * h, s.neck + up * 0.012 * h, 0.060 * h, 0.034 * h),
    ]
    return join(parts, 0.05)


def upper_limbs(build: Build, s: Skeleton) -> Field:
    """Both arms to the wrists."""
    h, g = build.height_m, 0.6 + 0.4 * build.girth
    parts = []
    for arm in s.arms:
        parts += [ball(arm.root, 0.031 * h * g), limb(arm.root, arm.middle, 0.029 * h * g, 0.024 * h * g)]
        parts += [limb(arm.middle, arm.end, 0.025 * h * g, 0.0165 * h * g)]
    return join(parts, 0.02)


def lower_limbs(build: Build, s: Skeleton) -> Field:
    """Both legs to the ankles."""
    h, g = build.height_m, 0.55 + 0.45 * build.girth
    parts = []
    for leg in s.legs:
        calf = leg.middle * 0.68 + leg.end * 0.32 - _forward(leg) * 0.012 * h
        parts += [
            limb(leg.root, leg.middle, 0.053 * h * g, 0.034 * h * g),
            limb(leg.middle, leg.end, 0.033 * h * g, 0.022 * h * g),
        ]
        parts += [ball(calf, (0.030 * h * g, 0.030 * h * g, 0.055 * h))]
    return join(parts, 0.03)


def _forward(leg: Limb) -> FloatArray:
    return np.array([1.0, 0.0, 0.0])


def neck(build: Build, s: Skeleton) -> Field:
    """The bare neck and the upper breast under a collar."""
    h = build.height_m
    return join(
        [limb(s.neck - [0, 0, 0.03 * h], s.head - [0.008 * h, 0, 0.02 * h], 0.036 * h, 0.031 * h), trunk(build, s)],
        0.02,
    )


def hand(build: Build, arm: Limb, side: int) -> Field:
    """A hand with bent fingers that continues the forearm."""
    h = build.height_m
    along = (arm.end - arm.middle) / np.linalg.norm(arm.end - arm.middle)
    across = np.cross(along, [0.0, side, 0.0])
    across = across / max(float(np.linalg.norm(across)), 1e-6)
    inward = np.cross(across, along) * side
    wrist, palm = arm.end, arm.end + along * 0.030 * h
    parts = [limb(wrist - along * 0.01 * h, palm, 0.0155 * h, 0.017 * h), ball(palm + along * 0.012 * h, 0.019 * h)]
    for k, offset in enumerate((-1.5, -0.5, 0.5, 1.5)):
        knuckle = palm + along * 0.022 * h + across * offset * 0.0095 * h
        bend = knuckle + along * (0.026 - 0.002 * abs(k - 1)) * h + inward * 0.004 * h
        tip = bend + along * 0.016 * h + inward * 0.012 * h
        parts += [limb(knuckle, bend, 0.0060 * h, 0.0054 * h), limb(bend, tip, 0.0054 * h, 0.0045 * h)]
    thumb = palm - along * 0.012 * h + across * -0.016 * h * side
    parts.append(
        limb(thumb, thumb + along * 0.033 * h - across * 0.008 * h * side + inward * 0.006 * h, 0.0068 * h, 0.0055 * h)
    )
    return join(parts, 0.008)


def hand_tip(arm: Limb, build: Build) -> FloatArray:
    """The middle of the hand."""
    along = (arm.end - arm.middle) / np.linalg.norm(arm.end - arm.middle)
    return np.asarray(arm.end + along * 0.04 * build.height_m)


def head(build: Build, rng: np.random.Generator) -> Field:
    """The head about its own middle, looking along x: skull, jaw, nose, brow, sockets, ears."""
    u = 0.0715 * build.height_m / 0.123
    jaw, nose, wide = float(rng.uniform(0.9, 1.12)), float(rng.uniform(0.8, 1.3)), float(rng.uniform(0.95, 1.06))
    parts = [
        ball((-0.010 * u, 0, 0.035 * u), (0.098 * u, 0.077 * u * wide, 0.088 * u)),
        ball((0.020 * u, 0, -0.030 * u), (0.070 * u, 0.062 * u * jaw * wide, 0.078 * u)),
        ball((0.060 * u, 0, -0.088 * u), (0.026 * u, 0.028 * u * jaw, 0.022 * u)),
        ball((0.070 * u, 0.034 * u, -0.020 * u), (0.020 * u, 0.022 * u, 0.018 * u)),
        ball((0.070 * u, -0.034 * u, -0.020 * u), (0.020 * u, 0.022 * u, 0.018 * u)),
        ball((0.080 * u, 0, 0.035 * u), (0.012 * u, 0.050 * u, 0.012 * u)),
    ]
    skull = join(parts, 0.03 * u)
    sockets = [ball((0.100 * u, y * u, 0.016 * u), (0.016 * u, 0.019 * u, 0.012 * u)) for y in (0.032, -0.032)]
    face = cut(skull, join(sockets), 0.014 * u)
    trim = [
        limb((0.086 * u, 0, 0.016 * u), (0.108 * u * (0.9 + 0.1 * nose), 0, -0.024 * u), 0.007 * u, 0.0125 * u * nose),
        *(ball((-0.002 * u, y * 0.078 * u * wide, -0.004 * u), (0.018 * u, 0.009 * u, 0.030 * u)) for y in (1, -1)),
    ]
    return join([face, *trim], 0.010 * u)
