"""Descriptions of people by pose, gesture or colour of clothes, as a command names them: "waving person"."""

import re
from typing import Final

from errand_people.looks import KINDS_NOTE, Appearance, Colour, Gesture, Pose, gesture_text
from skills.world_model import PERSON

_PEOPLE: Final = r"(?:persons?|people|guests?|visitors?|somebody|someone)"
_POSE: Final = r"(?P<pose>sitting|standing|lying|seated)"
_GESTURE: Final = (
    r"(?P<waving>waving)"
    r"|(?:raising|with|who raises?) (?:their|his|her|the|a) (?P<arm>left|right) (?:arm|hand)(?: raised)?"
    r"|pointing (?:to|towards) (?:the|their) (?P<points>left|right)"
)
_CLOTHES: Final = (
    r"(?:wearing|dressed in|in|with) (?:a |an |the )?(?P<colour>red|orange|yellow|green|blue|white|gr[ae]y|black)"
    r"(?: (?P<clothes>clothes|t[ -]?shirts?|shirts?|blouses?|sweaters?|coats?|jackets?|tops?))?"
)
_FIRST: Final = re.compile(rf"(?P<first>waving|sitting|standing|lying|seated) {_PEOPLE}", re.IGNORECASE)
_BEHIND: Final = re.compile(
    rf"{_PEOPLE}(?:(?: (?:who|that) (?:is|are))? (?:(?:{_POSE})|{_GESTURE}|{_CLOTHES}))?", re.IGNORECASE
)
_PLAIN_WORDS: Final = {"seated": "sitting", "gray": "grey"}


def appearance_of(words: str) -> Appearance | None:
    """Reads a description without its article, in the singular or the plural; None for other words."""
    if (first := _FIRST.fullmatch(words)) is not None:
        return _appearance(first["first"].lower())
    if (behind := _BEHIND.fullmatch(words)) is None:
        return None
    if behind["colour"]:
        return _appearance(behind["colour"].lower())
    if behind["arm"]:
        return _appearance(f"raising_{behind['arm'].lower()}_arm")
    if behind["points"]:
        return _appearance(f"pointing_{behind['points'].lower()}")
    return _appearance((behind["waving"] or behind["pose"] or "").lower())


def _appearance(trait: str) -> Appearance:
    trait = _PLAIN_WORDS.get(trait, trait)
    if trait in [*Colour]:
        return Appearance(clothes_colour=Colour(trait))
    if trait in [*Pose]:
        return Appearance(pose=Pose(trait))
    return Appearance(gesture=Gesture(trait)) if trait else Appearance()


def kind_of_clothing(words: str) -> str:
    """Kind of clothing in a description, such as "t shirts", which the robot does not tell apart; or empty."""
    behind = _BEHIND.fullmatch(words)
    kind = "" if behind is None or behind["clothes"] is None else str(behind["clothes"])
    return "" if kind == "clothes" else kind


def clothing_note(words: str) -> str:
    """Note that the colour decides, for a description that names a kind of clothing; or empty."""
    return f"{KINDS_NOTE}; in '{words}' the colour decides" if kind_of_clothing(words) else ""


def description(appearance: Appearance) -> str:
    """Description in the singular, as it stands in a command: "person raising their left arm"."""
    pose, gesture, colour = appearance.pose, appearance.gesture, appearance.clothes_colour
    if pose is not None or gesture == "waving":
        return f"{pose or gesture} {PERSON}"
    if gesture is not None:
        return f"{PERSON} {gesture_text(gesture).replace('raising the', 'raising their')}"
    return PERSON if colour is None else f"{PERSON} wearing {colour}"


def plural_description(appearance: Appearance) -> str:
    """Description in the plural: "people raising their left arm"."""
    return description(appearance).replace(PERSON, "people")
