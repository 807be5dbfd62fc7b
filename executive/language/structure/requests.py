"""Parses special requests: waiting, charging, speech, questions, deliveries to everyone, and searches of all rooms."""

import re
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

from executive.language.amounts import AMOUNTS, parse_seconds, parse_share, parse_time
from executive.language.clauses import ACTS, CLAUSES
from executive.language.items import verb
from executive.language.lexicon import Patterns, any_of, lexicon
from executive.language.nouns import NounKind
from executive.language.parser import DependencyParser
from executive.language.questions import RefusalError
from executive.language.roles import Location
from executive.language.structure.conditions import (
    FULL,
    button_condition,
    parse_condition,
    presence_condition,
    usual_condition,
)
from executive.language.structure.plain import PlainReader, PlainReading, State, phrase_of_name
from executive.words.command import Task
from executive.words.knowledge import Knowledge
from executive.words.leaf_steps import Awaited, Charging, Dock, Picture, Subject, Wait, steps_of_commands
from executive.words.step import Step
from executive.words.steps import Steps
from skills.inputs.errors import listing, with_article

_INTRODUCTION: Final = "Hello, I am the robot here. I bring things, and I follow and guide people."
_WAITING: Final = Patterns("structures.yaml", "waiting", AMOUNTS)

_SUBJECTS: Final = r"(?:the|a|an|my|your|our|his|her|their|this|all|every)\b"
_ADVERBIAL: Final = re.compile(
    rf"(?!{_SUBJECTS})([\w' ]+?),? that (?=\w)|({any_of(map(' '.join, lexicon().noted))}) ", re.IGNORECASE
)
"""Words before what is told that say when or how it is told."""

Done = tuple[Steps, State, tuple[str, ...]]
"""Steps, the state after them, and notes."""


def parse_wait(text: str, state: State, reader: PlainReader) -> Done | None:
    """Parses a wait for a condition; None for other texts, and for a wait of a given duration. Raises RefusalError."""
    match = _WAITING.wait.fullmatch(text)
    if match is None or ACTS.only_span.fullmatch(match["what"]):
        return None
    return wait_steps(match["where"].strip(), match["how"].lower(), match["what"], state, reader)


def wait_steps(where: str, how: str, what: str, state: State, reader: PlainReader) -> Done:
    """Builds a wait in a place: until a condition holds, while it holds, or for a person ("for").

    Raises RefusalError when the place or the condition cannot be understood.
    """
    steps, there = _gone(where, state, reader)
    if how in ("until", "till"):
        if (passed := _WAITING.passed.fullmatch(what)) is not None and (
            span := parse_seconds(passed["span"])
        ) is not None:
            return (*steps, Wait(awaited=Awaited(seconds=span))), there, ()
        if (time := parse_time(_WAITING.time.sub(r"\g<time>", what))) is not None:
            return (*steps, Wait(awaited=Awaited(until_clock=time.text))), there, time.notes(what)
        found = parse_condition(what, there, reader)
    elif how != "for":
        found = parse_condition(what, there, reader).negate(what)
    elif (match := _WAITING.button.fullmatch(what)) is not None:
        found = button_condition(match["button"] or match["of"], what, there)
    elif " to " in what and (usual := usual_condition(what, there, reader)) is not None:
        found = usual
    elif (match := _WAITING.person_at.fullmatch(what)) is not None and reader.is_somebody(match["who"], there):
        reading = reader.go_to(match["where"], there)
        steps, there = (*steps, *steps_of_commands(reading.commands)), reading.state
        found = presence_condition(match["who"], None, what, there, reader)
    elif reader.is_somebody(what, there):
        found = presence_condition(what, None, what, there, reader)
    else:
        raise RefusalError(f"I do not understand what to wait for: '{what}'", [what])
    after = replace(found.holds, goal=found.holds.goal or there.goal)
    return (*steps, Wait(awaited=Awaited(condition=found.condition))), after, found.notes


def _gone(where: str, state: State, reader: PlainReader) -> tuple[Steps, State]:
    """Adds the drive to the place of a wait; returns the state there."""
    if _WAITING.here.fullmatch(where):
        return (), state
    match = _WAITING.place.fullmatch(where)
    if match is None:
        raise RefusalError(f"I do not understand where to wait: '{where}'", [where])
    if match["there"] and state.goal is not None and state.at is not None:
        return (), state
    reading = reader.go_to(match["place"] or match["there"], state)
    return steps_of_commands(reading.commands), reading.state


def parse_charging(text: str, state: State) -> Done | None:
    """Parses charging up to a level; None if the text states no level."""
    match = _WAITING.charge.fullmatch(text)
    if match is None:
        return None
    level = FULL if match["level"].lower().startswith("full") else parse_share(match["level"])
    if level is None:
        raise RefusalError(f"'{match['level']}' is no charge; say it in percent", [match["level"]])
    return (Dock(charging=Charging(level=level)),), replace(state, goal=None, at=None), ()


def parse_pictures(text: str, state: State, reader: PlainReader) -> Done | None:
    """Parses a request for pictures; None for other texts. Raises RefusalError for an unknown name."""
    match = next((found for form in ACTS.each("pictured") if (found := form.fullmatch(text))), None)
    if match is None:
        return None
    at = match.groupdict().get("at") and reader.go_to(match["at"], state).commands[0].goal
    names = (_picture_of(of, state, reader) for of in re.split(r",? and |, ", match["of"]))
    subjects = [Subject(of=of, at=at, camera=match["camera"]) for of in names]
    return tuple(Picture(subject=each) for each in subjects), replace(state, goal=None, at=None), ()


def _picture_of(text: str, state: State, reader: PlainReader) -> str:
    """World's name of the place or object that a picture shows. Raises RefusalError."""
    place = reader.knowledge.place(re.sub(r"^(?:the|a|an|my|our|your) ", "", text, flags=re.IGNORECASE))
    return place or str(reader.read_commands(text, state, (verb("find"),)).commands[0].object)


@dataclass(frozen=True)
class Listener:
    """Person to whom the robot speaks: the speaker, or another person in words (`who`), and the place.

    `name` is the name of a known person. Without `who` and `where` the robot speaks where it is.
    """

    who: str | None = None
    where: str | None = None
    name: str | None = None
    speaker: bool = False


@dataclass(frozen=True)
class SpeechRequest:
    """Speech and its listener; `text` is None if the sentence does not say it ("tell Robin")."""

    text: str | None
    to: Listener | None


@dataclass(frozen=True)
class QuestionRequest:
    """Question to a person, the objects to choose from (with their articles), and whether its answer is yes or no."""

    text: str
    of: Listener
    choices: tuple[str, ...]
    yes_or_no: bool = False


def parse_speech(text: str, reader: PlainReader) -> SpeechRequest | None:
    """Parses a clause that asks the robot to speak; None for other clauses.

    Raises RefusalError when the robot cannot say it in the speaker's place, or does not know the listener.
    """
    forms, parser = _of_world(reader.knowledge), reader.pipeline.parser
    if (match := forms.say_to.fullmatch(text) or forms.say_whom.fullmatch(text)) is not None:
        return SpeechRequest(_words(match["text"], parser), _listener(match))
    if forms.says_inside.match(text) is not None:
        raise RefusalError(f"I do not understand to whom to say '{text}'; name one person at the end", [text])
    if (match := ACTS.say.fullmatch(text)) is not None:
        return SpeechRequest(_words(match["text"], parser), None)
    if (match := forms.greet.fullmatch(text)) is not None:
        return SpeechRequest("hello", _listener(match))
    if (match := forms.introduce.fullmatch(text)) is not None:
        return SpeechRequest(_INTRODUCTION, _listener(match) if match["who"] else None)
    if (match := forms.announce_to.fullmatch(text)) is not None:
        return SpeechRequest(_told(match["text"]), _listener(match))
    if (match := ACTS.announce.fullmatch(text)) is not None:
        return SpeechRequest(_told(match["text"]), None if match["place"] is None else Listener(where=match["place"]))
    match = forms.tell_that.fullmatch(text) or forms.let_know_that.fullmatch(text)
    if match is not None and not ACTS.question.match(match["text"]):
        return SpeechRequest(_told(match["text"]), _listener(match))
    if (match := forms.tell_to.fullmatch(text)) is not None:
        return SpeechRequest(_told(f"please {match['act']}"), _listener(match))
    match = forms.tell.fullmatch(text) or forms.let_know.fullmatch(text)
    if match is None:
        _refuse_stranger(text, reader.knowledge)
        return None
    return _relayed(match["text"], text, _listener(match), parser)


def _refuse_stranger(text: str, knowledge: Knowledge) -> None:
    """Raises RefusalError for a listener with an unknown name."""
    match = re.match(r"(?:[Tt]ell|[Aa]sk) (?P<who>[A-Z][a-z]+)\b", text)
    names = knowledge.spellings(knowledge.people)
    if match is None or any(name.lower().startswith(match["who"].lower()) for name in names):
        return
    known = f"; known are {listing(knowledge.people)}" if knowledge.people else ""
    raise RefusalError(f"I know no person '{match['who']}'{known}", [match["who"]])


def _relayed(said: str | None, text: str, to: Listener, parser: DependencyParser) -> SpeechRequest:
    """Parses what to say in "tell Robin dinner is ready" or "let Robin know it"."""
    if said is not None and re.match(r"(?:and|or)\b", said, re.IGNORECASE):
        raise RefusalError(f"I tell it to one person at a time, not '{text}'", [text])
    if said is None or re.fullmatch(r"so|it|that|about it|about that", said, re.IGNORECASE):
        return SpeechRequest(None, to)
    adverbial = _ADVERBIAL.match(said)
    if adverbial is not None and is_clause(said[adverbial.end() :], parser):
        raise RefusalError(f"I tell it as soon as I am there, not {adverbial[1] or adverbial[2]!r}", [adverbial[0]])
    states = not (to.speaker or ACTS.question.match(said)) and is_clause(said, parser)
    if CLAUSES.greetings.fullmatch(said) or states:
        return SpeechRequest(_told(said), to)
    raise RefusalError(f"I do not understand what to tell in '{text}'; say 'tell ... that ...'", [text])


def make_speech(who: str, text: str, knowledge: Knowledge) -> SpeechRequest:
    """Builds a speech to a listener. Raises RefusalError for an unknown person, or when the meaning would change."""
    if (match := _of_world(knowledge).who.fullmatch(who)) is None:
        raise RefusalError(f"I do not know to whom to say it: '{who}'", [who])
    return SpeechRequest(_told(text), _listener(match))


def is_clause(text: str, parser: DependencyParser) -> bool:
    """Returns whether a text is a statement: a finite verb with a subject before it."""
    tokens = parser.parse(text)
    finite = {t.index for t in tokens if t.tag in ("VBZ", "VBP", "VBD", "MD")}
    verbs = finite | {t.index for t in tokens if t.relation == "root"}
    return bool(finite) and any(t.relation in ("nsubj", "nsubjpass", "expl") and t.head in verbs for t in tokens)


def _words(text: str, parser: DependencyParser) -> str:
    """Words to say. Raises RefusalError when they describe a text, or name an unknown person."""
    clause = is_clause(text, parser)
    whom = re.search(r" to (?:the|a|an|my|our|all|every|each|some|any|somebody|someone)\b.*$", text, re.IGNORECASE)
    if whom is not None and (not clause or re.search(r"\b(?:person|guest|visitor)\b", whom[0], re.IGNORECASE)):
        raise RefusalError(f"I do not know to whom to say it: '{whom[0].strip()}'", [whom[0].strip()])
    if ACTS.named.match(text) and not clause:
        raise RefusalError(f"what are the words of '{text}'?", [text])
    return _literal(text)


def _literal(text: str) -> str:
    """Words to say literally. Raises RefusalError when they only describe a text."""
    if ACTS.nothing.fullmatch(text) or ACTS.question.match(text) or re.match(r"to\b", text, re.IGNORECASE):
        raise RefusalError(f"what am I to say? '{text}' says nothing", [text])
    return text.strip(" ,.'\"")


def _told(text: str) -> str:
    """Statement as the robot says it for the speaker. Raises RefusalError when this would change the meaning."""
    word = CLAUSES.deictic.search(text) or ACTS.inner.search(text)
    if word is not None:
        raise RefusalError(f"I cannot say '{text}' for you: '{word[0]}' would mean somebody or something else", [text])
    return _literal(text)


def escape_braces(text: str) -> str:
    """Escapes braces in a text."""
    return text.replace("{", "{{").replace("}", "}}")


def _of_world(knowledge: Knowledge) -> Patterns:
    """Patterns for speaking to people in a world."""
    people, places = knowledge.spellings(knowledge.people), knowledge.spellings(knowledge.place_names())
    return _with_names(tuple(people), tuple(places))


@lru_cache(maxsize=16)
def _with_names(people: tuple[str, ...], places: tuple[str, ...]) -> Patterns:
    return ACTS.with_words(names=any_of(people) or "(?!)", around=any_of(places) or "(?!)")


def _listener(match: re.Match[str]) -> Listener:
    who, where = match["who"], match["where"]
    word = who.lower()
    if word in ("me", "us"):
        return Listener(who, speaker=True)
    if word in ("him", "her"):
        return Listener(who)
    if word in ("them", "the others", "everyone", "everybody") or " " in word:
        return Listener(where=where)
    return Listener(who, where, name=who)


def parse_question(text: str, knowledge: Knowledge) -> QuestionRequest | None:
    """Parses a clause that tells the robot to ask somebody a question; None for other clauses.

    Raises RefusalError for a question that the robot cannot put.
    """
    forms = _of_world(knowledge)
    if not re.match(r"ask\b", text, re.IGNORECASE) or forms.ask_to.fullmatch(text):
        return None
    text = re.sub(r" or not$", "", text, flags=re.IGNORECASE)
    match, open_one = forms.wants_one.fullmatch(text), forms.wants_what.fullmatch(text)
    found = match or open_one
    if found is None or _listener(found).name is None:
        _refuse_stranger(text, knowledge)
        what = (
            f"I do not understand the question in '{text}'; I can ask somebody by name whether they want this or that"
        )
        raise RefusalError(what, [text])
    if match is None:
        return _what(found, text, knowledge)
    if (word := CLAUSES.deictic.search(match["what"])) is not None:
        raise RefusalError(f"I cannot ask that for you: '{word[0]}' would mean somebody else", [text])
    choices = tuple(re.split(r",? or |, ", match["what"], flags=re.IGNORECASE))
    return QuestionRequest(f"Do you want {match['what']}?", _listener(match), choices, yes_or_no=len(choices) == 1)


def _what(match: re.Match[str], text: str, knowledge: Knowledge) -> QuestionRequest:
    """Builds the question for "what he wants to drink": a choice among all known objects of that kind."""
    kind = (match["kind"] or ("drink" if "drink" in text.lower() else "")).lower()
    names = knowledge.classes(kind.removesuffix("s")) if kind else ()
    if not names:
        raise RefusalError(f"I do not know what there is to choose from in '{text}'; name it", [text])
    spoken = "What do you want to drink?" if match["kind"] is None else f"Which {kind} do you want?"
    return QuestionRequest(spoken, _listener(match), tuple(map(with_article, names)))


def steps_for_everyone(text: str, state: State, reader: PlainReader) -> tuple[Steps, State] | None:
    """Builds a delivery to each person in a group; None if the recipient is no group.

    Raises RefusalError when no room is named, no known person is there, or there is only one such object.
    """
    trace = reader.read_actions(text, state)
    goals = [one.goal for one in trace.actions if one.goal is not None and one.goal.phrase is not None]
    to = next((goal for goal in goals if goal.phrase and ACTS.everyone.fullmatch(goal.phrase.spoken)), None)
    if to is None or to.phrase is None:
        return None
    who = to.phrase.spoken
    if to.within is None:
        raise RefusalError(f"I bring objects to one person at a time, not to {who}; name one, or a room", [who])
    room, knowledge = reader.room(to.within, state), reader.knowledge
    people = [name for name, facts in knowledge.people.items() if knowledge.room(facts.at) == room]
    if not people:
        raise RefusalError(f"I know nobody in the {room} to bring anything to: {who}", [who])
    steps: list[Step] = []
    begun = state
    for name in people:
        person = Location(phrase_of_name(name, NounKind.PERSON), "to", to.within)
        actions = [replace(one, goal=person) if one.goal == to else one for one in trace.actions]
        reading = reader.commands_from_actions(trace, actions, begun)
        if any(action.target is not None and not action.target.indefinite for action in reading.trace.resolved):
            raise RefusalError(f"there is only one of it, and I cannot bring it to {who}; name one person", [who])
        steps += steps_of_commands(reading.commands)
        begun = replace(reading.state, memory=state.memory)
    return tuple(steps), begun


def search_for(what: str, state: State, reader: PlainReader) -> PlainReading:
    """Understands a search for an object or a person in all rooms. Raises RefusalError when it is unclear."""
    reading = reader.read_commands(what, state, (verb("find"),))
    finds = [command for command in reading.commands if command.task is Task.FIND]
    if len(finds) != len(reading.commands) or re.search(r"\b(?:in|on|at|near)\b", what):
        raise RefusalError(f"I cannot look for {listing([what])} in every room", [what])
    commands = tuple(replace(command, goal=None, goal_at=None) for command in finds)
    return replace(reading, commands=commands, state=replace(reading.state, goal=None, at=None))
