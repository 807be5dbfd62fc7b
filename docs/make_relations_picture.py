"""Draws `docs/pictures/relations.png`: where on a table each relation holds, by the geometry that the robot uses.

python docs/make_relations_picture.py
"""

from pathlib import Path

import cv2
import numpy as np

from skills.relations import Landmark, Relation, RelationKind, Scene, Standing, margin_m
from skills.robot import FloatArray, Picture, Pose2D

TABLE_W = ((1.0, -0.6), (1.8, -0.6), (1.8, 0.6), (1.0, 0.6))
BEER, COKE = Landmark("beer", classes=("beer",)), Landmark("coke", classes=("coke",))
OBJECTS = {BEER: [Standing((1.4, 0.0), (0.07, 0.07, 0.23))], COKE: [Standing((1.4, 0.4), (0.07, 0.07, 0.12))]}
SCENE = Scene(TABLE_W, Pose2D(0.55, 0.0, 0.0), OBJECTS)
ONE, TWO = (BEER,), (BEER, COKE)
RELATIONS = (
    *(Relation(RelationKind.NEXT_TO, ONE), Relation(RelationKind.LEFT_OF, ONE), Relation(RelationKind.RIGHT_OF, ONE)),
    *(Relation(RelationKind.BEHIND, ONE), Relation(RelationKind.IN_FRONT_OF, ONE), Relation(RelationKind.BETWEEN, TWO)),
    *(Relation(RelationKind.MIDDLE), Relation(RelationKind.EDGE), Relation(RelationKind.LEFT_HALF)),
    *(Relation(RelationKind.RIGHT_HALF), Relation(RelationKind.FRONT_HALF), Relation(RelationKind.BACK_HALF)),
)
PX_PER_M, STEP_PX, COLUMNS = 150, 3, 4
WIDTH, HEIGHT, TITLE = 220, 240, 24
GREY, DARK, HOLDS, GREEN, RED = (226, 226, 226), (60, 60, 60), (168, 205, 120), (60, 140, 40), (40, 40, 190)


def pixel(x: float, y: float) -> tuple[int, int]:
    """Pixel of a point in the world: ahead of the viewer is up, and left is left."""
    return round(WIDTH / 2 - y * PX_PER_M), round(HEIGHT - (x - 0.4) * PX_PER_M)


def panel(relation: Relation) -> Picture:
    """Picture of one relation."""
    image = np.full((HEIGHT, WIDTH, 3), 255, np.uint8)
    cv2.fillPoly(image, [np.array([pixel(x, y) for x, y in TABLE_W], np.int32)], GREY)
    for x in np.arange(1.0, 1.8, STEP_PX / PX_PER_M):
        for y in np.arange(-0.6, 0.6, STEP_PX / PX_PER_M):
            if margin_m(relation, Standing((float(x), float(y))), SCENE) >= 0.0:
                u, v = pixel(float(x), float(y))
                cv2.rectangle(image, (u - 1, v - 1), (u + 1, v + 1), HOLDS, -1)
    for (standing, *_), colour in zip(OBJECTS.values(), (GREEN, RED), strict=True):
        cv2.circle(image, pixel(*standing.p_W), 6, colour, -1, cv2.LINE_AA)
    x, y = SCENE.viewer.x_m, SCENE.viewer.y_m
    arrow: FloatArray = np.array([pixel(x + 0.14, y), pixel(x, y + 0.09), pixel(x, y - 0.09)])
    cv2.fillPoly(image, [arrow.astype(np.int32)], DARK, cv2.LINE_AA)
    cv2.putText(image, str(relation), (8, TITLE - 8), cv2.FONT_HERSHEY_SIMPLEX, 0.4, DARK, 1, cv2.LINE_AA)
    return image


def main() -> None:
    """Writes the picture."""
    panels = [panel(relation) for relation in RELATIONS]
    rows = [np.hstack(panels[k : k + COLUMNS]) for k in range(0, len(panels), COLUMNS)]
    cv2.imwrite(
        str(Path(__file__).parent / "pictures" / "relations.png"), np.vstack(rows), [cv2.IMWRITE_PNG_COMPRESSION, 9]
    )


if __name__ == "__main__":
    main()
