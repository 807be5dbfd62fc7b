"""Compares the names in a command with a world's: finds unknown names, and replaces aliases."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from executive.words.command import START, Command
from executive.words.knowledge import EVERYTHING, Knowledge
from executive.words.task import Part
from skills.api import ObjectKind
from skills.inputs.errors import listing, suggestion
from skills.relations import DOOR, ROBOT, Landmark, Relation, RelationKind


def unknown_names(command: Command, knowledge: Knowledge) -> Iterator[tuple[str, str, str]]:
    """Yields each name that the world does not have: the command's key, a sentence and a hint."""

    def unknown(kind: str, name: str, known: Sequence[str]) -> tuple[str, str]:
        return f"unknown {kind} {name!r}", suggestion(name, knowledge.spellings(known), shown=known)

    own = command.task is not None and command.task.object_is not in (Part.THING, Part.NOTHING)
    yield from _wrong_with_task(command, knowledge)
    for key, item in (("take", command.item), ("object", None if own else command.object)):
        person = command.looks and item is not None and knowledge.somebody(item.name) is not None
        if item is not None and knowledge.object_name(item.name) is None and not person:
            yield key, *unknown("object", item.name, knowledge.object_names())
    goals = (*knowledge.place_names(), *knowledge.people, START)
    if command.goal is not None and _goal(command.goal, knowledge) is None:
        yield "to", *unknown("place or person", command.goal, goals)
    if command.goal_at is not None and knowledge.place(command.goal_at) is None:
        yield "to", *unknown("place", command.goal_at, knowledge.place_names())
    yield from _wrong_relations(command, knowledge)


def _wrong_relations(command: Command, knowledge: Knowledge) -> Iterator[tuple[str, str, str]]:
    """Yields the faults in a command's relations: the command's key, a sentence and a hint."""
    objects = {"take": command.item, "object": command.object}
    for key, item in objects.items():
        if item and item.relations and (knowledge.somebody(item.name) or item.name == EVERYTHING):
            yield key, f"it cannot tell who or what is {item.relations[0]}", "name one kind of object"
    if command.goal_relations and command.item is None and not command.puts:
        yield "to", f"nothing is put down {command.goal_relations[0]}", "say what to put there under 'take'"
    if any(each.kind is RelationKind.NOT_AT for each in command.goal_relations):
        yield "to", f"a spot is not {command.goal_relations[0]}", "name the surface on which to put it"
    if command.goal_relations and knowledge.place(str(command.goal)) not in knowledge.surfaces:
        hint = f"name one of {listing(knowledge.surfaces, last='or')}" if knowledge.surfaces else "this world has none"
        yield "to", f"'{command.goal}' is no surface, and the spot is {command.goal_relations[0]}", hint
    landmarks = (*knowledge.object_names(), *knowledge.place_names(), *knowledge.people, ROBOT, DOOR)
    related = {key: () if item is None else item.relations for key, item in objects.items()}
    places, people = ("place", knowledge.place_names()), ("person", tuple(knowledge.people))
    own = {RelationKind.SEEN_FROM: people, RelationKind.NOT_AT: places}
    for key, relations in {**related, "to": command.goal_relations}.items():
        for relation in relations:
            what, known = own.get(relation.kind, ("landmark", landmarks))
            for name in (each.name for each in relation.landmarks if _landmark(each.name, knowledge) not in known):
                yield key, f"unknown {what} {name!r}", suggestion(name, knowledge.spellings(known), shown=known)


def _wrong_with_task(command: Command, knowledge: Knowledge) -> Iterator[tuple[str, str, str]]:
    """Yields what a command's task does not allow: the command's key, a sentence and a hint."""
    whom, task = command.object, command.task
    if task is None:
        return
    parts = {"to": (command.goal, task.goal_is), "object": (whom and str(whom), task.object_is)}
    for key, (name, kind) in parts.items():
        known = () if (key, kind) == ("to", Part.PLACE) else knowledge.named(kind)
        if known and name and (key, name) != ("to", START) and (_goal(name, knowledge) or name) not in known:
            yield key, f"unknown {kind.value} {name!r}", suggestion(name, knowledge.spellings(known), shown=known)
    if whom is not None and task.object_is in (Part.TIME, Part.NUMBER) and command.amount is None:
        yield "object", f"'{whom}' is no {task.object_is.value}", 'write it in digits, as in "3" or "10 second"'
    if command.item is not None and task.item_is is Part.NOTHING:
        hint = "take it there in a step of its own"
        yield "take", f"the {command.item} cannot be taken along by '{task.word}'", hint
    if command.about_person and not task.several and command.object_count != 1:
        yield "object", f"it cannot {task.word} several people at a time", "name one person"
    if task.needs_goal and command.goal is None:
        what = task.word if whom is None else f"{task.word} {whom}"
        yield "do" if whom is None else "object", f"it is not said where to {what}", "name the place under 'to'"


def in_world_names(command: Command, knowledge: Knowledge) -> Command:
    """Replaces the names in a command by the world's own names."""

    def named(item: ObjectKind | None, kind: Part = Part.THING) -> ObjectKind | None:
        if item is None or kind in (Part.TEXT, Part.NUMBER):
            return item
        known = knowledge.object_name(item.name) or knowledge.somebody(item.name)
        known = knowledge.place(item.name) if kind in (Part.PLACE, Part.ROOM) else known
        return ObjectKind(known or item.name, item.attributes, related(item.relations))

    def related(relations: tuple[Relation, ...]) -> tuple[Relation, ...]:
        names = ([replace(one, name=_landmark(one.name, knowledge)) for one in each.landmarks] for each in relations)
        return tuple(replace(each, landmarks=tuple(own)) for each, own in zip(relations, names, strict=True))

    return Command(
        item=named(command.item),
        goal=command.goal and _goal(command.goal, knowledge),
        goal_at=command.goal_at and knowledge.place(command.goal_at),
        task=command.task,
        object=named(command.object, command.task.object_is if command.task else Part.THING),
        item_count=command.item_count,
        object_count=command.object_count,
        goal_relations=related(command.goal_relations),
    )


def _goal(name: str, knowledge: Knowledge) -> str | None:
    return START if name == START else knowledge.place(name) or knowledge.person(name)


def _landmark(name: str, knowledge: Knowledge) -> str:
    """World's own name of a landmark: an object, a place or a person; the same name when it is unknown."""
    return knowledge.object_name(name) or knowledge.place(name) or knowledge.person(name) or name


def in_world(relations: Sequence[Relation], knowledge: Knowledge, place: str | None) -> tuple[Relation, ...]:
    """Adds the classes of their objects, and the outlines of furniture, places and people, to relations at a place.

    What is not at a place is no relation on a surface: the search skips that place.
    Raises ValueError for a door of a room that does not have exactly one.
    """

    def grounded(landmark: Landmark) -> Landmark:
        name = _landmark(landmark.name, knowledge)
        if name == ROBOT:
            return landmark
        if classes := knowledge.classes(name):
            return replace(landmark, classes=classes)
        if name == DOOR:
            known = knowledge.place(place or "")
            room = None if known is None else knowledge.room(known)
            doors = [door.at for door in knowledge.doors if room in door.between]
            if len(doors) != 1:
                raise ValueError(f"it cannot be told which door is meant, since {room or 'no room'} has {len(doors)}")
            return replace(landmark, outline_W=tuple(doors))
        if name in knowledge.surfaces:
            return replace(landmark, outline_W=knowledge.surfaces[name].polygon)
        facts = knowledge.people.get(name)
        pose = (facts and facts.pose) or knowledge.place_pose(facts.at if facts else name)
        return replace(landmark, outline_W=((pose.x, pose.y),))

    there = (each for each in relations if each.kind is not RelationKind.NOT_AT)
    return tuple(replace(each, landmarks=tuple(map(grounded, each.landmarks))) for each in there)
