"""Predicts the object in the gripper during a mission in which all commands succeed."""

from dataclasses import dataclass
from typing import Final

from executive.words.command import Command
from executive.words.knowledge import Knowledge
from skills.api import ObjectKind


@dataclass(frozen=True)
class InGripper:
    """Object in the gripper.

    `kind` is None if only the object's presence is known; if not `sure`, the gripper may also be empty. `perhaps` are
    the candidates, if they are known.
    """

    kind: ObjectKind | None = None
    sure: bool = True
    perhaps: tuple[ObjectKind, ...] = ()

    def __str__(self) -> str:
        return "an object" if self.kind is None else f"the {self.kind}"


UNNAMED: Final = InGripper()
UNSURE: Final = InGripper(sure=False)
"""Gripper behind a branch that may have been taken or not."""


def held_after_either(*held: InGripper | None) -> InGripper:
    """Object in the gripper after one of several branches: it may be any of these objects, or none."""
    kinds: list[ObjectKind] = []
    for each in held:
        if each is not None and each.kind is None and not each.perhaps:
            return UNSURE
        kinds += () if each is None else each.perhaps or filter(None, (each.kind,))
    return InGripper(sure=False, perhaps=tuple(dict.fromkeys(kinds)))


def held_after(command: Command, held: InGripper | None, knowledge: Knowledge) -> InGripper | None:
    """Object in the gripper after a command that succeeded; None if the gripper is empty."""
    if command.takes:
        return held if is_same(held, command.object, knowledge) else InGripper(command.object)
    return held if command.carried is None else None


def is_same(held: InGripper | None, item: ObjectKind | None, knowledge: Knowledge) -> bool:
    """Returns whether the held object, or each candidate for it, is of the kind `item`."""
    if held is None:
        return False
    return all(_fits(one, item, knowledge) for one in map(InGripper, held.perhaps or (held.kind,)))


def objection(command: Command, held: InGripper | None, knowledge: Knowledge) -> tuple[str, str] | None:
    """Reason why a command is impossible with this object in the gripper, and a hint; None if it is possible."""
    if command.takes:
        if held is None or not held.sure or is_same(held, command.object, knowledge):
            return None
        return grasp_objection(held, f"the {command.object}")
    carried = command.carried
    if carried is None:
        return None
    if held is None:
        return f"the {carried} is not in the gripper: no step before has grasped it", f"grasp the {carried} first"
    if not _fits(held, carried, knowledge):
        return f"the gripper holds {held} then, not the {carried}", f"put {held} down, then grasp the {carried}"
    return None


def grasp_objection(held: InGripper, what: str) -> tuple[str, str]:
    """Reason why nothing else can be grasped while an object is held, and a hint."""
    return f"{what} cannot be grasped: the gripper holds {held} then", f"put {held} down before"


def _fits(held: InGripper, item: ObjectKind | None, knowledge: Knowledge) -> bool:
    """Returns whether the held object is certainly of the kind `item`; an object of unknown kind is accepted."""
    if held.kind is None or item is None:
        return True
    of_held, asked = (set(knowledge.classes(knowledge.object_name(one.name) or one.name)) for one in (held.kind, item))
    said, asked_for = ({*each.attributes, *each.relations} for each in (held.kind, item))
    return of_held <= asked and asked_for <= said
