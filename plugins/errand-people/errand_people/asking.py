"""Questions to people about what they want, with the steps that follow each answer."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from executive.language.clauses import CLAUSES, Clause, Cue, begins_as, end_of_scope
from executive.language.items import Chunk
from executive.language.questions import RefusalError
from executive.language.structure.builder import Builder
from executive.language.structure.plain import PlainReader, named, require
from executive.language.structure.speaking import escape_braces, goes_to_listener, refuse_stranger
from executive.language.templates import Match
from executive.words.steps import Ask, Steps
from skills.inputs.errors import with_article

_TABLE: Final = Path(__file__).with_name("asking.yaml")
_ANSWERS: Final[dict[Cue | None, str]] = {Cue.SO: "yes", Cue.NOT: "no", Cue.OTHERWISE: "no"}


@dataclass(frozen=True)
class _Question:
    """Question to a person, the objects to choose from (with their articles), and whether its answer is yes or no."""

    text: str
    of: Match
    choices: tuple[str, ...]
    yes_or_no: bool = False


def asks_somebody(row: Builder, clause: Clause) -> bool:
    """Adds a question to somebody, with the steps that follow each answer."""
    person, text = row.state.memory.person, clause.text
    if person is not None:
        text = re.sub(r"^(ask) (?:him|her)\b", rf"\1 {person.name}", text, flags=re.IGNORECASE)
    if (asked := _parse_question(text, row.reader)) is None:
        return False
    row.flush()
    goes_to_listener(row, asked.of)
    choices = (_agreed if asked.yes_or_no else _chosen)(row, asked)
    row.put((Ask(ask=escape_braces(asked.text), choices=choices),), row.state.elsewhere)
    return True


def _agreed(row: Builder, asked: _Question) -> dict[str, Steps]:
    """Steps that follow the answers yes and no."""
    found: dict[str, Steps] = {"yes": (), "no": ()}
    forms = row.reader.forms("asking", _TABLE)
    while (clause := row.following) is not None:
        match = forms["answers"].match(clause.text) if clause.kind is Cue.IF else None
        answer, rest = _ANSWERS.get(clause.kind), clause.text
        if match is not None:
            answer, rest = match["answer"], rest[match.end :].strip(" ,")
        if clause.kind is None and not any(found.values()) and forms["brings_it"].match(rest):
            answer = "yes"
        if answer is None or found[answer]:
            break
        row.at += 1
        body = row.body(clause, rest, end_of_scope(row.clauses, row.at, branch=True), clause.text)
        found[answer] = _steps_if_chosen(row, body, asked, asked.choices[0])
    clear, ahead = found["yes"] or not begins_as(row.ahead(), "brings"), row.ahead()
    require(clear, "say 'if yes' before the action for that answer", ahead)
    return found


def _chosen(row: Builder, asked: _Question) -> dict[str, Steps]:
    """Steps that follow each of the choices: the robot brings the chosen object if the sentence says so."""
    body = row.take("", row.at + 1) if begins_as(row.ahead(), "brings") else []
    steps = {choice: _steps_if_chosen(row, body, asked, choice) if body else () for choice in asked.choices}
    article = re.compile(r"^(?:a|an|some|the|any|another) ", re.IGNORECASE)
    return {article.sub("", choice): each for choice, each in steps.items()}


def _steps_if_chosen(row: Builder, body: Sequence[Clause], asked: _Question, choice: str) -> Steps:
    """Steps after an answer: "it" refers to the chosen object, and the asked person receives it."""
    objects = tuple(item.phrase for item in row.reader.read_items(choice) if isinstance(item, Chunk))
    person = named(asked.of["name"])
    memory = replace(row.state.memory, objects=objects, gathered=objects, where=None, person=person)
    steps, after = row.nest(body, replace(row.state, memory=memory, recipient=person))
    row.state = row.state.noting(after.notes)
    return steps


def _parse_question(text: str, reader: PlainReader) -> _Question | None:
    """Parses a request to ask somebody a question; None for others. Raises RefusalError for one it cannot put."""
    forms, speech, knowledge = reader.forms("asking", _TABLE), reader.forms("speech"), reader.knowledge
    if forms["asks"].match(text) is None or forms["asks_anybody"].match(text) or speech["tells"].fullmatch(text):
        return None
    whom = speech["who"].match(text, 1)
    match = (
        None if whom is None else forms["wants_one"].fullmatch(whom.rest) or forms["wants_what"].fullmatch(whom.rest)
    )
    if whom is None or match is None or not whom["name"]:
        refuse_stranger(text, knowledge)
        able = "I can ask somebody by name whether they want this or that"
        raise RefusalError(f"I do not understand the question in '{text}'; {able}", [text])
    if not match["what"]:  # what he wants to drink: a choice among all known objects of that kind
        kind = (match["kind"] or match["drink"]).lower()
        names = knowledge.classes(kind.removesuffix("s")) if kind else ()
        require(names, f"I do not know what there is to choose from in '{text}'; name it", text)
        spoken = f"Which {kind} do you want?" if match["kind"] else "What do you want to drink?"
        return _Question(spoken, whom, tuple(map(with_article, names)))
    if (word := CLAUSES["deictic"].search(match["what"])) is not None:
        raise RefusalError(f"I cannot ask that for you: '{word.text}' would mean somebody else", [text])
    choices = tuple(re.split(r",? or |, ", match["what"], flags=re.IGNORECASE))
    return _Question(f"Do you want {match['what']}?", whom, choices, yes_or_no=len(choices) == 1)
