"""Whether the robot was called by its name, or somebody else by a name that was taken for it.

The recogniser is told the robot's name, and hears it readily for that ("Hey Oliver" -> Hey Alice). What it hears
without being told anything is another witness.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from typing import Final

from executive.speech.recogniser import Recognition

__all__ = ["opening_as_heard"]

_OTHER_OPENING: Final = 7.0
"""How many times e likelier another opening must be than the one with the name, neither being expected."""
_OTHER_WHOLE: Final = 10.0
"""The same for all that was said."""
_OPENING_WORDS: Final = 4


def opening_as_heard(recognition: Recognition, text: str, names: Collection[str], calls: Callable[[str], bool]) -> str:
    """The text, or what is heard when no names are expected, where that is much likelier and calls nobody.

    `calls` tells of a text whether it calls one of the robots `names`. First only the opening is exchanged, since the
    names behind it are better heard when they are expected. A text without any name among its first words stays.
    """
    words = text.split()
    bare = [re.sub(r"\W", "", word).lower() for word in words[:_OPENING_WORDS]]
    called = {name.lower() for name in names}
    at = next((number for number, word in enumerate(bare) if word in called), None)
    if at is None:
        return text
    unprompted = recognition.unprompted()
    if not unprompted or calls(unprompted):
        return text
    behind = at + 1
    exchanged = " ".join([*unprompted.split()[:behind], *words[behind:]])
    if exchanged == text:
        return text
    named, opening, whole = recognition.likelihoods([text, exchanged, unprompted])
    if opening - named > _OTHER_OPENING:
        return exchanged
    return unprompted if whole - named > _OTHER_WHOLE else text
