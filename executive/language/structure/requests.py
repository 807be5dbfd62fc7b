"""Parses special requests: waits, charging, speech, questions, deliveries, searches of all rooms, people to follow."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from executive.language.amounts import parse_seconds, parse_share, parse_time
from executive.language.clauses import CLAUSES, trailing_cue
from executive.language.items import verb
from executive.language.lexicon import any_of, lexicon
from executive.language.nouns import NounKind
from executive.language.parser import DependencyParser
from executive.language.questions import RefusalError
from executive.language.roles import Location
from executive.language.structure.conditions import FULL, Done, parse_condition, parse_opening, usual_condition
from executive.language.structure.plain import (
    PlainReader,
    PlainReading,
    State,
    names_of_world,
    person_named,
    phrase_of_name,
)
from executive.language.templates import Match, page
from executive.words.command import SPEAKER, START, Command, Task
from executive.words.knowledge import ANYBODY, Knowledge
from executive.words.leaf_steps import Awaited, Charging, Dock, Picture, Subject, Wait, steps_of_commands
from executive.words.step import Step
from executive.words.steps import Steps
from skills.api import ObjectKind
from skills.inputs.errors import listing, with_article

_WAITING: Final = page("waiting")
_PICTURE: Final = page("pictures")["picture"]
ROOMS: Final = page("rooms")
SPEECH: Final = page("speech")
PEOPLE: Final = page("people")
_SUBJECTS: Final = r"(?:the|a|an|my|your|our|his|her|their|this|all|every)\b"
_ADVERBIAL: Final = re.compile(
    rf"(?!{_SUBJECTS})([\w' ]+?),? that (?=\w)|({any_of(map(' '.join, lexicon().noted))}) ", re.IGNORECASE
)
"""Words before what is told that say when or how it is told."""


def parse_wait(text: str, known: Callable[[], State], reader: PlainReader) -> Done | None:
    """Parses a wait in a place: until a condition holds, while it holds, or for a person ("for").

    Returns None for other texts, and for a wait of a given duration. Raises RefusalError when the place or the
    condition cannot be understood.
    """
    match = _WAITING["wait"].fullmatch(text)
    if match is None or _WAITING["only_span"].fullmatch(match["what"]):
        return None
    (steps, there), how, what = _gone(match["where"], known(), reader), match["how"].lower(), match["what"]
    if how in ("until", "till"):
        ends = _WAITING["ends"].fullmatch(what)
        if (seconds := parse_seconds("" if ends is None else ends["span"])) is not None:
            return (*steps, Wait(awaited=Awaited(seconds=seconds))), there
        if (time := parse_time(what if ends is None else ends["time"])) is not None:
            return (*steps, Wait(awaited=Awaited(until_clock=time.text))), there.noting(time.notes(what))
        found = parse_condition(what, there, reader)
    elif how != "for":
        found = parse_condition(what, there, reader).negate(what)
    else:
        who, at = what, _WAITING["person_at"].fullmatch(what)
        if at is not None and reader.is_somebody(at["who"], there):
            reading = reader.go_to(at["where"], there)
            steps, there, who = (*steps, *steps_of_commands(reading.commands)), reading.state, at["who"]
        event = f"{who} is here" if reader.is_somebody(who, there) else _WAITING["button"].reword(what, whole=True)
        usual = usual_condition(event, there, reader)
        if usual is None:
            raise RefusalError(f"I do not understand what to wait for: '{what}'", [what])
        found = usual
    after = replace(found.holds, goal=found.holds.goal or there.goal)
    return (*steps, Wait(awaited=Awaited(condition=found.condition))), after


def _gone(where: str, state: State, reader: PlainReader) -> Done:
    """Adds the drive to the place of a wait."""
    if _WAITING["here"].fullmatch(where):
        return (), state
    match = _WAITING["place"].fullmatch(where)
    if match is None:
        raise RefusalError(f"I do not understand where to wait: '{where}'", [where])
    if match["there"] and state.goal is not None and state.at is not None:
        return (), state
    reading = reader.go_to(match["place"] or "there", state)
    return steps_of_commands(reading.commands), reading.state


def parse_charging(text: str, known: Callable[[], State], reader: PlainReader) -> Done | None:
    """Parses charging up to a level; None if the text states no level."""
    if (match := _WAITING["charge"].fullmatch(text)) is None:
        return None
    level = FULL if match["full"] else parse_share(match["level"])
    if level is None:
        raise RefusalError(f"'{match['level']}' is no charge; say it in percent", [match["level"]])
    return (Dock(charging=Charging(level=level)),), known().elsewhere


def parse_pictures(text: str, known: Callable[[], State], reader: PlainReader) -> Done | None:
    """Parses a request for pictures; None for other texts. Raises RefusalError for an unknown name."""
    if (match := _PICTURE.fullmatch(text)) is None or trailing_cue(text) is not None:
        return None
    state, steps = known(), list[Step]()
    at = (match["at"] or None) and reader.go_to(match["at"], state).commands[0].goal
    for what in re.split(r",? and |, ", match["of"]):
        of = reader.knowledge.place(re.sub(r"^(?:the|a|an|my|our|your) ", "", what, flags=re.IGNORECASE))
        if of is None:
            found = reader.read_commands(what, state, (verb("find"),)).commands[0].object
            if found is not None and found.relations:
                raise RefusalError(f"I cannot tell in a picture which one is '{what}'", [what])
            of = str(found)
        steps.append(Picture(subject=Subject(of=of, at=at, camera=match["camera"] or None)))
    return tuple(steps), state.elsewhere


REQUESTS: Final = (parse_opening, parse_pictures, parse_charging, parse_wait)


@dataclass(frozen=True)
class QuestionRequest:
    """Question to a person, the objects to choose from (with their articles), and whether its answer is yes or no."""

    text: str
    of: Match
    choices: tuple[str, ...]
    yes_or_no: bool = False


def parse_speech(text: str, reader: PlainReader) -> Match | None:
    """Parses a clause that asks the robot to speak; None for other clauses.

    The match has the `text`, empty if the sentence does not say it ("tell Robin"), and the listener: the `speaker`, a
    `pronoun`, a `name` or everybody (`crowd`), and `where` they are; without these the robot speaks where it is. Raises
    RefusalError when the robot cannot say it in the speaker's place, or does not know the listener.
    """
    forms = page("speech", **names_of_world(reader.knowledge))
    if forms["say_within"].fullmatch(text) is not None:
        raise RefusalError(f"I do not understand to whom to say '{text}'; name one person at the end", [text])
    for intent, words in _WORDS.items():
        if (match := forms[intent].fullmatch(text)) is not None:
            return replace(match, slots={**match.slots, "text": words(match, reader.pipeline.parser)})
    _refuse_stranger(text, reader.knowledge)
    return None


def _refuse_stranger(text: str, knowledge: Knowledge) -> None:
    """Raises RefusalError for a listener with an unknown name."""
    match = re.match(r"(?:[Tt]ell|[Aa]sk) (?P<who>[A-Z][a-z]+)\b", text)
    names = knowledge.spellings(knowledge.people)
    if match is None or any(name.lower().startswith(match["who"].lower()) for name in names):
        return
    known = f"; known are {listing(knowledge.people)}" if knowledge.people else ""
    raise RefusalError(f"I know no person '{match['who']}'{known}", [match["who"]])


def _relayed(match: Match, parser: DependencyParser) -> str:
    """Words of "tell Robin dinner is ready"; none of "let Robin know it"."""
    said, text = match["text"], match.text
    if re.match(r"(?:and|or)\b", said, re.IGNORECASE):
        raise RefusalError(f"I tell it to one person at a time, not '{text}'", [text])
    if re.fullmatch(r"|so|it|that|about it|about that", said, re.IGNORECASE):
        return ""
    adverbial = _ADVERBIAL.match(said)
    if adverbial is not None and is_clause(said[adverbial.end() :], parser):
        raise RefusalError(f"I tell it as soon as I am there, not {adverbial[1] or adverbial[2]!r}", [adverbial[0]])
    states = not (match["speaker"] or SPEECH["question"].match(said)) and is_clause(said, parser)
    if SPEECH["greetings"].fullmatch(said) or states:
        return _told(match, parser)
    raise RefusalError(f"I do not understand what to tell in '{text}'; say 'tell ... that ...'", [text])


def is_clause(text: str, parser: DependencyParser) -> bool:
    """Returns whether a text is a statement: a finite verb with a subject before it."""
    tokens = parser.parse(text)
    finite = {t.index for t in tokens if t.tag in ("VBZ", "VBP", "VBD", "MD")}
    verbs = finite | {t.index for t in tokens if t.relation == "root"}
    return bool(finite) and any(t.relation in ("nsubj", "nsubjpass", "expl") and t.head in verbs for t in tokens)


def _said(match: Match, parser: DependencyParser) -> str:
    """Words to say. Raises RefusalError when they describe a text, or name an unknown person."""
    text, clause = match["text"], is_clause(match["text"], parser)
    whom = re.search(r" to (?:the|a|an|my|our|all|every|each|some|any|somebody|someone)\b.*$", text, re.IGNORECASE)
    if whom is not None and (not clause or re.search(r"\b(?:person|guest|visitor)\b", whom[0], re.IGNORECASE)):
        raise RefusalError(f"I do not know to whom to say it: '{whom[0].strip()}'", [whom[0].strip()])
    if SPEECH["named"].match(text) and not clause:
        raise RefusalError(f"what are the words of '{text}'?", [text])
    return _literal(text)


def _literal(text: str) -> str:
    """Words to say literally. Raises RefusalError when they only describe a text."""
    if SPEECH["nothing"].fullmatch(text) or SPEECH["question"].match(text) or re.match(r"to\b", text, re.IGNORECASE):
        raise RefusalError(f"what am I to say? '{text}' says nothing", [text])
    return text.strip(" ,.'\"")


def _told(match: Match, parser: DependencyParser) -> str:
    """Statement as the robot says it for the speaker. Raises RefusalError when this would change the meaning."""
    text = f"{match['polite']}{match['text']}"
    word = CLAUSES["deictic"].search(text) or SPEECH["inner"].search(text)
    if word is not None:
        meant = "would mean somebody or something else"
        raise RefusalError(f"I cannot say '{text}' for you: '{word.text}' {meant}", [text])
    return _literal(text)


_WORDS: Final[dict[str, Callable[[Match, DependencyParser], str]]] = {
    "says_to": _said,
    "says": _said,
    "formula": lambda match, _: match["text"],
    "tells": _told,
    "relays": _relayed,
}
"""Intents of speech, and how the words to say are found."""


def escape_braces(text: str) -> str:
    """Escapes braces in a text."""
    return text.replace("{", "{{").replace("}", "}}")


def parse_question(text: str, knowledge: Knowledge) -> QuestionRequest | None:
    """Parses a clause that tells the robot to ask somebody a question; None for other clauses.

    Raises RefusalError for a question that the robot cannot put.
    """
    forms = page("speech", **names_of_world(knowledge))
    if not re.match(r"ask\b", text, re.IGNORECASE) or forms["tells"].fullmatch(text):
        return None
    match = forms["wants_one"].fullmatch(text) or forms["wants_what"].fullmatch(text)
    if match is None or not match["name"]:
        _refuse_stranger(text, knowledge)
        able = "I can ask somebody by name whether they want this or that"
        raise RefusalError(f"I do not understand the question in '{text}'; {able}", [text])
    if not match["what"]:  # what he wants to drink: a choice among all known objects of that kind
        kind = (match["kind"] or match["drink"]).lower()
        names = knowledge.classes(kind.removesuffix("s")) if kind else ()
        if not names:
            raise RefusalError(f"I do not know what there is to choose from in '{text}'; name it", [text])
        spoken = f"Which {kind} do you want?" if match["kind"] else "What do you want to drink?"
        return QuestionRequest(spoken, match, tuple(map(with_article, names)))
    if (word := CLAUSES["deictic"].search(match["what"])) is not None:
        raise RefusalError(f"I cannot ask that for you: '{word.text}' would mean somebody else", [text])
    choices = tuple(re.split(r",? or |, ", match["what"], flags=re.IGNORECASE))
    return QuestionRequest(f"Do you want {match['what']}?", match, choices, yes_or_no=len(choices) == 1)


def steps_for_everyone(text: str, known: Callable[[], State], reader: PlainReader) -> Done | None:
    """Builds a delivery to each person in a group; None if the recipient is no group.

    Raises RefusalError when no room is named, no known person is there, or there is only one such object.
    """
    if ROOMS["gives"].match(text) is None or ROOMS["everyone"].search(text) is None:
        return None
    begun = state = known()
    trace = reader.read(state, text, upto="understanding", elliptic=True).trace
    named = [(one.goal, one.goal.phrase.spoken) for one in trace.actions if one.goal and one.goal.phrase]
    to, who = next(((goal, said) for goal, said in named if ROOMS["everyone"].fullmatch(said)), (None, ""))
    if to is None:
        return None
    if to.within is None or to.within.phrase is None:
        raise RefusalError(f"I bring objects to one person at a time, not to {who}; name one, or a room", [who])
    room, knowledge = reader.room(to.within.phrase.spoken, state), reader.knowledge
    people = [name for name, facts in knowledge.people.items() if knowledge.room(facts.at) == room]
    if not people:
        raise RefusalError(f"I know nobody in the {room} to bring anything to: {who}", [who])
    steps: Steps = ()
    for name in people:
        goal = person_named(name, to.within)
        actions = tuple(replace(one, goal=goal) if one.goal == to else one for one in trace.actions)
        reading = reader.read(begun, behind="understanding", actions=actions, notes=trace.notes)
        if any(action.target is not None and not action.target.indefinite for action in reading.trace.resolved):
            raise RefusalError(f"there is only one of it, and I cannot bring it to {who}; name one person", [who])
        steps, begun = (*steps, *steps_of_commands(reading.commands)), replace(reading.state, memory=state.memory)
    return steps, begun


def search_for(what: str, state: State, reader: PlainReader) -> PlainReading:
    """Understands a search for an object or a person in all rooms. Raises RefusalError when it is unclear."""
    reading = reader.read_commands(what, state, (verb("find"),))
    if any(one.task is not Task.FIND for one in reading.commands) or re.search(r"\b(?:in|on|at|near)\b", what):
        raise RefusalError(f"I cannot look for {listing([what])} in every room", [what])
    commands = tuple(replace(command, goal=None, goal_at=None) for command in reading.commands)
    return replace(reading, commands=commands, state=reading.state.elsewhere)


_TASKS: Final = {"follow": Task.FOLLOW, "guide": Task.GUIDE, "greet": Task.GREET}
"""Tasks of the intents; the robot goes to the person for the other intents."""


def parse_people(text: str, knowledge: Knowledge) -> Match | None:
    """Parses a clause about following, guiding, meeting or greeting people; None for other clauses.

    The match has its intent as `form`, the person `who` (empty: the speaker), and the places `at` and `to`. Raises
    RefusalError when such a clause does not say clearly whom it means.
    """
    forms = page("people", **names_of_world(knowledge))
    text = text if (around := forms["around"].fullmatch(text)) is None else around["clause"]
    for name in (*_TASKS, "meet", "find", "stated"):
        if (match := forms[name].fullmatch(text)) is not None:
            return replace(match, slots={**match.slots, "form": name})
    if forms["certain"].match(text) is None or forms["greets_known"].match(text) is not None:
        return None
    known = f"; known are {listing(knowledge.people)}" if knowledge.people else ""
    hint = f"name one person, or say 'the person in the kitchen'{known}"
    if (cue := trailing_cue(text)) is not None and parse_people(cue.before, knowledge) is not None:
        what, hint = f"I cannot do '{cue.before}' {cue.cue} {cue.text}", "I do it up to a place, or until you say stop"
    elif (unseen := forms["unseen"].search(text)) is not None:
        what = f"I cannot tell people apart by {unseen['by']}, such as '{unseen.text}'"
    elif (crowd := forms["crowd"].search(text)) is not None:
        what = f"I follow and guide one person at a time, not '{crowd.text}'"
    else:
        what = f"I do not understand whom and where '{text}' means"
    raise RefusalError(f"{what}; {hint}", [text])


def refers_to_person(match: Match) -> bool:
    """Returns whether a pronoun refers to the person of a request."""
    return bool(match["him"] or match["that_person"])


def steps_on_people(match: Match, state: State, reader: PlainReader) -> Done:
    """Builds the steps for a request, with the state after them. Raises RefusalError."""
    person, knowledge, refers = _person(match, state, reader), reader.knowledge, refers_to_person(match)
    said, task, to, where = match.text, _TASKS.get(match["form"]), match["to"], match["at"]
    if not where and person == ANYBODY and refers and state.memory.person is None and state.memory.place:
        where = "there"
    at, goal = (_place(text, state, reader) if text else None for text in (where, to))
    if to.lower() == "home" and goal is None:
        if person not in knowledge.people:
            raise RefusalError(f"{said}: which room is home?", ["home"], question=True)
        goal = knowledge.room(knowledge.people[person].at)
        state = state.noting([f"I take {person}'s home to be the {goal}"])
    here = state.goal if state.goal is not None and knowledge.place(state.goal) is not None else None
    verb = said.split()[0].lower()
    if (at or here) is None and (task is Task.GREET or (task is None and person == ANYBODY)):
        raise RefusalError(f"{said}: in which room?", question=True)
    if task is Task.GUIDE and goal is None:
        raise RefusalError(f"{said}: where to?", question=True)
    if person == SPEAKER and goal == START:
        raise RefusalError(f"{said}: you are here; name another place", [said])
    if task is Task.GREET:
        count = 0 if person == ANYBODY and not match["one"] else 1
        commands = [Command(goal=at or here, task=task, object=ObjectKind(ANYBODY), object_count=count, verb=verb)]
    elif task is None:
        commands = _go_to(person, at or here, verb, state)
    else:
        first = [] if at is None else _go_to(person, at, verb, state)
        commands = [*first, Command(goal=goal, task=task, object=ObjectKind(person), verb=verb)]
    memory = replace(state.memory, person=person_named(person))
    last = commands[-1] if commands else Command()
    if last.goal is not None and knowledge.place(last.goal) is not None:
        memory = replace(memory, place=Location(phrase_of_name(last.goal, NounKind.PLACE), "in"))
    after = reader.state_after(commands, memory, state)
    gone = last.task is Task.FOLLOW and last.goal is None
    return steps_of_commands(commands), after.elsewhere if gone else after


def _go_to(person: str, at: str | None, verb: str, state: State) -> list[Command]:
    """Goes to a known person at a place; for anybody only to the place, unless the robot is there already."""
    if person != ANYBODY:
        return [Command(goal=person, goal_at=at, verb=verb)]
    return [] if at == state.goal else [Command(goal=at, verb=verb)]


def _person(match: Match, state: State, reader: PlainReader) -> str:
    """Person that a request is about: known, the speaker or anybody. Raises RefusalError for an unclear pronoun."""
    before = state.memory.person
    if not match["who"]:
        if match["at"]:
            raise RefusalError(f"you are not there: '{match.text}'; say only where to", [match["at"]])
        return SPEAKER
    if refers_to_person(match) and before is not None and match["form"] != "greet":
        return reader.knowledge.person(before.name) or before.name
    if match["him"] and not state.somebody:
        raise RefusalError(f"who is meant by '{match['who']}' in '{match.text}'?", [match["who"]], question=True)
    return reader.knowledge.person(match["who"]) or ANYBODY


def _place(text: str, state: State, reader: PlainReader) -> str | None:
    """World's name for a place in words; None for "home" where no place is called so. Raises RefusalError."""
    if text.lower() == "home":
        return reader.knowledge.place(text)
    return START if text.lower() in ("here", "back") else reader.place(text, state)
