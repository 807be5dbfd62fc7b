"""Adds speech, behind the drive to the listener."""

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from executive.language.clauses import CLAUSES, Clause, Cue, trailing_cue
from executive.language.items import predicates
from executive.language.lexicon import lexicon, read_table
from executive.language.limits import refuse_harm
from executive.language.parser import DependencyParser
from executive.language.questions import RefusalError
from executive.language.structure.builder import Builder
from executive.language.structure.conditions import parse_condition
from executive.language.structure.plain import PlainReader, attempt, require, words_to_say
from executive.language.templates import Match, page, words_of
from executive.words.knowledge import Knowledge
from executive.words.leaf_steps import Speak
from skills.inputs.errors import listing

ROOMS: Final = page("rooms")
SPEECH: Final = page("speech", noted=tuple(map(" ".join, lexicon().noted)))


def says(row: Builder, clause: Clause) -> bool:
    """Adds speech, behind the drive to the listener."""
    text = clause.text
    if (match := SPEECH["tells_when"].fullmatch(text)) is not None:
        row.flush()
        statement = parse_condition(match["what"], row.state, row.reader).statement
        told = require(statement, f"what am I to say in '{text}'?", text)
        row.insert([Clause("", match["what"], Cue.SOON, "when"), Clause("", f"tell {match['who']} that {told}")])
        return True
    if not SPEECH["speaks"].match(text) or SPEECH["asks_back"].match(text):
        return False
    if (everywhere := ROOMS["says_everywhere"].fullmatch(text)) is not None:
        left_out = [row.reader.room(each, row.state) for each in re.split(r",? and |, ", everywhere["except"]) if each]
        say_in_each_room(row, everywhere["said"], left_out)
        return True
    if (found := cue_behind_speech(text)) is not None:
        row.modify(clause, found)
        return True
    if (said := _parse_speech(text, row.reader)) is not None:
        _speaks(row, said)
    return said is not None


def cue_behind_speech(text: str) -> Clause | None:
    """Cue that is no part of what is said. Raises RefusalError when that is not clear."""
    if (found := trailing_cue(text)) is None:
        return None
    clear, cue = found.kind is Cue.IF or " that " not in found.before, f"{found.cue} {found.text}".strip()
    require(clear, f"it is not clear whether '{cue}' is a part of what I am to say; say it first", cue)
    said = found.kind in (Cue.TIMES, Cue.EVERY) and found.text and not re.match(r"for|until|every", found.text)
    return None if said else found


def _speaks(row: Builder, said: Match) -> None:
    """Adds speech to a listener, or goes on with speech in each of several places."""
    places, text = re.split(r",? and (?:in |at )?|, ", said["where"]), said.text
    if len(places) > 1:
        row.insert(Clause("", f"announce in {place} that {said['text']}") for place in places)
        return
    clear = not SPEECH["instructs"].fullmatch(said["text"]) or re.match(r"\w+ that ", text)
    require(clear, f"I cannot tell the words to say from where or when in '{text}'; begin 'say that'", text)
    words = require(said["text"] or row.statement, f"what am I to say in '{text}'?", text)
    row.flush()
    goes_to_listener(row, said)
    row.put((Speak(speak=escape_braces(words)),), row.state)


def say_in_each_room(row: Builder, said: str, left_out: Sequence[str] = ()) -> None:
    """Goes on with speech in every room but some."""
    goes = (f"go to the {room}" for room in row.reader.knowledge.rooms if room not in left_out)
    row.insert(Clause("", text) for go in goes for text in (go, said))


def goes_to_listener(row: Builder, to: Match) -> None:
    """Adds the drive to the listener."""
    said, place = to["name"] or to["pronoun"], to["where"]
    if not (said or place or to["speaker"]):
        return
    words = "here" if to["speaker"] else " in ".join(filter(None, (said, place)))
    reading = row.reader.go_to(words, row.state, by="come" if to["speaker"] else "go")
    last = row.steps[-1].commands[-1:] if row.steps and not place else ()
    if any(one.about_person and str(one.object) == reading.commands[-1].goal for one in last):
        return  # the last task has left the robot with that person
    if reading.commands[-1].goal != row.state.goal or reading.commands[-1].goal_at is not None:
        row.add(reading)


def _parse_speech(text: str, reader: PlainReader) -> Match | None:
    """Parses a clause that asks the robot to speak; None for other clauses.

    The match has the `text`, empty if the sentence does not say it ("tell Robin"), and the listener: the `speaker`, a
    `pronoun`, a `name` or everybody (`crowd`), and `where` they are; without these the robot speaks where it is. Raises
    RefusalError when the robot cannot say it in the speaker's place, or does not know the listener.
    """
    forms = reader.forms("speech")
    clear = forms["say_within"].fullmatch(text) is None
    require(clear, f"I do not understand to whom to say '{text}'; name one person at the end", text)
    for intent in ("says_to", "greets_there", "says", "tells", "relays"):
        if (match := forms[intent].fullmatch(text)) is not None:
            if match["polite"]:
                _refuse_harm(match["text"], reader)
            return replace(match, slots={**match.slots, "text": _words(match, intent, reader.pipeline.parser)})
    refuse_stranger(text, reader.knowledge)
    return None


def _refuse_harm(told: str, reader: PlainReader) -> None:
    """Raises RefusalError for a request to somebody that could hurt somebody or break something."""
    words, table = {*words_of(told).words}, read_table("harm.yaml")
    require(not all(words & {*table[kind]} for kind in ("swallows", "poisons")), f"{told!r} could hurt somebody", told)
    items = attempt(reader.read_items, told)
    if not isinstance(items, RefusalError):
        refuse_harm(predicates(items))


def refuse_stranger(text: str, knowledge: Knowledge) -> None:
    """Raises RefusalError for a listener with an unknown name."""
    match = re.match(r"(?:[Tt]ell|[Aa]sk) (?P<who>[A-Z][a-z]+)\b", text)
    names = knowledge.spellings(knowledge.people)
    if match is None or any(name.lower().startswith(match["who"].lower()) for name in names):
        return
    known = f"; known are {listing(knowledge.people)}" if knowledge.people else ""
    raise RefusalError(f"I know no person '{match['who']}'{known}", [match["who"]])


def _words(match: Match, intent: str, parser: DependencyParser) -> str:
    """Words to say; none of "let Robin know it". Raises RefusalError for words that mean something else when said."""
    said = words_to_say(text := f"{match['polite']}{match['text']}")
    if not said or said != text:
        return said  # words in quotes are these words, whatever they mean
    clause = intent != "tells" and is_clause(said, parser)
    nothing = SPEECH["nothing"].fullmatch(said) is not None
    if intent in ("says_to", "says"):
        whom = SPEECH["whom"].fullmatch(said)
        if whom is not None and (not clause or whom["human"]):
            raise RefusalError(f"I do not know to whom to say it: '{whom['whom']}'", [whom["whom"]])
        require(clause or not SPEECH["named"].match(said), f"what are the words of '{said}'?", said)
    else:
        if intent == "relays":
            _refuse_unclear(match, said, clause and not nothing, parser)
        if (inner := CLAUSES["deictic"].search(said) or SPEECH["inner"].search(said)) is not None:
            other = f"'{inner.text}' would mean somebody or something else"
            raise RefusalError(f"I cannot say '{said}' for you: {other}", [said])
    require(not nothing, f"what am I to say? '{said}' says nothing", said)
    return said.strip(" ,.'\"")


def _refuse_unclear(match: Match, said: str, is_statement: bool, parser: DependencyParser) -> None:
    """Raises RefusalError for words to tell that are no statement or greeting, or also say when or whom to tell."""
    text = match.text
    require(not SPEECH["another"].match(said), f"I tell it to one person at a time, not '{text}'", text)
    when = SPEECH["adverbial"].fullmatch(said)
    if when is not None and is_clause(when["told"], parser):
        raise RefusalError(f"I tell it as soon as I am there, not {when['when']!r}", [when["when"]])
    words = SPEECH["greetings"].fullmatch(said) or (is_statement and not match["speaker"])
    require(words, f"I do not understand what to tell in '{text}'; say 'tell ... that ...'", text)


def is_clause(text: str, parser: DependencyParser) -> bool:
    """Returns whether a text is a statement: a finite verb with a subject before it."""
    tokens = parser.parse(text)
    finite = {t.index for t in tokens if t.tag in ("VBZ", "VBP", "VBD", "MD")}
    verbs = finite | {t.index for t in tokens if t.relation == "root"}
    return bool(finite) and any(t.relation in ("nsubj", "nsubjpass", "expl") and t.head in verbs for t in tokens)


def escape_braces(text: str) -> str:
    """Escapes braces in a text."""
    return text.replace("{", "{{").replace("}", "}}")
