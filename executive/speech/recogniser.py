"""Interface of a speech recogniser, which turns sound and expected names into transcripts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import cycle
from pathlib import Path
from types import ModuleType
from typing import Final, Protocol

from executive.speech.sound import Samples
from executive.words.knowledge import Knowledge
from skills.inputs.errors import InputError
from skills.inputs.outside import read_text


@dataclass(frozen=True)
class Transcript:
    """Possible text of a sound, with the log likelihood of the whole text (natural logarithm)."""

    text: str
    likelihood: float


class Recognition(Protocol):
    """Result of recognising one sound."""

    @property
    def transcripts(self) -> Sequence[Transcript]:
        """Hypotheses, the likeliest first; empty if nothing was said."""

    def more(self) -> Iterator[Sequence[Transcript]]:
        """Yields the hypotheses of wider and slower searches, one list for each search, the likeliest first."""

    def unprompted_text(self) -> str:
        """Text of a quick search that expects no names; empty for no speech."""

    def likelihoods(self, texts: Sequence[str]) -> Sequence[float]:
        """Log likelihood of each text given the sound, when no names are expected.

        These values can be compared with each other, but not with those of `transcripts`.
        """


class Recogniser(Protocol):
    """Recogniser of speech; the same sound and vocabulary give the same text."""

    def transcribe(self, sound: Samples, vocabulary: Vocabulary) -> Recognition:
        """Recognises at most 30 s of sound at RATE_HZ."""

    def partial_transcript(self, sound: Samples, vocabulary: Vocabulary) -> str:
        """Recognises the sentence under way, quickly."""


_MOST_NAMES = 5_000
_MOST_LETTERS = 80


@dataclass(frozen=True)
class Vocabulary:
    """Names of objects, places and people as they are spoken, the most frequent last, and the robot's name.

    If `robot_name` is empty, nobody needs to call the robot; `other_robots` may be called as well.
    """

    names: tuple[str, ...] = ()
    robot_name: str | None = None
    other_robots: tuple[str, ...] = ()

    @property
    def robots(self) -> tuple[str, ...]:
        """All robots that may be called."""
        return () if self.robot_name is None else (self.robot_name, *self.other_robots)

    @property
    def prompt(self) -> str:
        """Prompt for the recogniser: the names, and usual forms of requests."""
        call: tuple[str, ...] = _UNCALLED
        if self.robots:
            call = tuple(form.format(name) for form, name in zip(_CALLED, cycle(self.robots), strict=False))
        turns = (
            f"{call[0]} you bring me two? {call[1]} you go there. {call[2]} it back. "
            f"{call[3]} pick it up, move it and put it there."
        )
        spaced = [f" {name.lower()} " for name in self.names]  # a name within a longer one is expected with that
        longest = [name for name in self.names if sum(f" {name.lower()} " in other for other in spaced) == 1]
        return f"{', '.join(longest)}. {turns}" if self.names else turns


def vocabulary_of_world(knowledge: Knowledge, *, called: bool) -> Vocabulary:
    """Collects all names in a world; with `called`, the speaker calls the robot by its name."""
    groups = (knowledge.surfaces, knowledge.places, knowledge.things, knowledge.people)
    aliases = [alias for group in groups for facts in group.values() for alias in facts.aliases]
    names = [name for group in groups for name in group]
    robot = knowledge.robot.name
    everything = dict.fromkeys([*aliases, *names, *knowledge.categories(), *([robot] if called else [])])
    return Vocabulary(tuple(everything), robot if called else None)


def read_vocabulary(file: Path, robot_name: str | None) -> Vocabulary:
    """Reads the names in a text file, one on each line; empty lines are ignored.

    Raises InputError when the file is unreadable, is no text, or holds over 5000 names or a name of over 80 letters.
    """
    lines = [" ".join(line.split()) for line in read_text(file, hint="name a text file in UTF-8").splitlines()]
    for number, line in enumerate(lines, 1):
        if len(line) > _MOST_LETTERS:
            raise InputError("the name is too long", hint="write one name on each line", file=file, line=number)
    names = tuple(dict.fromkeys(filter(None, lines)))
    if len(names) > _MOST_NAMES:
        raise InputError(f"{len(names)} names are too many", hint=f"keep {_MOST_NAMES} at most", file=file)
    return Vocabulary((*names, *([robot_name] if robot_name else [])), robot_name)


_CALLED: Final = ("Hey {}, could", "Hi {}, would", "OK {}, take", "{}, please")
_UNCALLED: Final = ("Could", "Would", "Take", "Please")


_HINT: Final = "install the extra that listens: pip install 'spot-errand[speech]'"


def speech_module(name: str) -> ModuleType:
    """Imports a module of the extra `speech`. Raises InputError when the extra is not installed."""
    try:
        return import_module(name)
    except ImportError as error:
        raise InputError(f"speech needs {name.split('.')[0]}, which is not installed", hint=_HINT) from error
