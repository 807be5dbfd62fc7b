"""From a sentence to commands, or to one line that says why not."""

from __future__ import annotations

import enum
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from executive.command import Command
from executive.knowledge import Knowledge
from executive.language.actions import Action, read_actions
from executive.language.clauses import split_clauses, without_name
from executive.language.drafts import draft_commands, spoken_command
from executive.language.grounding import ground, known_line
from executive.language.items import split_items
from executive.language.lexicon import VerbKind, lexicon
from executive.language.names import name_table, parse_with_names
from executive.language.normalise import MAX_WORDS, clean, open_commands
from executive.language.parser import DependencyParser
from executive.language.phrases import Phrase, noun_phrases
from executive.language.reference import Deed, resolve
from executive.language.refusal import RefusalError
from executive.language.wake import strip_wake

__all__ = ["Status", "Understanding", "parse_lines", "understand"]


class Status(enum.Enum):
    """What became of a sentence."""

    OK = "ok"  # it became commands
    REFUSED = "refused"  # it, or a part of it, is nothing that the robot does
    QUESTION = "question"  # the speaker must say more
    NOT_ADDRESSED = "not_addressed"  # it was not for this robot


@dataclass(frozen=True)
class Understanding:
    """What a sentence means: commands when `status` is OK, else the reason in one line."""

    text: str
    status: Status
    commands: tuple[Command, ...] = ()
    reason: str | None = None
    unknown_words: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """The answer as JSON values."""
        return {
            "text": self.text,
            "status": self.status.value,
            "reason": self.reason,
            "unknown_words": list(self.unknown_words),
            "commands": [command.to_json() for command in self.commands],
        }


def understand(
    sentence: str,
    *,
    parser: DependencyParser,
    knowledge: Knowledge | None,
    require_wake: bool,
    robot_name: str | None = None,
) -> Understanding:
    """The commands that `sentence` asks for.

    Args:
        sentence: what was said or typed.
        parser: the dependency parser.
        knowledge: the world's names and defaults; None keeps all names as they were spoken.
        require_wake: whether a sentence without the wake phrase is not for this robot.
        robot_name: the name to listen to; by default the one in `knowledge`.
    """
    name = robot_name or (knowledge.robot.name if knowledge else "robot")
    wake = strip_wake(clean(sentence), name)
    if wake.other_name is not None and knowledge is not None:
        reason = f"it is said to {wake.other_name}, and this robot is {name}"
        return Understanding(sentence, Status.NOT_ADDRESSED, reason=reason, unknown_words=(wake.other_name,))
    if require_wake and not wake.addressed:
        reason = f'the robot\'s name was not said; begin with "Hey {name}"'
        return Understanding(sentence, Status.NOT_ADDRESSED, reason=reason)
    try:
        return Understanding(sentence, Status.OK, _commands(wake.text, parser, knowledge))
    except RefusalError as refusal:
        status = Status.QUESTION if refusal.question else Status.REFUSED
        return Understanding(sentence, status, reason=refusal.reason, unknown_words=refusal.unknown)


def parse_lines(
    lines: Iterable[str], *, parser: DependencyParser, knowledge: Knowledge | None, require_wake: bool = False
) -> Iterator[Understanding]:
    """Understand each line for itself, in order; an empty line is refused, not skipped."""
    for line in lines:
        yield understand(line.rstrip("\r\n"), parser=parser, knowledge=knowledge, require_wake=require_wake)


def _commands(text: str, parser: DependencyParser, knowledge: Knowledge | None) -> tuple[Command, ...]:
    """All steps from text to commands; raises RefusalError."""
    words = text.split()
    if len(words) > MAX_WORDS:
        raise RefusalError(f"{len(words)} words are too many for one sentence; say it in {MAX_WORDS} at most")
    tokens = parse_with_names(open_commands(text), parser, None if knowledge is None else name_table(knowledge))
    items = split_items(tokens, noun_phrases(tokens), lexicon())
    clauses = split_clauses(items)
    if not clauses:
        raise RefusalError(f"nothing was said; {known_line(knowledge)}")
    actions = read_actions(clauses if knowledge else without_name(clauses), lexicon())
    _check(actions, knowledge)
    deeds = resolve(actions)
    _check_deeds(deeds, knowledge)
    drafts = draft_commands(deeds)
    return tuple(map(spoken_command, drafts)) if knowledge is None else ground(drafts, knowledge)


def _check(actions: Sequence[Action], knowledge: Knowledge | None) -> None:
    """Refuse the whole sentence when any part of it was not understood."""
    unknown = tuple(dict.fromkeys(word for action in actions for word in action.unknown))
    if unknown:
        raise _not_understood(unknown, knowledge)
    if not any(action.kind for action in actions):
        told = [phrase.text for action in actions for phrase in action.objects]
        raise RefusalError(f"nothing to do was said; {known_line(knowledge)}", told)


def _not_understood(words: Sequence[str], knowledge: Knowledge | None) -> RefusalError:
    quoted = ", ".join(repr(word) for word in words)
    return RefusalError(f"I do not understand {quoted}; {known_line(knowledge)}", words)


def _check_deeds(deeds: Sequence[Deed], knowledge: Knowledge | None) -> None:
    """Refuse to carry people, to serve all of a kind, and what no hand can hold."""
    carries = (deed for deed in deeds if deed.kind not in (VerbKind.GO, VerbKind.FIND))
    people = [f"{d.verb} {d.target.text}" for d in carries if d.target is not None and d.target.person]
    if people:
        raise RefusalError(f"I cannot carry or lead people: {', '.join(people)}; {known_line(knowledge)}", people)
    phrases = (p for deed in deeds for p in _phrases(deed))
    outside = [p.spoken for p in phrases if p.universal or p.intangible]
    if outside:
        raise _not_understood(outside, knowledge)


def _phrases(deed: Deed) -> Iterator[Phrase]:
    places = (place.phrase for place in (deed.source, deed.goal) if place is not None)
    yield from (phrase for phrase in (deed.target, *places) if phrase is not None)
