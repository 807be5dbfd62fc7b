"""Relations that say which object is meant, or where on a surface: "next to the wrench", "2nd from the left".

Pure geometry in the horizontal plane. Left, right, front and back are as a viewer sees them: a robot at the surface's
first viewpoint, in the direction in which it faces there; or a person whom the relations name, who faces the surface.
"""

import cmath
import enum
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Final

import numpy as np

from skills.inputs.errors import definite
from skills.quantities import Coordinate, Quantity
from skills.robot import Pose2D

Nth = Annotated[int, Quantity(ge=1, le=99)]
"""Number in an order."""


class RelationKind(enum.Enum):
    """Kind of a relation to landmarks, to the surface, or to the other objects of the kind."""

    NEXT_TO = "next to"
    LEFT_OF = "left of"
    RIGHT_OF = "right of"
    BEHIND = "behind"
    IN_FRONT_OF = "in front of"
    BETWEEN = "between"
    MIDDLE = "in the middle"
    EDGE = "at the edge"
    LEFT_HALF = "on the left half"
    RIGHT_HALF = "on the right half"
    FRONT_HALF = "on the front half"
    BACK_HALF = "on the back half"
    NEAREST_TO = "nearest to"
    LEFT = "from the left"
    RIGHT = "from the right"
    BIGGEST = "biggest of all"
    SMALLEST = "smallest of all"
    SEEN_FROM = "seen from"  # the viewer of all other relations
    NOT_AT = "not at"  # a surface or a room, which a search leaves out


_K = RelationKind
PARTS: Final = frozenset({_K.MIDDLE, _K.EDGE, _K.LEFT_HALF, _K.RIGHT_HALF, _K.FRONT_HALF, _K.BACK_HALF})
"""Kinds that name a part of the surface."""
ROWS: Final = frozenset({_K.LEFT, _K.RIGHT, _K.BIGGEST, _K.SMALLEST})
"""Kinds that put the objects in a row, of which the `nth` is meant."""
ORDERS: Final = ROWS | {_K.NEAREST_TO}
"""Kinds that compare the objects with one another."""
_TURNS: Final[Mapping[RelationKind, complex]] = {
    **{_K.BEHIND: 1, _K.IN_FRONT_OF: -1, _K.LEFT_OF: -1j, _K.RIGHT_OF: 1j},
    **{_K.BACK_HALF: 1, _K.FRONT_HALF: -1, _K.LEFT_HALF: -1j, _K.RIGHT_HALF: 1j},
}
ROBOT: Final = "robot"
"""Landmark at the surface's viewpoint, as in "the one nearest to you"."""
DOOR: Final = "door"
"""Landmark at the only door of a room."""
NEXT_M: Final = 0.2
"""Largest gap between neighbours."""
BESIDE_M: Final = 1.0
"""Largest distance of an object left of, right of, before or behind a landmark."""
EDGE_M: Final = 0.15
"""Largest distance from the edge of a surface to the middle of an object at the edge."""
MIDDLE_M: Final = 0.1
"""Least distance from its centre up to which the middle of a surface extends; on large ones, half way to the edge."""
TWICE: Final = 2.0
EQUAL_M: Final = 0.03
EQUAL_SIZE_M: Final = 0.01
"""Differences in place and in size up to which two objects are equal."""


@dataclass(frozen=True)
class Landmark:
    """Object, furniture or person of a relation, by name and attributes.

    An object is of one of the `classes`; known furniture, a door or a person has an outline or a point in the world.
    """

    name: str
    attributes: tuple[str, ...] = ()
    classes: tuple[str, ...] = ()
    outline_W: tuple[tuple[Coordinate, Coordinate], ...] = ()

    def __str__(self) -> str:
        return self.name if self.name[:1].isupper() else definite(" ".join((*self.attributes, self.name)))


@dataclass(frozen=True)
class Relation:
    """Relation to landmarks; `nth` counts from 1 in a row.

    Raises ValueError for the wrong number of landmarks, and for an `nth` in other kinds.
    """

    kind: RelationKind
    landmarks: tuple[Landmark, ...] = ()
    nth: Nth = 1

    def __post_init__(self) -> None:
        wanted = 0 if self.kind in PARTS | ROWS else 2 if self.kind is _K.BETWEEN else 1
        if len(self.landmarks) != wanted:
            raise ValueError(f"'{self.kind.value}' goes with {wanted} landmarks, not {len(self.landmarks)}")
        if self.nth != 1 and self.kind not in ROWS:
            raise ValueError(f"'{self.kind.value}' is no row, so there is no number {self.nth}")

    def __str__(self) -> str:
        return f"{self.phrase} {' and '.join(map(str, self.landmarks))}".rstrip()

    @property
    def phrase(self) -> str:
        """Relation without its landmarks: "next to", "2nd from the left"."""
        is_numbered = self.nth > 1 or self.kind in (_K.LEFT, _K.RIGHT)
        return f"{ordinal(self.nth)} {self.kind.value}" if is_numbered else self.kind.value


def ordinal(number: int) -> str:
    """Ordinal of a number: "1st", "2nd", "11th"."""
    suffix = "th" if number % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"{number}{suffix}"


@dataclass(frozen=True)
class Standing:
    """Object as its relations see it: position (x, y) in the world, and length, width and height (m)."""

    p_W: tuple[float, float]
    sides_m: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Scene:
    """Surface as seen by a viewer, with the objects for each landmark that is not known furniture."""

    polygon_W: Sequence[tuple[float, float]]
    viewer: Pose2D
    objects: Mapping[Landmark, Sequence[Standing]] = field(default_factory=dict)

    def places(self, landmark: Landmark, one: Standing) -> Sequence[Standing]:
        """Objects other than `one` that a landmark may be, or the point of known furniture nearest to it."""
        if landmark.outline_W:
            return [Standing(nearest_point(landmark.outline_W, one.p_W))]
        if landmark.name == ROBOT and not landmark.classes:
            return [Standing((self.viewer.x_m, self.viewer.y_m))]
        return [each for each in self.objects.get(landmark, ()) if each != one]

    def apart_m(self, landmark: Landmark, one: Standing) -> float:
        """Distance between an object and a landmark; infinite when no landmark is there."""
        return min((math.dist(one.p_W, each.p_W) for each in self.places(landmark, one)), default=math.inf)

    def offset_m(self, at_W: tuple[float, float], p_W: tuple[float, float]) -> complex:
        """Offset of a point from another as the viewer sees it: behind it (real part) and left of it (imaginary)."""
        return (complex(*p_W) - complex(*at_W)) * cmath.rect(1.0, -self.viewer.yaw_rad)

    def middle_W(self) -> tuple[float, float]:
        """Centre of the surface; of an unknown one, the viewer's position."""
        x, y = np.mean(self.polygon_W, axis=0) if len(self.polygon_W) else (self.viewer.x_m, self.viewer.y_m)
        return float(x), float(y)


def choose(
    relations: Sequence[Relation], among: Sequence[Standing], scene: Scene, slack_m: float = 0.0, *, every: bool = False
) -> list[int]:
    """Indices of the candidates that the relations mean; several when they fit equally, none when nothing fits.

    Beside a landmark, one candidate fits better than another that is `TWICE` as far away, unless `every` one that fits
    is wanted. With slack, relations may be missed by so many metres.
    """
    for outline_W in (each.landmarks[0].outline_W for each in relations if each.kind is _K.SEEN_FROM):
        (x, y), middle_W = np.mean(outline_W, axis=0), scene.middle_W()
        yaw_rad = math.atan2(middle_W[1] - y, middle_W[0] - x)
        scene = replace(scene, viewer=Pose2D(float(x), float(y), yaw_rad))
    others = [each for each in relations if each.kind not in ORDERS]
    chosen = [k for k, one in enumerate(among) if all(margin_m(each, one, scene) >= -slack_m for each in others)]
    beside = [each for each in others if each.kind is not _K.SEEN_FROM and len(each.landmarks) == 1]
    for relation in () if every else beside:
        apart_m = {k: scene.apart_m(relation.landmarks[0], among[k]) for k in chosen}
        chosen = [k for k in chosen if apart_m[k] <= TWICE * min(apart_m.values()) + slack_m]
    for relation in (each for each in relations if each.kind in ORDERS):
        keys_m = {k: key for k in chosen if (key := _key_m(relation, among[k], scene)) < math.inf}
        if relation.nth > len(keys_m):
            return []
        wanted_m = sorted(keys_m.values())[relation.nth - 1]
        equal_m = slack_m + (EQUAL_SIZE_M if relation.kind in (_K.BIGGEST, _K.SMALLEST) else EQUAL_M)
        chosen = [k for k, key in keys_m.items() if abs(key - wanted_m) <= equal_m]
    return chosen


def margin_m(relation: Relation, one: Standing, scene: Scene) -> float:
    """Distance (m) by which an object has a relation, negative when it has not; -inf without a landmark."""
    kind, middle_W = relation.kind, scene.middle_W()
    if kind is _K.SEEN_FROM or (kind in PARTS and not len(scene.polygon_W)):
        return math.inf if kind is _K.SEEN_FROM else -math.inf
    if kind is _K.EDGE:
        return EDGE_M - math.dist(nearest_point(scene.polygon_W, one.p_W), one.p_W)
    if kind is _K.MIDDLE:
        half_m = 0.5 * math.dist(nearest_point(scene.polygon_W, middle_W), middle_W)
        return max(MIDDLE_M, half_m) - math.dist(one.p_W, middle_W)
    if kind in PARTS:
        return (_TURNS[kind] * scene.offset_m(middle_W, one.p_W)).real
    places = [scene.places(landmark, one) for landmark in relation.landmarks]
    if kind is _K.BETWEEN:
        pairs = ((a.p_W, b.p_W) for a in places[0] for b in places[1] if a != b)
        return max((_between_m(one.p_W, *pair) for pair in pairs), default=-math.inf)
    return max((_beside_m(kind, one, place, scene) for place in places[0]), default=-math.inf)


def _beside_m(kind: RelationKind, one: Standing, landmark: Standing, scene: Scene) -> float:
    """Margin of a relation to one landmark; each side of a landmark is a quarter of its surroundings."""
    apart_m = math.dist(one.p_W, landmark.p_W)
    if kind is _K.NEXT_TO:
        return NEXT_M + 0.5 * (max(one.sides_m[:2]) + max(landmark.sides_m[:2])) - apart_m
    offset_m = _TURNS[kind] * scene.offset_m(landmark.p_W, one.p_W)
    return min((offset_m.real - abs(offset_m.imag)) / math.sqrt(2.0), BESIDE_M - apart_m)


def _between_m(p_W: tuple[float, float], a_W: tuple[float, float], b_W: tuple[float, float]) -> float:
    """Margin of a point between two others: within a quarter of their distance from the line that joins them."""
    along = complex(*b_W) - complex(*a_W)
    apart_m = abs(along)
    offset_m = (complex(*p_W) - complex(*a_W)) * along.conjugate() / (apart_m or 1.0)
    return min(offset_m.real, apart_m - offset_m.real, 0.25 * apart_m - abs(offset_m.imag))


def _key_m(relation: Relation, one: Standing, scene: Scene) -> float:
    """Value (m) by which an order sorts, the first least; infinite without a landmark."""
    if relation.kind in (_K.BIGGEST, _K.SMALLEST):
        return max(one.sides_m) if relation.kind is _K.SMALLEST else -max(one.sides_m)
    if relation.kind is _K.NEAREST_TO:
        return scene.apart_m(relation.landmarks[0], one)
    left_m = scene.offset_m(scene.middle_W(), one.p_W).imag
    return -left_m if relation.kind is _K.LEFT else left_m


def nearest_point(outline_W: Sequence[tuple[float, float]], p_W: tuple[float, float]) -> tuple[float, float]:
    """Point of an outline nearest to a point."""
    corners, p = np.array(outline_W, dtype=float), np.array(p_W)
    along = np.roll(corners, -1, axis=0) - corners
    shares = np.sum((p - corners) * along, axis=1) / np.maximum(np.sum(along**2, axis=1), 1e-9)
    nearest = corners + np.clip(shares, 0.0, 1.0)[:, None] * along
    x, y = nearest[int(np.argmin(np.linalg.norm(nearest - p, axis=1)))]
    return float(x), float(y)
