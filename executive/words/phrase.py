"""Objects and spots with relations, as a mission file writes them: `{name: hammer, next_to: wrench}`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag

from executive.words.command import landmark_text, parse_landmark, related, split_relations
from skills.inputs.schema import Strict, Text
from skills.quantities import QuantityError
from skills.relations import PARTS, Nth, Relation, RelationKind


class Order(Strict):
    """Number of an object in a row or by its size, among the objects of its kind."""

    nth: Nth = Field(default=1, description="The number, counted from 1.")
    from_: Annotated[
        Literal["left", "right", "biggest", "smallest"],
        Field(alias="from", description="Where the count begins."),
    ]


class _Related(Strict):
    """Relations to landmarks: objects on the same surface, surfaces, places and people."""

    subject: ClassVar[str]
    next_to: Text | None = Field(default=None, description="A landmark at most 20 cm away.")
    left_of: Text | None = Field(default=None, description="A landmark; it is on its left.")
    right_of: Text | None = Field(default=None, description="A landmark; it is on its right.")
    behind: Text | None = Field(default=None, description="A landmark; it is behind it.")
    in_front_of: Text | None = Field(default=None, description="A landmark; it is before it.")
    between: tuple[Text, Text] | None = Field(default=None, description="Two landmarks; it is between them.")
    part: Literal["middle", "edge", "left half", "right half", "front half", "back half"] | None = Field(
        default=None, description="The part of the surface."
    )
    seen_from: Text | None = Field(
        default=None, description="The person who sees left and right; by default the robot before the surface."
    )

    @classmethod
    def of(cls, text: str) -> Self:
        """Converts the text of an object or a place with relations."""
        subject, relations = split_relations(text)
        values: dict[str, Any] = {cls.subject: subject}
        for each in relations:
            name = each.kind.name.lower()
            landmarks = tuple(landmark_text(one).removeprefix("the ") for one in each.landmarks)
            if landmarks:
                values[name] = landmarks if len(landmarks) > 1 else landmarks[0]
            elif each.kind in PARTS:
                values["part"] = name.replace("_", " ")
            else:
                values["order"] = {"nth": each.nth, "from": name}
        return cls.model_validate(values)

    def __str__(self) -> str:
        """Text of the object or place. Raises ValueError for a landmark that cannot be parsed."""
        found = []
        for name in type(self).model_fields:
            value, kind = getattr(self, name), RelationKind.__members__.get(name.upper())
            if kind is not None and value is not None:
                landmarks = (value,) if isinstance(value, str) else value
                found.append(Relation(kind, tuple(map(parse_landmark, landmarks))))
            elif name == "part" and value:
                found.append(Relation(RelationKind[value.upper().replace(" ", "_")]))
            elif name == "order" and value:
                found.append(Relation(RelationKind[value.from_.upper()], nth=value.nth))
        return related(getattr(self, self.subject), tuple(found))


class ObjectPhrase(_Related):
    """Object with the relations that say which one is meant."""

    subject = "name"
    name: Text = Field(description="The object; a number or attributes may stand before its name.")
    nearest_to: Text | None = Field(default=None, description='A landmark; it is the nearest. "robot": to the robot.')
    order: Order | None = Field(default=None, description="Its number in a row or by size.")
    not_at: Text | None = Field(default=None, description="A surface or a room from which it is not to be taken.")


class SpotPhrase(_Related):
    """Spot on a surface."""

    subject = "surface"
    surface: Text = Field(description="The surface on which to put the object.")


def _plain(text: str) -> str:
    """Accepts a text without relations. Raises QuantityError for other texts."""
    if split_relations(text)[1]:
        raise QuantityError("should be a mapping, since it has relations", "write {name: hammer, next_to: wrench}")
    return text


def _named_goal(value: object) -> object:
    """Accepts the name of a goal. Raises QuantityError for a pose, with the skill that takes one as a hint."""
    if isinstance(value, list) or (isinstance(value, dict) and {"x", "y"} & value.keys()):
        hint = "for a pose write 'skill: navigate' with 'with: {x: 1.0, y: 2.0, yaw: 1.57}', in metres and radians"
        raise QuantityError("should be the name of a place or person", hint)
    return value


_PlainText = Annotated[Text, AfterValidator(_plain), Tag("text")]
_FORM: Final = Discriminator(lambda value: "mapping" if isinstance(value, dict | _Related) else "text")
ObjectWords = Annotated[_PlainText | Annotated[ObjectPhrase, Tag("mapping")], _FORM]
"""Object in words, or as a mapping with relations."""
Goal = Annotated[_PlainText | Annotated[SpotPhrase, Tag("mapping")], _FORM, BeforeValidator(_named_goal)]
"""Place or person in words, or as a mapping a spot on a surface."""


def written(parts: Mapping[str, str]) -> dict[str, Any]:
    """Parts of a command as a mission file writes them; see `parts_of_command`."""
    models: Mapping[str, type[_Related]] = {"take": ObjectPhrase, "object": ObjectPhrase, "to": SpotPhrase}
    has_relations = {key for key in models.keys() & parts.keys() if split_relations(parts[key])[1]}
    return {key: models[key].of(text) if key in has_relations else text for key, text in parts.items()}
