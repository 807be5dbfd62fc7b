"""People for the planar robot: boxes that a detector finds wherever they are in the picture."""

from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from planar_robot import BODY_HEIGHT_M, LENS, X_BC, Bench, Box

from skills.detection import Detection, Detector


def person_at(x_m, y_m):
    """Somebody who stands upright at a place."""
    return Box(x_m - 0.15, y_m - 0.25, x_m + 0.15, y_m + 0.25, 0.0, 1.7)


def blind(bench, monkeypatch):
    """Lets the cameras give pictures without depth."""
    take = bench.robot.image

    def without_depth(source):
        image = take(source)
        return replace(image, depth_m=np.zeros_like(image.depth_m))

    monkeypatch.setattr(bench.robot, "image", without_depth)


class LateAnswer:
    """Answer to a question or a remark at a time; keeps what was asked."""

    def __init__(self, clock, answer, at_s):
        self.clock, self.answer, self.at_s, self.question, self.withdrawn = clock, answer, at_s, None, False

    def __call__(self, question):
        self.question = question
        return self

    def done(self):
        return self.clock.now() >= self.at_s

    def result(self):
        return self.answer

    def withdraw(self):
        self.withdrawn = True


@dataclass
class PeopleDetector(Detector):
    """Sees each of `people` who is among the boxes of the bench's robot, by true geometry and through walls."""

    bench: Bench
    people: list[Box]
    score: float = 0.9
    class_names: tuple[str, ...] = ("cube", "person")
    pictures: list[int] = field(default_factory=list)

    def detect(self, pictures):
        self.pictures.append(len(pictures))
        found = [self._seen(one) for one in self.people if one in self.bench.robot.blocks]
        return [tuple(one for one in found if one is not None) for _ in pictures]

    def _seen(self, person):
        corners = np.array(list(product((person.x0, person.x1), (person.y0, person.y1), (0, 1.7))))
        p_C = (self.bench.robot.pose.transform(BODY_HEIGHT_M) @ X_BC).inverse().multiply(corners.T)
        if np.any(p_C[2] < 0.2):
            return None
        u, v = p_C[0] / p_C[2] * LENS.fx + LENS.cx, p_C[1] / p_C[2] * LENS.fy + LENS.cy
        box = (max(0.0, u.min()), max(0.0, v.min()), min(LENS.width, u.max()), min(LENS.height, v.max()))
        whole = box[2] - box[0] > 2.0 and box[3] - box[1] > 4.0
        return Detection("person", self.score, tuple(float(value) for value in box)) if whole else None
