"""Words with their position in the sentence and in the dependency tree; known names become single words.

The tagger has seen few commands: it tags "sink" in "the bathroom sink" and a name in lower case after "to" as verbs,
and "look" in "go to the counter look for the bowl" as a noun. `repairs.yaml` has rules for a word and its neighbours,
as in Brill, "A simple rule-based part of speech tagger" (1992).
"""

import re
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any, Final

from pydantic import TypeAdapter

from executive.language.amounts import parse_seconds
from executive.language.lexicon import any_of, expression, lexicon, read_table
from executive.language.nouns import NounKind
from executive.language.task_sentences import task_forms, task_openers, verb_forms
from executive.words.command import is_attribute, may_be_attribute
from executive.words.knowledge import Knowledge
from executive.words.task import Part
from skills.class_forms import NON, known_attributes


@dataclass(frozen=True)
class Token:
    """Word with its position in the sentence and in the dependency tree.

    `start` is the index of its first character, `pos` the universal part of speech, `tag` the Penn tag, `head` the
    index of the word that it depends on (the root's is its own), `relation` the dependency (nsubj, obj, iobj, prep,
    obl, ...), `entity` the entity of a known name (PERSON), `kind` its kind as a noun, and `known` whether the world
    knows the name.
    """

    index: int
    start: int
    text: str
    lemma: str
    pos: str
    tag: str
    head: int
    relation: str
    entity: str = ""
    kind: NounKind | None = None
    known: bool = False

    @property
    def word(self) -> str:
        """Text in lower case."""
        return self.text.lower()

    @property
    def adjective(self) -> bool:
        """Returns whether the word can be an attribute of an object ("red", "heaviest")."""
        return is_attribute(self.text) or (self.pos in ("ADJ", "ADV") and may_be_attribute(self.text))


THING: Final = "cup"
PLACE: Final = "kitchen"
PERSON: Final = "John"
NO_TOKEN: Final = Token(-1, -1, "", "", "", "", -1, "")
"""Stands for the words before and after a sentence."""


def longest_of(phrases: Container[tuple[str, ...]], words: Sequence[str]) -> tuple[str, ...]:
    """Longest of the phrases with which some words begin; empty if they begin with none."""
    beginnings = (tuple(words[:count]) for count in range(len(words), 0, -1))
    return next((beginning for beginning in beginnings if beginning in phrases), ())


def repair_parse(tokens: Iterable[Token]) -> tuple[Token, ...]:
    """Applies the repairs to the words, from left to right."""
    found = list(tokens)
    for at in range(1, len(found)):
        rule = next((rule for rule in _repairs() if rule.fits(found, at)), None)
        if rule is not None:
            rule.apply(found, at)
    return tuple(found)


@dataclass(frozen=True)
class _Repair:
    """Conditions on the words around a word, by relative position, and the word's new values."""

    where: Mapping[int, Mapping[str, str]]
    then: Mapping[int, Mapping[str, str]]
    joins: tuple[int, ...] = ()
    only: str = ".*"

    def fits(self, tokens: Sequence[Token], at: int) -> bool:
        facts = (
            (text, _fact(tokens, at + place, name)) for place, its in self.where.items() for name, text in its.items()
        )
        matches = ((text, re.fullmatch(text.removeprefix("not "), fact)) for text, fact in facts)
        return all((found is None) == text.startswith("not ") for text, found in matches)

    def apply(self, tokens: list[Token], at: int) -> None:
        for place, become in self.then.items():
            head: dict[str, Any] = {"head": max(at + int(become["head"]), 0)} if "head" in become else {}
            tokens[at + place] = replace(tokens[at + place], **{**become, **head})
        if self.joins:
            before, now = (at + place for place in self.joins)
            for n, token in enumerate(tokens[: at - 1]):
                if token.head == before and re.fullmatch(self.only, token.relation):
                    tokens[n] = replace(token, head=now)


@cache
def _repairs() -> tuple[_Repair, ...]:
    return TypeAdapter(tuple[_Repair, ...]).validate_python(read_table("repairs.yaml"))


def _fact(tokens: Sequence[Token], at: int, name: str) -> str:
    """Field of a word, or the name of a test that it passes; empty if it fails, or outside the sentence."""
    if not 0 <= at < len(tokens):
        return ""
    if name in _IS:
        return name if _IS[name](tokens, at) else ""
    kind = tokens[at].kind
    return getattr(tokens[at], name) if name != "kind" else "" if kind is None else kind.value


def _begins_command(tokens: Sequence[Token], at: int) -> bool:
    """Returns whether a known verb with its particles and an object begin here."""
    verb = longest_of(lexicon().verbs, [t.word for t in tokens[at : at + 3]])
    behind = at + len(verb)
    return bool(verb) and behind < len(tokens) and tokens[behind].tag in ("DT", "PRP", "PRP$", "CD")


_IS: Final[Mapping[str, Callable[[Sequence[Token], int], bool]]] = {
    "verb": lambda tokens, at: (tokens[at].word,) in lexicon().verbs,
    "filler": lambda tokens, at: (tokens[at].word,) in lexicon().fillers | lexicon().noted,
    "attribute": lambda tokens, at: is_attribute(tokens[at].text),
    "lower": lambda tokens, at: tokens[at].text.islower(),
    "command": _begins_command,
}

NameTable = tuple[re.Pattern[str], Mapping[str, str]]
"""Pattern of all known names, and the parser's replacement word for each name in lower case."""


def name_table(knowledge: Knowledge) -> NameTable:
    """Table of the names of a world."""
    known = {THING: knowledge.object_names(), PLACE: knowledge.place_names(), PERSON: tuple(knowledge.people)}
    stand_ins = {name.lower(): word for word, names in known.items() for name in knowledge.spellings(names)}
    stand_ins |= {word: word.removeprefix(NON) for word in known_attributes() if word.startswith(NON)}
    letters = [name for name in stand_ins if len(name) == 1]  # "A" is a place, and "a" is none
    names = [any_of(name for name in stand_ins if name not in letters)]
    names += [rf"(?<=\w )(?-i:{letter.upper()})" for letter in letters]
    return re.compile(rf"\b({'|'.join(filter(None, names)) or '(?!)'})(e?s)?\b", re.IGNORECASE), stand_ins


def parse_with_names(
    text: str, parse: Callable[[str], tuple[Token, ...]], table: NameTable | None
) -> tuple[Token, ...]:
    """Parses `text` with each known name as one token; its text is the name as spoken, its lemma the singular."""
    if table is None:
        return parse(text)
    pattern, stand_ins = table
    names: dict[int, re.Match[str]] = {}
    said, end = "", 0
    for match in pattern.finditer(text):
        said += text[end : match.start()]
        names[len(said)] = match
        stand_in, end = stand_ins[match[1].lower()], match.end()
        said += f"{stand_in}s" if match[2] and stand_in != PERSON else stand_in
    tokens = list(parse(said + text[end:]))
    for n, token in enumerate(tokens):
        if (found := names.get(token.start)) is not None:
            entity, known = "PERSON" if token.text == PERSON else "", not is_attribute(found[1])
            tokens[n] = replace(token, text=found[0], lemma=found[1].lower(), entity=entity, known=known)
    return tuple(tokens)


@dataclass(frozen=True)
class _Rule:
    """Rewriting of texts with one of the words `with` (none: of any); `of_work` leaves alone what is to be said."""

    entry: Any
    instead: str | Callable[[re.Match[str]], str]
    of_work: bool

    @cached_property
    def pattern(self) -> re.Pattern[str]:
        """Expression, compiled when the first text has one of the words."""
        return re.compile(_filled(expression(self.entry)), re.IGNORECASE)

    def rewrite(self, text: str) -> str:
        """Rewrites a text."""
        if not any(word in text.lower() for word in self.entry.get("with", [""])):
            return text
        said = next((mark.start() for mark in _SAID.finditer(text)), len(text)) if self.of_work else len(text)
        return self.pattern.sub(self.instead, text[:said]) + text[said:]


_SMOOTHED: Final = ("smoothed", "limited", "asked")
_OF_WORK: Final = ("limited", "shared")  # these leave alone what is to be said
_SAID: Final = re.compile(r"\b(?:say|announce|inform|remind|shout|(?:tell|ask|let) (?!me\b|us\b))", re.IGNORECASE)


def rephrase(text: str) -> str:
    """Simplifies a sentence to a plain command with single blanks: "could you please get it" becomes "get it".

    Hesitations and repeated words are removed. A polite form inside the sentence becomes a comma. "I would like
    something to drink" becomes "bring me a drink".
    """
    return _rewritten(text, None)


def smooth(text: str) -> str:
    """Expands short forms, removes hesitations, asides and repetitions, and joins "tell me" to questions."""
    return re.sub(r"\b([ap])\.\s?m\.?(?![\w'])", r"\1m", _rewritten(text, _SMOOTHED), flags=re.IGNORECASE)


def _rewritten(text: str, families: tuple[str, ...] | None) -> str:
    """Applies the rules of some families, or of all."""
    for rule in _rules(families):
        text = rule.rewrite(text)
    return re.sub(r"^(?:[ ,;:.]|-(?! ?\d))+", "", " ".join(text.split()).rstrip(" ,;:-."))


@cache
def _rules(families: tuple[str, ...] | None) -> tuple[_Rule, ...]:
    table = read_table("rephrasing.yaml")
    entries = ((entry, name in _OF_WORK) for name in families or [*table][1:] for entry in table[name])
    return tuple(_Rule(one, _FUNCTIONS.get(one["instead"], one["instead"]), of_work) for one, of_work in entries)


def _filled(pattern: str) -> str:
    """Expression with the phrases of the tables and the parts that its marks stand for."""
    return re.sub(r"(?<!P)<(\w+)>", lambda mark: _phrases(mark[1]), pattern)


@cache
def _phrases(name: str) -> str:
    parts, timed = read_table("rephrasing.yaml")["parts"], task_openers() - task_openers(Part.TEXT)
    verbs = (first for first, *rest in lexicon().verbs if not rest)
    given = {"verbs": verbs, "tasks": task_openers(), "timed_tasks": timed, "acts": _acts()}
    if name in parts:
        said = _filled(expression(parts[name]))
    else:
        said = any_of(given[name] if name in given else read_table("words.yaml")[name]) or "(?!)"
    own = any_of(timed) if name in ("verbs", "handles") else ""
    return f"(?:{said}|{own})" if own else said


@cache
def _acts() -> Mapping[str, str]:
    """Acts before and after which something is done, by their forms."""
    return {**task_forms(), **read_table("words.yaml")["acts"]}


def in_present(text: str) -> str:
    """Replaces a past form at the beginning of a text by its verb: "gone to the hall" becomes "go to the hall"."""
    first, _, rest = text.partition(" ")
    forms = {**verb_forms(verb for verb, *_ in lexicon().verbs), **_acts()}
    return f"{forms.get(first.lower(), first)} {rest}"


def _break(match: re.Match[str]) -> str:
    """Replaces an opening phrase by a comma, unless there is a comma already or the sentence ends."""
    return ", " if match.string[: match.start()].strip() and match.string[match.end() :].strip(" .!?") else " "


def _each(match: re.Match[str]) -> str:
    """Says an act for each of some places, or of some kinds: "how many cups and cokes are there"."""
    if (kinds := match.groupdict().get("kinds")) is not None:
        return " and ".join(
            f"how many {kind}{match['tail']}" for kind in re.split(r"(?:,? and|,) (?:how many |the |our )?", kinds)
        )
    places = re.split(r",? and (?:(?:in|on|at|to|of) )?|, ", match["places"])
    return " and ".join(f"{match['main']} {place if ' ' in place else f'the {place}'}" for place in places)


def _order(match: re.Match[str]) -> str:
    """Says two acts in their order: "after taking the coke, go home" is "take the coke, then go home"."""
    act = f"{_acts()[match['act'].lower()]}{match['one']}"
    first, then = (match["other"], act) if match["mark"].lower() == "before" else (act, match["other"])
    return f"{first}, then {then}"


def _span(match: re.Match[str]) -> str:
    """Says a time in whole minutes or seconds: "half an hour" is 30 minutes."""
    seconds = parse_seconds(match[0]) or 0.0
    if seconds < 1.0 or not seconds.is_integer():
        return match[0]
    return f"{int(seconds / 60)} minutes" if seconds % 60 == 0 else f"{int(seconds)} seconds"


def _wait(match: re.Match[str]) -> str:
    """Puts the wait for the time of an act first; leaves alone what could be the time of a part of it."""
    at = match["at"].replace("at ", "until ").removeprefix("in ")
    return match[0] if re.search(r"\b(?:and|now|call)\b", match["main"]) else f"wait {at}, then {match['main']}"


_FUNCTIONS: Final[Mapping[str, Callable[[re.Match[str]], str]]] = {
    "$full": lambda match: lexicon().short_forms[match[0].lower()],
    "$break": _break,
    "$each": _each,
    "$order": _order,
    "$span": _span,
    "$wait": _wait,
}
