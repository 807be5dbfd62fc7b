"""Pictures of objects, surfaces, named poses and rooms, each reported as an answer of the mission."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Final

import numpy as np
from py_trees.common import Status

from executive.tree.assembly import Assembler, StepPlans
from executive.tree.behaviour import ExplainedDecorator
from executive.tree.board import FromBoard
from executive.tree.context import ANSWER_TOPIC
from executive.tree.goals import POSE_NEAR_M, square_region
from executive.tree.node import NodeSpec
from executive.tree.nodes.search import search_plan
from executive.tree.plan import Assembled, PlanBuilder, StepPart
from executive.words.command import parse_object
from executive.words.goal import GoalCondition, GoalKind, Region, When
from executive.words.knowledge import ANYTHING, EVERYTHING, Pose
from executive.words.leaf_steps import Picture, Subject
from skills.api import Publish
from skills.geometry import compose
from skills.inputs.errors import InputError, suggestion
from skills.robot import Pose2D

_TURNS_RAD: Final = (0.0, 0.5 * math.pi, math.pi, -0.5 * math.pi)
"""Headings of the pictures of a room, and turns of the body until a named camera sees a point."""
_AHEAD_M: Final = (2.5, 0.9)
"""Distance before the body, and height above the floor, of the point to which a camera looks that looks ahead."""
_ARM_M: Final = 0.9
"""Largest distance of the camera from the middle of the body."""
_MIDDLE_M: Final = 0.05
"""Half the side of the region around the point that a picture shows."""
_PICTURED: Final = GoalCondition(GoalKind.PICTURED, when=When.SOME_TIME)
Point = tuple[float, float, float]


class PictureTaken(ExplainedDecorator):
    """Decorator that reports the picture of its child as an answer.

    | child | status |
    |---|---|
    | SUCCESS | SUCCESS, and the answer is published under `ANSWER_TOPIC` |
    | other | the same |
    """

    kind = "picture taken"
    of: str
    publish: Publish

    def update(self) -> Status:
        """Reports the picture once it is taken."""
        status = self.pass_on()
        if status == Status.SUCCESS:
            note = {"question": f"A picture of {self.of}", "answer": "taken", "message": self.message}
            self.publish(ANSWER_TOPIC, {"node": self.path_id, **note})
        return status


def _picture_plan(_: Assembler, step: Picture, builder: PlanBuilder) -> Assembled:
    """Plans the pictures of what a step names, and their goal condition. Raises InputError for an unknown name."""
    knowledge, of, at = builder.knowledge, step.subject.of, step.subject.at
    place, item = knowledge.place(of), parse_object(of)
    if place is None and knowledge.object_name(item.name) in (None, ANYTHING, EVERYTHING):
        known = (*knowledge.place_names(), *knowledge.object_names())
        hint = suggestion(of, knowledge.spellings(known), shown=known)
        raise InputError.at(builder.source, f"unknown place or object '{of[:60]}'", hint=hint)
    subject = step.subject.model_copy(update={"of": place or of, "at": at and builder.place(at)})
    if place is None:
        node, goal = _of_object(builder, subject)
    elif place in knowledge.rooms:
        node, goal = _of_room(builder, subject, place)
    elif place in knowledge.surfaces:
        facts = knowledge.surfaces[place]
        point, at = (*np.mean(facts.polygon, axis=0).tolist(), facts.height), subject.at
        views = facts.viewpoints if at is None else (knowledge.place_pose(at),)
        node = _from_views(builder, subject, point, [each.pose_2d() for each in views], top=True)
        goal = _shows(place, point)
    else:
        pose, shows = knowledge.place_pose(subject.at or place), knowledge.places[place].shows
        point = shows or _ahead(pose.pose_2d())
        near = () if shows else (square_region(place, pose, POSE_NEAR_M + _ARM_M),)
        node = _from_views(builder, subject, point, (pose.pose_2d(),), ahead=shows is None)
        goal = replace(_shows(place, point), source=near)
    node = builder.at("tidy").stow_after(node)
    return Assembled((node,), (StepPart(builder.path_id, goal=goal, node=node.path_id),))


def _of_object(builder: PlanBuilder, subject: Subject) -> tuple[NodeSpec, GoalCondition]:
    """Finds an object, goes to the place from which the picture is wanted, if any, and takes the picture."""
    item, key, knowledge, at = parse_object(subject.of), builder.key("detection"), builder.knowledge, subject.at
    room = at and (at if knowledge.surfaces_in(at) else knowledge.room(at))
    steps = [search_plan(builder.at("find"), item, room, key, anywhere=at is None)]
    if at is not None and at not in knowledge.rooms:
        steps.append(builder.navigate(knowledge.place_pose(at).pose_2d(), f"the {at}", exactly=True))
    node = builder.sequence(f"a picture of the {item}", *steps, _shot(builder, subject, object=FromBoard(key)))
    return node, replace(_PICTURED, classes=builder.classes(item.name), wanted=item.name)


def _of_room(builder: PlanBuilder, subject: Subject, room: str) -> tuple[NodeSpec, GoalCondition]:
    """Takes a picture in each of four directions, from the pose of the room or another place."""
    at, views = subject.at or room, list[NodeSpec]()
    for number, turn_rad in enumerate(_TURNS_RAD, start=1):
        view = compose(builder.knowledge.place_pose(at).pose_2d(), Pose2D(0.0, 0.0, turn_rad))
        title, below = f"{room} ({number} of {len(_TURNS_RAD)})", builder.at(f"view-{number}")
        views.append(
            _from_views(below, subject.model_copy(update={"at": at}), _ahead(view), (view,), title, ahead=True)
        )
    outline = Region(room, builder.knowledge.rooms[builder.knowledge.room(at)])
    return builder.sequence(f"look around in the {room}", *views), replace(_PICTURED, source=(outline,), count=4)


def _from_views(
    builder: PlanBuilder, subject: Subject, point_W: Point, views: Sequence[Pose2D], title: str = "", **kind: bool
) -> NodeSpec:
    """Takes a picture of a point from the first of some poses that can be reached and sees it.

    At each pose the body turns until a named camera sees the point. A picture with a title needs no exact pose. `kind`
    is what the point is, as inputs of the skill.
    """
    what, nodes = title or subject.of, list[NodeSpec]()
    for number, (view, turn_rad) in enumerate(product(views, _TURNS_RAD if subject.camera else (0.0,)), start=1):
        below, pose = builder.at(f"view-{number}"), compose(view, Pose2D(0.0, 0.0, turn_rad))
        drive = below.navigate(pose, f"the {subject.at or subject.of}", exactly=not title)
        shot = _shot(below, subject, title, point_W=point_W, **kind)
        nodes.append(below.sequence(f"take a picture of the {what}{f', view {number}' * (number > 1)}", drive, shot))
    return builder.first_of(f"a picture of the {what}", *nodes) if len(nodes) > 1 else nodes[0]


def _shot(builder: PlanBuilder, subject: Subject, title: str = "", **ports: object) -> NodeSpec:
    """Takes one picture from the robot's present pose, and reports it."""
    of = f"the {title or subject.of}"
    taking = builder.skill("take_picture", {"of": of, "camera": subject.camera or "", **ports})
    return builder.node(PictureTaken.kind, f"a picture of {of}", taking, part="picture", of=of)


def _ahead(pose: Pose2D) -> Point:
    """Point before the body of a robot at a pose."""
    there = compose(pose, Pose2D(_AHEAD_M[0], 0.0, 0.0))
    return there.x_m, there.y_m, _AHEAD_M[1]


def _shows(name: str, point_W: Point) -> GoalCondition:
    """Goal condition that a picture shows a point."""
    x, y, z = point_W
    outline = square_region(name, Pose(x=x, y=y), _MIDDLE_M)
    return replace(_PICTURED, goal=(replace(outline, z_min_m=z - _MIDDLE_M, z_max_m=z + _MIDDLE_M),))


PLANS: Final[StepPlans] = {Picture: _picture_plan}
