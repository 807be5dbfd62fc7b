"""Builds the steps of a mission from the clauses of a sentence."""

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Final

from pydantic import ValidationError

from executive.language.clauses import CHECKS, Clause, Cue, cut, split, trailing_cue, without_whatever
from executive.language.coverage import TOLD, note_adverbs
from executive.language.items import Adverb, Chunk, verb, without_objects
from executive.language.lexicon import PrepositionRole
from executive.language.nouns import NounKind
from executive.language.pipeline import Pipeline, Trace
from executive.language.questions import RefusalError, RefusalKind
from executive.language.reference import Memory
from executive.language.roles import Location
from executive.language.structure.conditions import RequestParser, parse_condition
from executive.language.structure.decisions import DecisionBuilder
from executive.language.structure.plain import (
    ATTACHED,
    LastCheck,
    PlainReader,
    State,
    StepRow,
    end_of_scope,
    phrase_of_name,
    statement_of_check,
    with_preposition,
)
from executive.language.structure.requests import (
    PEOPLE,
    REQUESTS,
    ROOMS,
    SPEECH,
    QuestionRequest,
    escape_braces,
    is_clause,
    parse_people,
    parse_question,
    parse_speech,
    search_for,
    steps_for_everyone,
    steps_on_people,
)
from executive.language.templates import Match
from executive.words.command import PEOPLE_TASKS, SPEAKER, START, Task
from executive.words.condition import Look
from executive.words.leaf_steps import Awaited, Check, Do, Speak, Wait, steps_of_commands
from executive.words.step import Step
from executive.words.steps import Ask, Choose, Group, Repeat, Steps, Together, Try
from skills.inputs.schema import first_error


class SentenceBuilder(DecisionBuilder):
    """Builder of the steps for one sentence. Its methods raise RefusalError for a clause that they cannot build."""

    def sequence(self, clauses: Sequence[Clause], state: State) -> tuple[Steps, State]:
        """Builds the steps of clauses, in order."""
        row, at = StepRow(state), 0
        while at < len(clauses):
            last = row.steps[-1] if row.steps and not row.plain else None
            if isinstance(last, Repeat) and last.loop.is_endless:
                what = "nothing can follow an endless repetition; say how often"
                raise RefusalError(what, [clauses[at].text])
            at = self._next(row, clauses, at)
        self.flush(row)
        return tuple(row.steps), row.state

    def _next(self, row: StepRow, clauses: Sequence[Clause], at: int) -> int:
        """Builds the clause at `at` and the clauses that depend on it; returns the index after these."""
        clause = clauses[at]
        if clause.anyway:
            return self._put_always(row, clauses, at)
        if clause.kind in (Cue.IF, Cue.UNLESS):
            return self.decide(row, clauses, at)
        if clause.kind in ATTACHED:
            return self.attach(row, clauses, at)
        if clause.kind is not None:
            return (self.wait_for if clause.kind is Cue.SOON else self.repeat)(row, clauses, at)
        stated = bool(row.plain) and all(
            CHECKS["told_first"].match(one.text) or CHECKS["pronoun"].match(one.text) for one in row.plain
        )
        if clause.begins and not stated:  # unless it goes on with "there is a hammer on the bench. bring it"
            self.flush(row)
            row.begun = len(row.steps)
        if self.given is not None and at == 0 and CHECKS["no_verb"].fullmatch(clause.text):
            clause = replace(clause, lead=without_objects(self.reader.read_items(self.given)))
            clauses = [clause, *clauses[1:]]
        return self._act(row, clause, clauses, at)

    def _put_always(self, row: StepRow, clauses: Sequence[Clause], at: int) -> int:
        """Adds steps that run at the end, whatever happens."""
        self.flush(row)
        first = clauses[at]
        if not row.steps:
            raise RefusalError("say what I am to do first, before what I am to do in any case", [first.text])
        ended = re.sub(r"[, ]+(?:at the end|in the end)$", "", without_whatever(first.text), flags=re.IGNORECASE)
        rest = [replace(first, text=ended), *clauses[at + 1 :]]
        always, state = self.nest(rest, replace(row.state, goal=None, at=None))
        row.steps = [Group(steps=tuple(row.steps), always=always)]
        row.state, row.asked = state, None
        return len(clauses)

    def _act(self, row: StepRow, clause: Clause, clauses: Sequence[Clause], at: int) -> int:
        """Builds the clause at `at`, which contains an action; returns the index after it."""
        text = clause.text
        if CHECKS["brings"].match(text) is not None or CHECKS["giving"].match(text) is not None:
            self.given = text if (behind := trailing_cue(text)) is None else behind.before
        if CHECKS["answered"].fullmatch(text) is not None and self._answered(row):
            return at + 1
        if CHECKS["idle"].fullmatch(text) is not None:
            self.flush(row)
            return at + 1
        for act in (self._people, self._request, self._asks, self._says, self._checks):
            if (end := act(row, clauses, at)) is not None:
                return end
        found = trailing_cue(text)
        if found is not None and (found.kind is Cue.EVERY or not ROOMS["every_room"].search(text)):
            self.modify(row, clause, found)
            return at + 1
        for act in (partial(self._request, parsers=(steps_for_everyone,)), self._rooms):
            if (end := act(row, clauses, at)) is not None:
                return end
        row.plain.append(clause)
        return at + 1

    def _request(
        self, row: StepRow, clauses: Sequence[Clause], at: int, parsers: Sequence[RequestParser] = REQUESTS
    ) -> int | None:
        """Adds the steps of a request that one of the parsers understands."""
        for parse in parsers:
            if (done := parse(clauses[at].text, partial(self.known, row), self.reader)) is not None:
                self.put(row, *done)
                self.special = True
                return at + 1
        return None

    def _people(self, row: StepRow, clauses: Sequence[Clause], at: int) -> int | None:
        """Builds a request about people; finding somebody counts only before another request about the same person."""
        text = clauses[at].text
        found = trailing_cue(text)
        decides = found is not None and found.kind in (Cue.IF, Cue.UNLESS, Cue.EVERY, Cue.TIMES)
        request = parse_people(found.before if found is not None and decides else text, self.reader.knowledge)
        if request is None:
            return None
        then = clauses[at + 1].text if at + 1 < len(clauses) and clauses[at + 1].kind is None else ""
        refers = PEOPLE["refers"].search(then) is not None
        if request.form == "find" and not (refers or (self.special and request.refers)):
            return None
        if request.form == "stated" and not (refers and parse_people(then, self.reader.knowledge)):
            return None
        if found is not None and decides:
            self.modify(row, clauses[at], found)
            return at + 1
        self._flush_reasons(row)
        self.put(row, *steps_on_people(request, row.state, self.reader))
        self.special = True
        return at + 1

    def _flush_reasons(self, row: StepRow) -> None:
        """Understands the pending clauses; skips a mere reason ("Robin is lost"), which is no request."""
        reasons = " ".join(clause.text for clause in row.plain)
        try:
            self.flush(row)
        except RefusalError as refusal:
            if refusal.kind is not RefusalKind.NOTHING_TO_DO or not is_clause(reasons, self.reader.pipeline.parser):
                refusal.plain = False
                raise
            row.plain = []
            self.notes.append(TOLD.format(repr(reasons)))
            named = [name for name in self.reader.knowledge.people if re.search(rf"\b{re.escape(name)}\b", reasons)]
            if len(named) == 1:
                person = Location(phrase_of_name(named[0], NounKind.PERSON), "to")
                row.state = replace(row.state, memory=replace(row.state.memory, person=person))

    def _answered(self, row: StepRow) -> bool:
        """Returns whether the robot answers the last look in any case."""
        self.flush(row)
        last = row.steps[-1] if row.steps else None
        found = last is not None and bool(last.commands) and last.commands[-1].task is Task.FIND
        looked = isinstance(last, Check) or found
        self.special = self.special or looked
        return looked

    def _says(self, row: StepRow, clauses: Sequence[Clause], at: int) -> int | None:
        clause = clauses[at]
        if (match := SPEECH["tells_when"].fullmatch(clause.text)) is not None:
            self._tells_when(row, match)
            return at + 1
        if not SPEECH["speaks"].match(clause.text) or SPEECH["asks_back"].match(clause.text):
            return None
        if (everywhere_said := ROOMS["says_everywhere"].fullmatch(clause.text)) is not None:
            self._in_each(row, replace(clause, joint="", text=everywhere_said["said"]))
            return at + 1
        found = trailing_cue(clause.text)
        if found is not None:  # unless it is a part of what is said
            counts = found.kind in (Cue.TIMES, Cue.EVERY) and found.text
            if not counts or re.match(r"for|until|every", found.text):
                self.modify(row, clause, found)
                return at + 1
        said = parse_speech(clause.text, self.reader)
        if said is None:
            return None
        if (text := said[0] or self.statement) is None:
            raise RefusalError(f"what am I to say in '{clause.text}'?", [clause.text])
        self._speak(row, text, said[1])
        return at + 1

    def _tells_when(self, row: StepRow, match: Match) -> None:
        """Builds a wait and a speech for "tell me when Robin comes"."""
        self.flush(row)
        supposed = parse_condition(match["what"], row.state, self.reader)
        if supposed.statement is None:
            raise RefusalError(f"what am I to say in '{match.text}'?", [match.text])
        self.put(row, (Wait(awaited=Awaited(condition=supposed.condition)),), supposed.holds)
        said = parse_speech(f"tell {match['who']} that {supposed.statement}", self.reader)
        if said is None:
            raise RefusalError(f"I do not know to whom to say it: '{match['who']}'", [match["who"]])
        self._speak(row, *said)

    def _speak(self, row: StepRow, text: str, to: Match) -> None:
        """Adds speech to a listener, behind the pending clauses."""
        self.flush(row)
        self._to(row, to)
        self.put(row, (Speak(speak=escape_braces(text)),), row.state)

    def _to(self, row: StepRow, to: Match) -> None:
        """Adds the drive to the listener."""
        said, place = to["name"] or to["pronoun"], to["where"]
        if not (said or place or to["speaker"]):
            return
        who = with_preposition(self.reader.read_items(said), "to") if said else ()
        where = with_preposition(self.reader.read_items(place), "in" if who else "to") if place else ()
        going = (verb("come"), Adverb(here=True)) if to["speaker"] else (verb("go"), *who, *where)
        reading = self.reader.commands_from_items(going, row.state)
        last = row.steps[-1].commands[-1:] if row.steps and not place else ()
        if any(one.task in PEOPLE_TASKS and str(one.object) == reading.commands[-1].goal for one in last):
            return  # the robot has just followed or guided that person
        if reading.commands[-1].goal != row.state.goal or reading.commands[-1].goal_at is not None:
            self.add(row, reading)

    def _asks(self, row: StepRow, clauses: Sequence[Clause], at: int) -> int | None:
        person, text = row.state.memory.person, clauses[at].text
        if person is not None:
            text = re.sub(r"^(ask) (?:him|her)\b", rf"\1 {person.name}", text, flags=re.IGNORECASE)
        asked = parse_question(text, self.reader.knowledge)
        if asked is None:
            return None
        self.flush(row)
        self._to(row, asked.of)
        answers = self._agreed if asked.yes_or_no else self._chosen
        choices, end = answers(asked, row.state, clauses, at + 1)
        self.put(row, (Ask(ask=escape_braces(asked.text), choices=choices),), replace(row.state, goal=None, at=None))
        return end

    def _agreed(
        self, asked: QuestionRequest, state: State, clauses: Sequence[Clause], at: int
    ) -> tuple[dict[str, Steps], int]:
        """Steps that follow the answers yes and no."""
        found: dict[str, Steps] = {"yes": (), "no": ()}
        while at < len(clauses):
            clause, rest = clauses[at], clauses[at].text
            denied = CHECKS["declines"].match(rest) if clause.kind is Cue.IF else None
            match = denied or (CHECKS["agrees"].match(rest) if clause.kind is Cue.IF else None)
            answer = "yes" if clause.kind is Cue.SO else "no" if clause.kind in (Cue.NOT, Cue.OTHERWISE) else None
            if match is not None:
                answer = "yes" if denied is None else "no"
                rest = rest[match.end :].strip(" ,")
            chosen = clause.kind is None and not any(found.values()) and CHECKS["brings_it"].match(rest)
            answer = "yes" if chosen else answer
            if answer is None or found[answer]:
                break
            end = end_of_scope(clauses, at + 1, branch=True)
            body = [*cut(rest), *clauses[at + 1 : end]]
            if not body:
                raise clause.missing_action(clause.text)
            found[answer], _ = self.nest(body, self._choosing(asked, 0, state))
            at = end
        if at < len(clauses) and not found["yes"] and CHECKS["brings"].match(clauses[at].text):
            raise RefusalError("say 'if yes' before the action for that answer", [clauses[at].text])
        return found, at

    def _chosen(
        self, asked: QuestionRequest, state: State, clauses: Sequence[Clause], at: int
    ) -> tuple[dict[str, Steps], int]:
        """Steps that follow each of the choices: the robot brings the chosen object if the sentence says so."""
        article = r"^(?:a|an|some|the|any|another) "
        names = [re.sub(article, "", choice, flags=re.IGNORECASE) for choice in asked.choices]
        if at >= len(clauses) or clauses[at].kind is not None or not CHECKS["brings"].match(clauses[at].text):
            return dict.fromkeys(names, ()), at
        chosen = (self._choosing(asked, n, state) for n in range(len(names)))
        return {name: self.nest([clauses[at]], each)[0] for name, each in zip(names, chosen, strict=True)}, at + 1

    def _choosing(self, asked: QuestionRequest, number: int, state: State) -> State:
        """State after the answer: "it" refers to the chosen object, and the asked person receives it."""
        objects = tuple(
            item.phrase for item in self.reader.read_items(asked.choices[number]) if isinstance(item, Chunk)
        )
        person = Location(phrase_of_name(asked.of["name"], NounKind.PERSON), "to")
        memory = replace(state.memory, objects=objects, gathered=objects, where=None, person=person)
        return replace(state, memory=memory, recipient=person)

    def _checks(self, row: StepRow, clauses: Sequence[Clause], at: int) -> int | None:
        """Builds a check that needs a block: "look whether the door is open", "is the battery low"."""
        text = statement_of_check(clauses[at].text)
        if text is None:
            return None
        state = self.known(row)
        try:
            self.reader.read_commands(clauses[at].text, state)
        except RefusalError as refusal:
            plain = refusal
        else:
            return None
        if trailing_cue(text) is not None:
            return None
        try:
            supposed = parse_condition(text, state, self.reader)
        except RefusalError as refusal:
            said = refusal.question is not None or refusal.kind in (RefusalKind.NO_SUCH_DOOR, RefusalKind.UNSEEN)
            raise (refusal if said else plain) from None
        self.flush(row)
        found = supposed.condition
        step = Do.from_command(found.command) if isinstance(found, Look) else Check(condition=found)
        self.put(row, (step,), supposed.holds, supposed.notes)
        row.asked = LastCheck(supposed, looked=True)
        return at + 1

    def _rooms(self, row: StepRow, clauses: Sequence[Clause], at: int) -> int | None:
        text = clauses[at].text
        if not ROOMS["every_room"].search(text):
            return None
        state, end = self.known(row), at + 1
        looks = ROOMS["search"].fullmatch(text)
        reading = None if looks is None else search_for(looks["what"], state, self.reader)
        follow = clauses[at + 1].text if at + 1 < len(clauses) and clauses[at + 1].kind is None else ""
        if reading is None and ROOMS["goes_everywhere"].fullmatch(text) is not None:
            there = ROOMS["what_there"].fullmatch(follow) or ROOMS["search"].fullmatch(follow)
            if there is not None:
                reading, end = search_for(there["what"], state, self.reader), at + 2
            elif SPEECH["speaks"].match(follow) and trailing_cue(follow) is None:
                self._in_each(row, replace(clauses[at + 1], joint=""))
                return at + 2
        if reading is None:
            return None
        self.flush(row)
        self.add(row, reading)
        self.special = True
        return end

    def _in_each(self, row: StepRow, says: Clause) -> None:
        """Adds speech in every room."""
        self.flush(row)
        for room in self.reader.knowledge.rooms:
            there = Chunk(phrase_of_name(room, NounKind.PLACE), "to", PrepositionRole.GOAL)
            reading = self.reader.commands_from_items((verb("go"), there), replace(row.state, goal=None))
            said, state = self.sequence([says], reading.state)
            self.put(row, (*steps_of_commands(reading.commands), *said), state)


MOST_NESTED: Final = 2

MOST_CLAUSES: Final = 24


def read_structure(plain: Trace, clauses: Sequence[Clause] | None, pipeline: Pipeline, memory: Memory) -> Trace:
    """Reads a sentence with conditions, loops, waits or speech, given the trace of its plain reading.

    Returns the plain trace for a list of plain commands, and for plain words that are refused. `clauses` are the
    sentence's clauses, if known; `memory` has the referents from earlier sentences.
    """
    decides = True
    try:
        clauses = split(plain.text)[1] if clauses is None else clauses
        decides = any(one.kind is not None or trailing_cue(one.text) is not None for one in clauses)
        if not decides and (plain.refusal is None or plain.refused_at == "cleaning"):
            return plain
        return _structured(plain, clauses, pipeline, memory)
    except RefusalError as refusal:
        return plain if refusal.plain and not decides else replace(plain, refusal=refusal, refused_at="structure")
    except ValidationError as error:
        _, wrong, _ = first_error(error.errors())
        return replace(plain, refusal=RefusalError(f"a number in it {wrong}"), refused_at="structure")


def _structured(plain: Trace, clauses: Sequence[Clause], pipeline: Pipeline, memory: Memory) -> Trace:
    """Reads the structured sentence. Raises RefusalError with the words if any part is uncertain."""
    if len(clauses) > MOST_CLAUSES:
        raise RefusalError(f"{len(clauses)} parts are too many for one sentence; say it in {MOST_CLAUSES} at most")
    assert pipeline.knowledge is not None
    builder = SentenceBuilder(PlainReader(pipeline, pipeline.knowledge))
    steps, state = builder.sequence(clauses, State.initial(pipeline.knowledge, memory))
    if all(isinstance(step, Do) for step in steps) and not builder.special:
        return plain
    if max(map(_depth, steps), default=0) > MOST_NESTED:
        raise RefusalError("three conditions or repetitions within each other are too many; say it in two sentences")
    parts = tuple(" | ".join(filter(None, (each.joint.strip(" ,;."), each.cue, each.text))) for each in clauses)
    commands = tuple(command for step in steps for each in step.walk() for command in each.commands)
    found = Trace(plain.text, state.memory, opened=plain.opened, tokens=plain.tokens, commands=commands)
    moved = next((n for n, one in enumerate(commands) if str(one.object) == SPEAKER), len(commands))
    back = any(one.item is not None and one.goal == START for one in commands[moved:])
    spoken = [each.speak for step in steps for each in step.walk() if isinstance(each, Speak)]
    adverbs = note_adverbs(plain.text, [*spoken, *re.findall("'([^']+)'", " ".join(builder.notes))])
    notes = [*builder.notes, *filter(None, [adverbs]), *([_BACK] if back else [])]
    return replace(found, notes=tuple(dict.fromkeys(notes)), parts=parts, steps=steps)


_BACK: Final = "I bring it to the place where you have spoken to me, not to where you are then"
"""Note when the robot brings an object to the speaker after going elsewhere with the speaker."""


def _depth(step: Step) -> int:
    """Depth of nested blocks, without counting steps at the end."""
    inner = max(map(_depth, step.inner_steps), default=0)
    return inner + isinstance(step, Choose | Repeat | Try | Together | Ask)
