"""Task read: a look at a seven-segment display, and the number on it, spoken."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import cv2
import numpy as np
from pydrake.math import RigidTransform

from executive.tree.board import FromBoard
from executive.tree.goals import went_goal
from executive.tree.node import NodeSpec
from executive.tree.nodes.command_plans import go_to_goal
from executive.tree.plan import PlanBuilder
from executive.tree.task_page import TaskPage
from executive.words.command import Command
from executive.words.goal import GoalCondition, GoalKind
from executive.words.knowledge import Knowledge
from executive.words.task import Part
from skills.api import Cause, Succeeded
from skills.manipulation.arm.looking_skill import LookingSkill
from skills.quantities import Coordinate, Height
from skills.robot import FloatArray, Image
from skills.routine import Routine, SkillFailure

WIDTH, PITCH, STROKE = 0.55, 0.8, 0.14
"""Width of a digit, distance from one to the next, and stroke, as shares of the digit's height."""
MIDDLES = {
    "a": (0.5 * WIDTH, 0.5 * STROKE),
    "b": (WIDTH - 0.5 * STROKE, 0.28),
    "c": (WIDTH - 0.5 * STROKE, 0.72),
    "d": (0.5 * WIDTH, 1.0 - 0.5 * STROKE),
    "e": (0.5 * STROKE, 0.72),
    "f": (0.5 * STROKE, 0.28),
    "g": (0.5 * WIDTH, 0.5),
}
"""Middles of the segments, from the left and from the top, as shares of the digit's height."""
LIT = ("abcdef", "bc", "abged", "abgcd", "fgbc", "afgcd", "afgecd", "abc", "abcdefg", "abcdfg")
DIGITS = {frozenset(lit): str(digit) for digit, lit in enumerate(LIT)}
PX_PER_M, PATCH_M, NEAR_M, HIDES_M, FEWEST_POINTS = 1000, (0.36, 0.26), 0.05, 0.03, 50
FACE_M, DIGIT_M, LEAST_CONTRAST = (0.08, 0.05), (0.02, 0.12), 40.0
ON, OFF = 0.7, 0.25
"""Share of bright pixels in the middle of a segment from which on it is on, and up to which it is off."""
VIEWS = (((0.15, 0.0), (0.3, 0.1), (0.0, 0.1)), ((-0.25, 0.15), (-0.35, 0.0), (0.4, 0.2)))
"""Directions of the two views: turn about the display and elevation (rad), the best first."""
FAR_M = 0.45


def read_number(image: Image, X_WC: RigidTransform, p_WT: FloatArray) -> str | None:
    """Number on the display at a point (3,) of the world; None when the picture does not show it for certain."""
    patch = face(image, X_WC, p_WT)
    if patch is None:
        return None
    if np.ptp(np.percentile(patch, (2, 98))) < LEAST_CONTRAST:
        return None
    dark = cv2.threshold(patch, 0, 255, cv2.THRESH_BINARY_INV + cv2.THRESH_OTSU)[1]
    body = max(cv2.findContours(dark, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0], key=cv2.contourArea)
    left, top, width, height = cv2.boundingRect(body)
    whole = left > 0 and top > 0 and left + width < patch.shape[1] and top + height < patch.shape[0]
    if not whole or width < FACE_M[0] * PX_PER_M or height < FACE_M[1] * PX_PER_M:
        return None
    inside = cv2.drawContours(np.zeros_like(dark), [body], -1, 255, cv2.FILLED)
    return digits((inside > 0) & (dark == 0))


def face(image: Image, X_WC: RigidTransform, p_WT: FloatArray) -> np.ndarray | None:
    """Brightness of the surface about a point, upright, from its front; None without one, or if something hides it."""
    lens, depth_m = image.depth_intrinsics, image.depth_m
    v, u = np.nonzero(depth_m)
    rays = np.column_stack([(u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, np.ones(len(u))])
    points_W = (rays * depth_m[v, u, None]) @ X_WC.rotation().matrix().T + X_WC.translation()
    away_m = np.linalg.norm(points_W - p_WT, axis=1)
    near_W, around_W = points_W[away_m < NEAR_M], points_W[away_m < PATCH_M[0] / 2]
    if len(near_W) < FEWEST_POINTS:
        return None
    middle_W = near_W.mean(axis=0)
    normal = np.linalg.svd(near_W - middle_W, full_matrices=False)[2][2]
    normal *= np.sign(normal @ (X_WC.translation() - middle_W))
    if np.count_nonzero((around_W - middle_W) @ normal > HIDES_M) > FEWEST_POINTS:
        return None
    up = np.array([0.0, 0.0, 1.0]) - normal[2] * normal
    if np.linalg.norm(up) < 0.5:
        return None
    up /= np.linalg.norm(up)
    right = np.cross(up, normal)
    p_WT = p_WT + normal * (normal @ (middle_W - p_WT))
    half_m = np.array(PATCH_M) / 2
    corners_W = [p_WT + x * half_m[0] * right + y * half_m[1] * up for x, y in ((-1, 1), (1, 1), (1, -1), (-1, -1))]
    corners_C = [X_WC.inverse() @ corner_W for corner_W in corners_W]
    lens, size = image.intrinsics, (int(PATCH_M[0] * PX_PER_M), int(PATCH_M[1] * PX_PER_M))
    if min(z for _, _, z in corners_C) < 0.05:
        return None
    seen = np.float32([(lens.fx * x / z + lens.cx, lens.fy * y / z + lens.cy) for x, y, z in corners_C])
    flat = np.float32([(0, 0), (size[0], 0), size, (0, size[1])])
    picture = image.grey if image.colour is None else image.colour.max(axis=2)
    return cv2.warpPerspective(picture, cv2.getPerspectiveTransform(seen, flat), size)


def digits(lit: np.ndarray) -> str | None:
    """Digits of the bright pixels on a display, from the right; None when one of them is not certain."""
    rows, columns = np.flatnonzero(lit.sum(axis=1) > 2), np.flatnonzero(lit.sum(axis=0) > 2)
    if not rows.size or not columns.size:
        return None
    top, high = rows[0], rows[-1] + 1 - rows[0]
    if not DIGIT_M[0] * PX_PER_M < high < DIGIT_M[1] * PX_PER_M:
        return None
    read, left = "", columns[-1] + 1 - WIDTH * high
    while left + WIDTH * high > columns[0] + STROKE * high / 2:
        shares = {each: share_of(lit, left + x * high, top + y * high, high) for each, (x, y) in MIDDLES.items()}
        if any(OFF < share < ON for share in shares.values()):
            return None
        digit = DIGITS.get(frozenset(each for each, share in shares.items() if share >= ON))
        if digit is None:
            return None
        read, left = digit + read, left - PITCH * high
    return read


def share_of(lit: np.ndarray, x: float, y: float, high: float) -> float:
    """Share of bright pixels in a square in the middle of a segment."""
    half = max(1, round(0.3 * STROKE * high))
    window = lit[max(0, round(y) - half) : round(y) + half + 1, max(0, round(x) - half) : max(0, round(x) + half + 1)]
    return float(window.mean()) if window.size else 0.0


@dataclass(frozen=True)
class ReadDisplayInputs:
    """Middle of a display in the world, and its name."""

    point_W: tuple[Coordinate, Coordinate, Height]
    of: str


class ReadDisplay(LookingSkill[ReadDisplayInputs]):
    """Reads the number on a display from two views, which must agree. Does not drive."""

    name = "read_display"
    needs_camera = True
    Inputs = ReadDisplayInputs
    outputs: ClassVar[Mapping[str, type]] = {"text": str}
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PLANNING: "the arm reaches no view of the display",
        Cause.EXECUTION: "the arm did not reach its view, or the camera shows nothing",
        Cause.POSTCONDITION: "the two views do not show the same number for certain",
    }
    default_timeout_s = 60.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 1.0, "joints": 0.5, "gripper": 0.5}

    def run(self, inputs: ReadDisplayInputs) -> Routine[Succeeded]:
        """Looks from both sides."""
        message, found = f"reading {inputs.of}", list[str | None]()
        for turns in VIEWS:
            p_BT = self.X_WB().inverse() @ np.array(inputs.point_W)
            yield from self.look_at(p_BT, list(self._viewpoints(p_BT, turns)), message)
            image = yield from self.picture(message)
            X_WC = self.context.localiser.estimate().X_WO @ image.frames.pose(image.camera_frame)
            found.append(read_number(image, X_WC, np.array(inputs.point_W)))
            self.context.show_picture(image.grey if image.colour is None else image.colour, f"{inputs.of}: {found[-1]}")
        if found[0] is None or found[0] != found[1]:
            seen = " and ".join("no certain number" if each is None else each for each in found)
            raise SkillFailure(Cause.POSTCONDITION, f"two views of {inputs.of} show {seen}")
        shows = f"{inputs.of} shows {found[0]}"
        self.context.publish("answer", {"question": f"{inputs.of}'s number", "answer": found[0], "message": shows})
        return Succeeded(shows, {"text": shows})

    def _viewpoints(self, p_BT: FloatArray, turns: tuple[tuple[float, float], ...]) -> Iterator[FloatArray]:
        """Yields positions of the camera before the display, on the side of the shoulder."""
        x, y = (self.p_BS - p_BT)[:2]
        for turn_rad, rise_rad in turns:
            yaw_rad = np.arctan2(y, x) + turn_rad
            level = np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0]) * np.cos(rise_rad)
            yield p_BT + FAR_M * (level + [0.0, 0.0, np.sin(rise_rad)])


class ReadNumber(TaskPage):
    """Reads the number on the display at a place."""

    made: ClassVar[Mapping[str, str]] = {"meter": "407"}
    """What the display at each place was made with, for the judge alone."""
    word, answers = "read", True
    goal_is, needs_goal = Part.PLACE, True
    sentences = (
        {"template": "read [the number (of|on|at)] [{place:goal}]", "samples": ["read the number of the desk"]},
    )

    def plan(self, builder: PlanBuilder) -> NodeSpec:
        """Plans going there, the look, and the answer."""
        place, key = builder.place(str(builder.command.goal)), builder.key("text")
        point_W = builder.knowledge.places[place].shows if place in builder.knowledge.places else None
        if point_W is None:
            raise builder.error(f"no display is known at the {place}", "name the point that a picture from there shows")
        look = builder.skill("read_display", {"point_W": point_W, "of": f"the {place}"}, {"text": key})
        look = builder.at("tidy").stow_after(look)
        return builder.sequence("read", go_to_goal(builder), look, builder.skill("speak", {"text": FromBoard(key)}))

    def promise(self, command: Command, knowledge: Knowledge, elsewhere: tuple[str, ...]) -> GoalCondition:
        """What `judge` judges, of the place."""
        return replace(went_goal(command, knowledge), kind=GoalKind.OWN, task=self.word)

    def judge(self, condition: GoalCondition, truth: Any) -> tuple[bool, str]:
        """Compares what the robot said with the number that the display was made with."""
        place = condition.goal[0].name
        right = f"the {place} shows {self.made[place]}"
        return right in condition.said, f"it said {list(condition.said)}, and {right}."
