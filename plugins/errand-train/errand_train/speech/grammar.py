"""Sentences to train the recogniser with: requests to a robot and talk beside it, over a wide vocabulary."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from executive.speech.recogniser import Vocabulary
from skills.inputs.yaml_source import read_yaml

__all__ = ["Grammar", "TrainingSentence", "load_grammar"]

_KINDS: Final = ("thing", "room", "surface", "person", "robot", "adjective")
_FILES: Final = ("words.yaml", "forms.yaml")
_NAMES: Final = frozenset({"thing", "room", "surface", "person"})
_ASKS: Final = re.compile(
    r"(?:.*, )?(could|can|would|will|where|what are|when|why|how|have|has|did|do|is|shall)\b", re.IGNORECASE
)
_KEPT_ONE_IN: Final = 10
_DEEPEST: Final = 12
_PART: Final = re.compile(r"<(\w+)>|\[([^\[\]]*)\]|\(([^()\[\]]*)\)")
_CALLED: Final = 0.75
_SAID: Final = 0.22
_POLITE: Final = 0.4
_TOLD_IN_PASSING: Final = 0.25
_TOLD: Final = 0.85
"""Share of the sentences whose prompt holds their names, among others."""
_FEWEST_OTHERS, _MOST_OTHERS = 3, 40


@dataclass(frozen=True)
class TrainingSentence:
    """A sentence as the recogniser writes it, and the vocabulary of its prompt."""

    text: str
    vocabulary: Vocabulary


class Grammar:
    """Grammar of sentences. `words` are the words of each kind, `forms` the patterns for them."""

    def __init__(self, words: Mapping[str, Sequence[str]], forms: Mapping[str, Sequence[str]]) -> None:
        self._words, self._forms = words, forms

    def sentence(self, draw: random.Random) -> TrainingSentence:
        """Draws one sentence with its prompt."""
        names = list[str]()
        robot = draw.choice(self._words["robot"])
        if draw.random() < _SAID:
            text = self._expanded(draw.choice(self._forms["said"]), draw, names)
        else:
            call = draw.choice(self._forms["call"]).replace("<robot>", robot) if draw.random() < _CALLED else ""
            text = call + self._expanded(self._asked(draw), draw, names)
        robot_name = robot if robot in text or draw.random() < 0.5 else None
        return TrainingSentence(_written(text), Vocabulary(self._told(names, robot_name, draw), robot_name))

    def _asked(self, draw: random.Random) -> str:
        """The pattern of a request, some of them with words of politeness."""
        if draw.random() < _TOLD_IN_PASSING:
            return draw.choice(self._forms["told"])
        polite = draw.choice(self._forms["polite"]) if draw.random() < _POLITE else ""
        return f"{polite}{draw.choice(self._forms['request'])}"

    def _told(self, names: Sequence[str], robot_name: str | None, draw: random.Random) -> tuple[str, ...]:
        """The names of the sentence among others; now and then others only, or none."""
        if draw.random() > _TOLD:
            names = ()
            if draw.random() < 0.4:
                return ()
        others = draw.randint(_FEWEST_OTHERS, _MOST_OTHERS)
        kinds = [draw.choice(("thing", "room", "surface", "person")) for _ in range(others)]
        told = [*names, *(draw.choice(self._words[kind]) for kind in kinds)]
        draw.shuffle(told)
        return tuple(dict.fromkeys([*told, *([robot_name] if robot_name else [])]))

    def _expanded(self, pattern: str, draw: random.Random, names: list[str], depth: int = 0) -> str:
        """The pattern with words in the place of its parts; their names are added to `names`."""
        while (part := _PART.search(pattern)) is not None and depth < _DEEPEST:
            kind, optional, choices = part.groups()
            if kind is not None:
                new = self._word(kind, draw, names, depth)
            elif optional is not None:
                new = optional if draw.random() < 0.5 else ""
            else:
                new = draw.choice(choices.split("|"))
            pattern = pattern[: part.start()] + new + pattern[part.end() :]
        return pattern

    def _word(self, kind: str, draw: random.Random, names: list[str], depth: int) -> str:
        """A word of that kind, or a whole phrase of that form."""
        if kind in self._forms:
            return self._expanded(draw.choice(self._forms[kind]), draw, names, depth + 1)
        word = draw.choice(self._words[kind.removesuffix("s") if kind == "things" else kind])
        if kind.removesuffix("s") in _NAMES:
            names.append(word)
        return _plural(word) if kind == "things" else word


def load_grammar(*, validation: bool = False) -> Grammar:
    """Loads the grammar of `words.yaml` and `forms.yaml`; validation has other words."""
    words, forms = (read_yaml(Path(__file__).with_name(name)).data for name in _FILES)
    return Grammar({kind: tuple(_kept(words[kind], validation=validation)) for kind in _KINDS}, forms)


def _kept(words: Sequence[str], *, validation: bool) -> Iterator[str]:
    """Every tenth word for validation, the others for training."""
    return (word for number, word in enumerate(words) if (number % _KEPT_ONE_IN == 0) == validation)


def _plural(word: str) -> str:
    head, *rest = word.split(" of ")
    if head.endswith("s"):
        return word
    if re.search(r"[^aeiou]y$", head):
        many = f"{head[:-1]}ies"
    elif re.search(r"(s|x|z|ch|sh|tomato|potato)$", head):
        many = f"{head}es"
    else:
        many = f"{head}s"
    return " of ".join([many, *rest])


def _written(text: str) -> str:
    """As the recogniser writes it: a capital at the beginning, the right article, a sign at the end."""
    text = re.sub(r"\ba (?=[aeiou])", "an ", " ".join(text.split()).replace(" ,", ","))
    text = text[0].upper() + text[1:]
    return f"{text}{'?' if _ASKS.match(text) else '.'}"
