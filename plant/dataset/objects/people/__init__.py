"""People of many builds, skins, hairs, clothes and stances, made of rounded fields."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from plant.dataset.objects.draft import FLESH, Draft, Finished, pick, shade
from plant.dataset.objects.people.body import hand, hand_tip, head, lower_limbs, neck, upper_limbs
from plant.dataset.objects.people.clothes import Outfit, bottom_field, bottom_picture, top_field, top_picture
from plant.dataset.objects.people.form import SEAT_HEIGHT_M, Build, Limb, Skeleton, skeleton
from plant.dataset.objects.wear import plain
from plant.models.builder.implicit import Field, ball, both, cut, grown, half_space, join, limb, surface
from plant.models.builder.mesh import Colour, Mesh
from plant.models.builder.pictures import noise
from plant.models.builder.shapes import Capsule, Cylinder
from plant.models.builder.surfaces import add_ellipsoid, add_tube
from skills.robot import FloatArray

__all__ = ["SEAT_HEIGHT_M", "person"]


SKINS: tuple[Colour, ...] = (
    (0.93, 0.76, 0.66),
    (0.88, 0.68, 0.55),
    (0.80, 0.60, 0.46),
    (0.70, 0.49, 0.35),
    (0.55, 0.36, 0.25),
    (0.40, 0.26, 0.18),
    (0.28, 0.18, 0.13),
)
HAIRS: tuple[Colour, ...] = (
    (0.06, 0.05, 0.05),
    (0.16, 0.10, 0.07),
    (0.32, 0.20, 0.12),
    (0.55, 0.38, 0.20),
    (0.78, 0.64, 0.40),
    (0.50, 0.20, 0.10),
    (0.66, 0.65, 0.64),
)


def person(draft: Draft) -> tuple[Finished, str, str]:
    """A person who looks along x; the origin is on the floor."""
    rng = draft.rng
    build, outfit = Build.drawn(rng), Outfit.drawn(rng)
    joints = skeleton(build, rng)
    _skin_materials(draft)
    _body(draft, build, joints, outfit)
    _clothes(draft, build, joints, outfit)
    _shoes(draft, build, joints)
    _head(draft, build, joints)
    _collide(draft, build, joints)
    return draft.finish(build.mass_kg, on_floor=True), build.stance, _colour_name(outfit.top_colour)


def _skin_materials(draft: Draft) -> None:
    rng = draft.rng
    skin = shade(rng, SKINS[int(rng.integers(len(SKINS)))], 0.04)
    shape = (96, 96)
    image = plain(skin, shape) * (1 + 0.03 * noise(rng, shape, (8, 8)) + 0.015 * noise(rng, shape, (1, 1)))[..., None]
    draft.picture("skin", image, shine=0.25)
    draft.paint("lip", skin * [0.85, 0.62, 0.6], shine=0.3)
    draft.paint("white", (0.93, 0.92, 0.90), shine=0.6)
    draft.paint(
        "iris", pick(rng, (0.20, 0.12, 0.07), (0.25, 0.35, 0.45), (0.10, 0.07, 0.05), (0.25, 0.30, 0.15)), shine=0.7
    )
    hair = shade(rng, HAIRS[int(rng.choice(7, p=[0.24, 0.22, 0.18, 0.12, 0.1, 0.05, 0.09]))], 0.06)
    strands = plain(hair, shape) * (1 + 0.22 * noise(rng, shape, (9, 0.7)))[..., None]
    draft.picture("hair", strands, shine=0.35)
    draft.paint("brow", hair * 0.7, shine=0.1)


def _body(draft: Draft, build: Build, s: Skeleton, outfit: Outfit) -> None:
    """All skin that clothes leave bare."""
    h = build.height_m
    part = draft.part()
    _cast(
        part, "skin", both(neck(build, s), half_space(s.neck - [0, 0, 0.05 * h], (0, 0, -1))), s.neck, 0.16 * h, 0.013
    )
    arms = upper_limbs(build, s)
    for arm, side in zip(s.arms, (1, -1), strict=True):
        if outfit.sleeve < 0.9:
            low, high = _bounds([arm.root, arm.middle, arm.end], 0.05 * h)
            _cast_box(part, "skin", both(arms, _beside(side)), low, high, 0.013)
        _cast(part, "skin", hand(build, arm, side), hand_tip(arm, build), 0.075 * h, 0.0075)
    if outfit.bottom in ("shorts", "skirt"):
        low, high = _bounds([p for leg in s.legs for p in (leg.root, leg.middle, leg.end)], 0.07 * h)
        bare = both(lower_limbs(build, s), half_space(s.pelvis - [0, 0, 0.07 * h], (0, 0, 1)))
        bare = lower_limbs(build, s) if build.stance == "sitting" else bare
        _cast_box(part, "skin", bare, low, high, 0.015)
    draft.solid(part, FLESH)


def _beside(side: int) -> Field:
    """Only one side of the body."""
    return half_space((0, 0, 0), (0, -side, 0))


def _clothes(draft: Draft, build: Build, s: Skeleton, outfit: Outfit) -> None:
    rng, h = draft.rng, build.height_m
    draft.picture("top", top_picture(rng, outfit), shine=0.08)
    draft.picture("bottom", bottom_picture(rng, outfit), shine=0.08)
    upper = [p for arm in s.arms for p in (arm.root, arm.middle, arm.end)]
    low, high = _bounds([*upper, s.pelvis - [0, 0, 0.24 * h], s.neck], 0.13 * h)
    part = draft.part()
    _cast_box(part, "top", top_field(build, s, outfit, rng), low, high, 0.016)
    draft.solid(part, FLESH)
    legs = [p for leg in s.legs for p in (leg.root, leg.middle, leg.end)]
    low, high = _bounds([*legs, s.pelvis], 0.13 * h)
    part = draft.part()
    _cast_box(part, "bottom", bottom_field(build, s, outfit, rng), low, high, 0.016)
    draft.solid(part, FLESH)


def _shoes(draft: Draft, build: Build, s: Skeleton) -> None:
    rng, h = draft.rng, build.height_m
    colour = pick(
        rng,
        (0.08, 0.08, 0.08),
        (0.25, 0.16, 0.10),
        (0.85, 0.85, 0.84),
        (0.30, 0.31, 0.33),
        (0.5, 0.1, 0.1),
        (0.15, 0.22, 0.4),
    )
    draft.picture("shoe", plain(shade(rng, colour), (64, 64)), shine=0.3)
    draft.paint("sole", pick(rng, (0.9, 0.9, 0.88), (0.12, 0.12, 0.12), (0.35, 0.28, 0.2)))
    part = draft.part()
    for leg in s.legs:
        pitch = _foot_pitch(build, leg)
        ahead, up = np.array([np.cos(pitch), 0, np.sin(pitch)]), np.array([-np.sin(pitch), 0, np.cos(pitch)])
        heel = leg.end - up * 0.018 * h - ahead * 0.012 * h
        toe = heel + ahead * 0.095 * h - up * 0.006 * h
        upper = join(
            [
                limb(heel, toe, 0.026 * h, 0.021 * h),
                limb(leg.end + up * 0.012 * h, heel + ahead * 0.03 * h, 0.026 * h, 0.024 * h),
            ],
            0.02,
        )
        floor = leg.end - up * 0.038 * h
        _cast(part, "shoe", both(upper, half_space(floor, -up)), heel + ahead * 0.045 * h, 0.11 * h, 0.010)
        slab = both(
            both(grown(upper, 0.005), half_space(floor - up * 0.007 * h, -up)), half_space(floor + up * 0.004 * h, up)
        )
        _cast(part, "sole", slab, heel + ahead * 0.045 * h, 0.11 * h, 0.009)
    draft.solid(part, FLESH)


def _foot_pitch(build: Build, leg: Limb) -> float:
    """A foot behind the body stands on its toes."""
    lifted = float(leg.end[2]) - 0.045 * build.height_m
    return -float(np.clip(lifted * 6.0, 0.0, 0.9))


def _head(draft: Draft, build: Build, s: Skeleton) -> None:
    """Face and hair are made about the head's middle, then turned."""
    rng, part = draft.rng, draft.part()
    u = 0.0715 * build.height_m / 0.123
    skull = head(build, rng)
    _cast(part, "skin", skull, (0, 0, 0), 0.13 * u, 0.0075)
    for y in (0.032, -0.032):
        add_ellipsoid(part, "white", (0.080 * u, y * u, 0.014 * u), (0.013 * u, 0.014 * u, 0.010 * u), sides=14)
        add_ellipsoid(part, "iris", (0.089 * u, y * u, 0.014 * u), (0.006 * u, 0.0065 * u, 0.0065 * u), sides=10)
        brow = [(0.092 * u, (y + d) * u, (0.036 + 0.004 * (1 - abs(d) * 60)) * u) for d in (-0.016, 0, 0.016)]
        add_tube(part, "brow", brow, 0.0045 * u, sides=8)
    mouth = [(0.080 * u, -0.024 * u, -0.056 * u), (0.090 * u, 0, -0.058 * u), (0.080 * u, 0.024 * u, -0.056 * u)]
    add_tube(part, "lip", mouth, [0.004 * u, 0.0075 * u, 0.004 * u], sides=8)
    _hair(draft, part, skull, u)
    if rng.random() < 0.18:
        _glasses(draft, part, u)
    draft.solid(part, FLESH, s.head_turn, s.head)


def _hair(draft: Draft, part: Mesh, skull: Field, u: float) -> None:
    rng = draft.rng
    style = str(
        rng.choice(
            ["short", "bald", "long", "bun", "full", "cap", "helmet"], p=[0.34, 0.08, 0.2, 0.08, 0.12, 0.1, 0.08]
        )
    )
    face = ball((0.120 * u, 0, -0.045 * u), (0.092 * u, 0.085 * u, float(rng.uniform(0.105, 0.135)) * u))
    thick = {"short": 0.010, "bald": 0.0, "long": 0.015, "bun": 0.010, "full": 0.032, "cap": 0.012, "helmet": 0.024}[
        style
    ] * u
    if rng.random() < 0.18:
        beard = both(
            both(grown(skull, 0.006 * u), half_space((0, 0, -0.035 * u), (0, 0, 1))),
            half_space((0.0, 0, 0), (-1, 0, 0)),
        )
        _cast(
            part,
            "hair",
            cut(beard, ball((0.10 * u, 0, -0.058 * u), (0.03 * u, 0.022 * u, 0.009 * u))),
            (0, 0, 0),
            0.14 * u,
            0.007,
        )
    if style == "bald":
        return
    if style in ("cap", "helmet"):
        return _hat(draft, part, skull, thick, style, u)
    slope, height = (0.9, 0.01) if style in ("short", "bun") else (0.35, -0.045)
    low = half_space((-0.03 * u, 0, height * u), (slope, 0, -1))
    crown = both(cut(grown(skull, thick), face, 0.01 * u), low)
    parts = [crown]
    if style == "long":
        end = -float(rng.uniform(0.14, 0.26)) * u
        fall = limb((-0.055 * u, 0, 0.02 * u), (-0.065 * u, 0, end), 0.075 * u, 0.06 * u)
        parts.append(
            cut(
                fall,
                join([grown(skull, -0.004), ball((0.075 * u, 0, -0.09 * u), (0.10 * u, 0.06 * u, 0.16 * u))]),
                0.01 * u,
            )
        )
    if style == "bun":
        parts.append(ball((-0.105 * u, 0, 0.06 * u), 0.036 * u))
    field = join(parts, 0.02 * u)
    _cast_box(part, "hair", field, (-0.17 * u, -0.13 * u, -0.30 * u), (0.15 * u, 0.13 * u, 0.17 * u), 0.0085)


def _hat(draft: Draft, part: Mesh, skull: Field, thick: float, style: str, u: float) -> None:
    rng = draft.rng
    bright = pick(rng, (0.95, 0.82, 0.08), (0.93, 0.93, 0.92), (0.90, 0.35, 0.06), (0.10, 0.28, 0.62))
    dark = pick(rng, (0.1, 0.1, 0.12), (0.12, 0.2, 0.4), (0.5, 0.1, 0.1), (0.3, 0.32, 0.25))
    draft.paint("hat", shade(rng, bright if style == "helmet" else dark), shine=0.5 if style == "helmet" else 0.05)
    over = half_space((0.0, 0, 0.048 * u), (0.0, 0, -1))
    brim = both(
        ball((0.11 * u, 0, 0.052 * u), (0.085 * u, 0.075 * u, 0.010 * u)), half_space((0.05 * u, 0, 0), (-1, 0, 0))
    )
    field = join([both(grown(skull, thick), over), brim], 0.006 * u)
    _cast(part, "hat", field, (0.02 * u, 0, 0.06 * u), 0.19 * u, 0.0075)
    if style == "cap":
        rest = both(
            cut(grown(skull, 0.008 * u), ball((0.120 * u, 0, -0.035 * u), (0.085 * u, 0.075 * u, 0.105 * u))),
            half_space((-0.03 * u, 0, -0.03 * u), (0.35, 0, -1)),
        )
        _cast(part, "hair", both(rest, half_space((0, 0, 0.055 * u), (0, 0, 1))), (0, 0, 0), 0.14 * u, 0.008)


def _glasses(draft: Draft, part: Mesh, u: float) -> None:
    draft.paint("frame", (0.07, 0.06, 0.06), shine=0.6)
    angle = np.linspace(0, 2 * np.pi, 19)
    for y in (0.033, -0.033):
        ring = np.stack(
            [0 * angle + 0.103 * u, y * u + 0.024 * u * np.cos(angle), 0.013 * u + 0.019 * u * np.sin(angle)], axis=1
        )
        add_tube(part, "frame", ring, 0.0022 * u, sides=6, caps=False)
        add_tube(
            part,
            "frame",
            [(0.103 * u, y * 1.7 * u, 0.02 * u), (0.0, np.sign(y) * 0.082 * u, 0.02 * u)],
            0.0022 * u,
            sides=6,
        )
    add_tube(part, "frame", [(0.105 * u, -0.01 * u, 0.016 * u), (0.105 * u, 0.01 * u, 0.016 * u)], 0.0022 * u, sides=6)


def _bounds(points: list[FloatArray], margin: float) -> tuple[FloatArray, FloatArray]:
    cloud = np.array(points)
    return cloud.min(axis=0) - margin, cloud.max(axis=0) + margin


def _cast(part: Mesh, material: str, field: Field, centre: ArrayLike, reach: float, step: float) -> None:
    middle = np.asarray(centre, dtype=float)
    _cast_box(part, material, field, middle - reach, middle + reach, step)


def _cast_box(
    part: Mesh, material: str, field: Field, low: FloatArray | ArrayLike, high: ArrayLike, step: float
) -> None:
    """Add a field's surface; its picture shows the front in its left half and the back in its right."""
    points, normals = surface(field, low, high, step)
    if not len(points):
        return
    a, b = points.min(axis=0), points.max(axis=0)
    span = np.maximum(b - a, 1e-6)
    middle = points.reshape(-1, 3, 3).mean(axis=1)
    facing = np.cross(points[1::3] - points[0::3], points[2::3] - points[0::3])[:, 0]
    back = np.repeat(facing < 0, 3) if len(middle) else facing
    across = (points[:, 1] - a[1]) / span[1]
    u = np.where(back, 1.0 - 0.5 * across, 0.5 * across)
    v = (points[:, 2] - a[2]) / span[2]
    part.add_triangles(material, points, normals, np.column_stack([u, v]))


def _collide(draft: Draft, build: Build, s: Skeleton) -> None:
    """A capsule for each limb, an upright cylinder for trunk and head."""
    h, g = build.height_m, build.girth
    for arm in s.arms:
        draft.collide(_capsule(arm.root, arm.middle, 0.03 * h), _capsule(arm.middle, arm.end, 0.025 * h))
    for leg in s.legs:
        draft.collide(_capsule(leg.root, leg.middle, 0.05 * h), _capsule(leg.middle, leg.end, 0.036 * h))
    length = float(s.neck[2] - s.pelvis[2]) + 0.08 * h
    middle = float(s.neck[2] + s.pelvis[2]) / 2 - 0.03 * h
    draft.collide(Cylinder(radius=0.085 * h * g, length=length, p=(float(s.chest[0]), 0.0, middle)))
    x, y, z = (float(v) for v in s.head)
    draft.collide(Cylinder(radius=0.055 * h, length=0.14 * h, p=(x, y, z)))


def _capsule(a: FloatArray, b: FloatArray, radius: float) -> Capsule:
    way = b - a
    length = float(np.linalg.norm(way))
    x, y, z = (float(v) for v in way / length)
    cx, cy, cz = (float(v) for v in (a + b) / 2)
    return Capsule(
        radius=radius,
        length=length,
        p=(cx, cy, cz),
        rpy=(0.0, float(np.arctan2(np.hypot(x, y), z)), float(np.arctan2(y, x))),
    )


def _colour_name(colour: Colour) -> str:
    grey = max(colour) - min(colour) < 0.12
    if grey:
        return "black" if max(colour) < 0.25 else "white" if min(colour) > 0.75 else "grey"
    return ("red", "green", "blue")[int(np.argmax(colour))]
