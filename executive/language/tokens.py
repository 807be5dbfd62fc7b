"""Words with their place in the sentence and in the tree of dependencies, known names among them.

The tagger has seen few commands: it reads "sink" in "the bathroom sink" and a name in lower case behind "to" as verbs,
and "look" in "go to the counter look for the bowl" as a noun. Each repair looks at a word and its neighbours, as in
Brill, "A simple rule-based part of speech tagger" (1992)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Final

from executive.language.lexicon import lexicon, read_table
from executive.language.nouns import NounKind
from executive.words.command import is_attribute, may_be_attribute
from executive.words.knowledge import Knowledge
from skills.detect.words import plural

__all__ = ["NameTable", "Token", "corrected_parse", "name_table", "parse_with_names", "rephrased", "smoothed"]


@dataclass(frozen=True)
class Token:
    """A word with its place in the sentence and in the tree.

    `start` is its first character in the text, `pos` the universal part of speech, `tag` the Penn tag, `head` the
    index of the word that it depends on (its own for the root), `relation` how (nsubj, obj, iobj, prep, obl, ...),
    `entity` what a known name is part of (PERSON), `kind` what kind of thing it would stand for as a noun,
    and `known` whether the world knows the name.
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
        """The text in lower case."""
        return self.text.lower()

    @property
    def adjective(self) -> bool:
        """Whether it can be an attribute of a thing ("red", "heaviest")."""
        return is_attribute(self.text) or (self.pos in ("ADJ", "ADV") and may_be_attribute(self.text))


_AFTER_NOUN: Final = frozenset({"", "ADP", "PUNCT", "CCONJ", "INTJ"})
_BEGINS_OBJECT: Final = frozenset({"DT", "PRP", "PRP$", "CD"})
_DEMONSTRATIVES: Final = frozenset({"that", "this", "these", "those"})
_BEFORE_INFINITIVE: Final = frozenset({"want", "need", "like", "love", "have", "try", "wish", "hope", "plan", "ask"})
_BEFORE_NOUN: Final = frozenset({"det", "amod", "compound", "nmod", "nummod", "poss"})


def corrected_parse(tokens: Iterable[Token]) -> tuple[Token, ...]:
    """The words with their repairs, from left to right."""
    found = list(tokens)
    for at in range(1, len(found)):
        if found[at].word == "no" and _pos(found, at + 1) not in ("NOUN", "ADJ"):
            found[at] = replace(found[at], pos="INTJ", tag="UH", relation="intj")
        elif _contracted(found, at):
            found[at] = replace(found[at], pos="AUX", tag="VBZ", lemma="be", relation="root")
        elif _particle_within(found, at):
            found[at] = replace(found[at], relation="compound", head=at + 1)
        elif _named_thing(found, at) or _container(found, at) or _noun(found, at):
            _join_noun(found, at)
        elif _paired(found, at):
            found[at] = replace(found[at], pos="NOUN", tag="NN", relation="conj", head=at - 2)
        elif _name(found, at):
            found[at] = replace(found[at], pos="PROPN", tag="NNP", relation="obl", head=at - 1)
        elif _goal(found, at) or _department(found, at):
            found[at] = replace(found[at], pos="NOUN", tag="NN", relation="obl", head=at - 1)
        elif found[at].pos == "NOUN" and (found[at - 1].tag, found[at - 1].relation) == ("DT", "mark"):
            found[at - 1] = replace(found[at - 1], relation="det", head=at)
        elif _place_one(found, at):
            found[at] = replace(found[at], pos="NUM", tag="CD", relation="nummod", head=at - 1)
            found[at - 1] = replace(found[at - 1], relation="obl", head=max(at - 2, 0))
        elif _shown(found, at):
            _show(found, at)
        elif _command(found, at):
            _part_verb(found, at)
    return tuple(found)


def _contracted(tokens: Sequence[Token], at: int) -> bool:
    """Whether "'s" is the verb and no possessive: a preposition follows ("Anna's in the hall")."""
    behind = tokens[at + 1 : at + 2]
    return tokens[at].tag == "POS" and tokens[at].word == "'s" and bool(behind) and behind[0].tag in ("IN", "VBG")


def _particle_within(tokens: Sequence[Token], at: int) -> bool:
    """Whether a particle stands within the name of a thing ("the washing up liquid")."""
    article = at > 1 and tokens[at - 2].pos == "DET"
    gerund = article and tokens[at - 1].word.endswith("ing") and tokens[at].tag == "RP"
    return gerund and _pos(tokens, at + 1) == "NOUN"


def _named_thing(tokens: Sequence[Token], at: int) -> bool:
    """Whether a word behind an article that was read as an adverb is the noun ("the brolly")."""
    adverb = tokens[at].tag == "RB" and tokens[at - 1].tag in ("DT", "PRP$")
    return adverb and _pos(tokens, at + 1) in _AFTER_NOUN


def _container(tokens: Sequence[Token], at: int) -> bool:
    """Whether "can" behind a noun is no auxiliary: no verb and no subject follows ("the trash can")."""
    can = tokens[at].word == "can" and tokens[at].tag == "MD"
    alone = _pos(tokens, at - 1) == "NOUN" and _pos(tokens, at + 1) in _AFTER_NOUN
    return can and (alone or tokens[at - 1].tag in ("DT", "PRP$"))


def _noun(tokens: Sequence[Token], at: int) -> bool:
    """Whether a verb or a name in lower case behind a noun has nothing to do there, and can be a place or a thing."""
    token = tokens[at]
    verb = token.pos == "VERB" and token.tag in ("VB", "VBP") and _pos(tokens, at - 1) == "NOUN"
    past = token.tag in ("VBD", "VBN") and (token.word,) not in lexicon().fillers
    verb = verb or (past and token.kind is NounKind.PLACE and tokens[at - 1].pos == "NOUN")
    verb = verb or (token.pos == "PROPN" and token.text.islower() and _pos(tokens, at - 1) == "NOUN")
    alone = _pos(tokens, at + 1) in _AFTER_NOUN and not _begins_command(tokens, at)
    return verb and alone and token.kind in (NounKind.PLACE, NounKind.THING)


def _paired(tokens: Sequence[Token], at: int) -> bool:
    """Whether a verb behind a noun and "and" is the second noun of a pair ("a knife and fork")."""
    token = tokens[at]
    verb = token.tag in ("VB", "VBP") and token.pos == "VERB" and (token.word,) not in lexicon().verbs
    pair = at > 1 and tokens[at - 1].word == "and" and tokens[at - 2].kind is NounKind.THING
    return verb and pair and token.kind is NounKind.THING and _pos(tokens, at + 1) in _AFTER_NOUN


def _name(tokens: Sequence[Token], at: int) -> bool:
    """Whether a verb behind "to" is somebody's name ("bring it to skyler")."""
    return tokens[at].pos == "VERB" and tokens[at - 1].word == "to" and tokens[at].kind is NounKind.PERSON


def _goal(tokens: Sequence[Token], at: int) -> bool:
    """Whether a verb behind "to" is a place and no infinitive ("proceed to checkpoint four", "run to park")."""
    behind_to = tokens[at].pos == "VERB" and tokens[at].tag == "VB" and tokens[at - 1].word == "to" and at > 1
    if not behind_to or tokens[at - 2].lemma in _BEFORE_INFINITIVE or tokens[at - 2].tag in ("WRB", "JJ"):
        return False
    numbered = _pos(tokens, at + 1) == "NUM" and _pos(tokens, at + 2) in _AFTER_NOUN
    good = tokens[at].kind is NounKind.PLACE or (numbered and tokens[at].kind is NounKind.THING)
    return good and (numbered or _pos(tokens, at + 1) in _AFTER_NOUN) and (tokens[at].word,) not in lexicon().verbs


def _department(tokens: Sequence[Token], at: int) -> bool:
    """Whether a word in "-ing" behind a preposition is a place ("to Angela in accounting")."""
    token = tokens[at]
    place = token.tag == "VBG" and token.kind is NounKind.PLACE and _pos(tokens, at - 1) == "ADP"
    return place and _pos(tokens, at + 1) in _AFTER_NOUN


def _shown(tokens: Sequence[Token], at: int) -> bool:
    """Whether a verb behind "that" is the noun which is pointed at ("hand me that clamp")."""
    token, that = tokens[at], tokens[at - 1]
    verb = token.pos == "VERB" and token.tag in ("VB", "VBP", "VBD") and token.kind is NounKind.THING
    pointed = that.word in _DEMONSTRATIVES and at > 1 and tokens[at - 2].pos in ("VERB", "PRON", "ADP")
    return verb and pointed and (token.word,) not in lexicon().verbs and _pos(tokens, at + 1) not in ("PRON", "DET")


def _place_one(tokens: Sequence[Token], at: int) -> bool:
    """Whether "one" is the number of a place without article ("room one"), unlike "the kitchen one"."""
    before = tokens[max(at - 3, 0) : at]
    bare = tokens[at].word == "one" and not any(t.pos == "DET" or t.relation in ("det", "poss") for t in before)
    return bare and before[-1].pos in ("NOUN", "PROPN") and before[-1].kind is NounKind.PLACE


def _command(tokens: Sequence[Token], at: int) -> bool:
    """Whether a noun behind a noun is a known verb before its object ("the counter look for the bowl")."""
    before = tokens[at - 1]
    noun = before.pos == "NOUN" or (before.pos == "ADJ" and before.kind in (NounKind.PLACE, NounKind.THING))
    return tokens[at].pos == "NOUN" and noun and not is_attribute(before.text) and _begins_command(tokens, at)


def _begins_command(tokens: Sequence[Token], at: int) -> bool:
    """Whether a verb that the robot knows, with its particles, and an object stand here."""
    words = tuple(t.word for t in tokens[at : at + 3])
    lengths = (n for n in range(len(words), 0, -1) if words[:n] in lexicon().verbs)
    length = next(lengths, None)
    behind = tokens[at + length : at + length + 1] if length is not None else []
    return bool(behind) and behind[0].tag in _BEGINS_OBJECT


def _pos(tokens: Sequence[Token], at: int) -> str:
    return tokens[at].pos if 0 <= at < len(tokens) else ""


def _join_noun(tokens: list[Token], at: int) -> None:
    """Make a word a noun, to which the noun before it and what depends on that belong."""
    relation = "compound" if tokens[at - 1].pos == "NOUN" else "det"
    tokens[at - 1] = replace(tokens[at - 1], head=at, relation=relation)
    tokens[at] = replace(tokens[at], pos="NOUN", tag="NN", relation="obl")
    for n in range(at - 1):
        if tokens[n].head == at - 1:
            tokens[n] = replace(tokens[n], head=at)


def _show(tokens: list[Token], at: int) -> None:
    """Make a word a noun, or a part of the one behind it, and "that" before it its article."""
    whole = _pos(tokens, at + 1) == "NOUN"
    head = at + 1 if whole else at
    tokens[at - 1] = replace(tokens[at - 1], pos="DET", tag="DT", relation="det", head=head)
    relation, above = ("compound", head) if whole else ("obj", at - 2)
    tokens[at] = replace(tokens[at], pos="NOUN", tag="NN", relation=relation, head=above)


def _part_verb(tokens: list[Token], at: int) -> None:
    """Make a word a verb, and the noun before it a noun of its own with what stood before both."""
    tokens[at] = replace(tokens[at], pos="VERB", tag="VB")
    tokens[at - 1] = replace(tokens[at - 1], pos="NOUN", tag="NN", relation="obl", head=at)
    for n in range(at - 1):
        if tokens[n].head == at and tokens[n].relation in _BEFORE_NOUN:
            tokens[n] = replace(tokens[n], head=at - 1)


THING: Final = "cup"
PLACE: Final = "kitchen"
PERSON: Final = "John"


@dataclass(frozen=True)
class NameTable:
    """The pattern that finds any known name, and for each name in lower case the word that stands in for it."""

    pattern: re.Pattern[str]
    stand_ins: Mapping[str, str]


def name_table(knowledge: Knowledge) -> NameTable:
    """The names of a world, longest first."""
    things = [*(n for name, facts in knowledge.things.items() for n in (name, *facts.aliases)), *knowledge.categories()]
    places = [n for g in (knowledge.places, knowledge.surfaces) for name, f in g.items() for n in (name, *f.aliases)]
    people = [n for name, facts in knowledge.people.items() for n in (name, *facts.aliases)]
    stand_ins = {name.lower(): THING for name in things}
    stand_ins |= {name.lower(): PLACE for name in places}
    stand_ins |= {name.lower(): PERSON for name in people}
    longest_first = sorted(stand_ins, key=len, reverse=True)
    pattern = re.compile(rf"\b({'|'.join(map(re.escape, longest_first)) or '(?!)'})(e?s)?\b", re.IGNORECASE)
    return NameTable(pattern, stand_ins)


def parse_with_names(
    text: str, parse: Callable[[str], tuple[Token, ...]], table: NameTable | None
) -> tuple[Token, ...]:
    """Parse `text` with each known name as one token, whose text and lemma are the name as spoken and in singular."""
    if table is None:
        return parse(text)
    names: dict[int, re.Match[str]] = {}
    pieces: list[str] = []
    end = 0
    for match in table.pattern.finditer(text):
        pieces.append(text[end : match.start()])
        names[sum(map(len, pieces))] = match
        plural = "s" if match.group(2) and table.stand_ins[match.group(1).lower()] != PERSON else ""
        pieces.append(table.stand_ins[match.group(1).lower()] + plural)
        end = match.end()
    tokens = parse("".join([*pieces, text[end:]]))
    return tuple(_named(token, names.get(token.start), token.text) for token in tokens)


def _named(token: Token, match: re.Match[str] | None, stand_in: str) -> Token:
    if match is None:
        return token
    entity = "PERSON" if stand_in == PERSON else ""
    return replace(token, text=match.group(0), lemma=match.group(1).lower(), entity=entity, known=True)


@dataclass(frozen=True)
class Affirmed:
    """A statement without its negation: its words, those to pass over, and whether it was denied.

    "There is no beer in the hall" is affirmed by "any beer", "nobody is there" by "anybody", "it is not there" by
    leaving out the "not".
    """

    tokens: tuple[Token, ...]
    silent: frozenset[int] = frozenset()
    denied: bool = False


def affirmed(tokens: Sequence[Token], *, there: bool = False) -> Affirmed:
    """What a statement says, or denies, to be somewhere; one that is denied in another way stays as it is.

    `there` says that "there is" stands before it.
    """
    words = [token.word for token in tokens]
    be = next((n for n, token in enumerate(tokens) if token.lemma == "be" or token.word in ("'s", "'re")), len(words))
    seen = words[:1] == ["there"]
    for at in (0, be + 1):
        for said, instead in _DENYING.items():
            if tuple(words[at : at + len(said)]) == said and (
                seen if at else there or (instead in _WHOEVER and be == len(said))
            ):
                return Affirmed(_instead(tokens, at, instead), frozenset(range(at + 1, at + len(said))), denied=True)
    at, behind = be + 1, words[be + 2 :]
    if words[at : at + 1] in (["not"], ["n't"]):
        more = 2 if behind[:2] == ["any", "more"] else 1 if behind[:1] in (["anymore"], ["yet"]) else 0
        if seen:
            whole = behind[:1] and behind[0] not in ("one", "any", "a", "an", "enough", "left")
            one = behind[:1] == ["any"] and behind[1:2] in ([], ["left"], ["in"], ["on"], ["at"])
            changed = _instead(tokens, at + 1, "one") if one else tokens
            return Affirmed(tuple(changed), frozenset({at}), denied=not whole)
        if behind[more : more + 1] and behind[more] in _SOMEWHERE:
            return Affirmed(tuple(tokens), frozenset(range(at, at + 1 + more)), denied=True)
    if words[at : at + 2] == ["no", "longer"] and behind[1:2] and behind[1] in _SOMEWHERE:
        return Affirmed(tuple(tokens), frozenset({at, at + 1}), denied=True)
    if words[at : at + 1] in (["gone"], ["missing"]) and behind[:1] == ["from"]:
        return Affirmed(_instead(tokens, at + 1, "in"), frozenset({at}), denied=True)
    return Affirmed(tuple(tokens))


def _instead(tokens: Sequence[Token], at: int, word: str) -> tuple[Token, ...]:
    """The words with another one in the place of one of them."""
    tag, pos = ("DT", "DET") if word == "any" else ("IN", "ADP") if word == "in" else ("NN", "PRON")
    new = replace(tokens[at], text=word, lemma=word, tag=tag, pos=pos)
    return (*tokens[:at], new, *tokens[at + 1 :])


_WHOEVER: Final = frozenset({"anybody", "anything"})
_DENYING: Final[Mapping[tuple[str, ...], str]] = {
    ("no", "one"): "anybody",
    ("no", "-", "one"): "anybody",
    ("nobody",): "anybody",
    ("nothing",): "anything",
    ("none",): "one",
    ("no", "longer", "any"): "any",
    ("no", "more"): "any",
    ("no",): "any",
}
_SOMEWHERE: Final = frozenset({"in", "on", "at", "inside", "there", "near", "next"})


_Rule = tuple[re.Pattern[str], str | Callable[[re.Match[str]], str]]
_SMOOTHED: Final = "smoothed"
_TABLES: Final = tuple("short_forms asides hesitations praises refusals searches requests counting openers".split())  # noqa: SIM905


def rephrased(text: str) -> str:
    """The sentence as a plain command, in single blanks: "could you please get it" becomes "get it".

    Hesitations and words said twice are left out. Where a polite form stands inside the sentence, a comma takes its
    place. "I would like something to drink" becomes "bring me a drink".
    """
    for pattern, instead in _rules():
        text = pattern.sub(instead, text)
    return " ".join(text.split()).strip(" ,;:-.")


def smoothed(text: str) -> str:
    """The sentence in full forms, without hesitations, asides and words said twice; else as it was spoken."""
    for pattern, instead in _rules(_SMOOTHED):
        text = pattern.sub(instead, text)
    text = re.sub(r"\b([ap])\.\s?m\.?(?![\w'])", r"\1m", text, flags=re.IGNORECASE)
    return " ".join(text.split()).strip(" ,;:-.")


@cache
def _rules(family: str | None = None) -> tuple[_Rule, ...]:
    tables = {f"<{name}>": getattr(lexicon(), name) for name in _TABLES}
    tables["<verbs>"] = [first for first, *rest in lexicon().verbs if not rest]
    phrases = {mark: "|".join(map(re.escape, table)) for mark, table in tables.items()}
    filled = re.compile("|".join(phrases))
    return tuple(
        (
            re.compile(filled.sub(lambda mark: phrases[mark[0]], pattern), re.IGNORECASE),
            _FUNCTIONS.get(instead, instead),
        )
        for name, rules in read_table("rephrasing.yaml").items()
        if family in (None, name)
        for pattern, instead in rules
    )


def _full(match: re.Match[str]) -> str:
    return lexicon().short_forms[match[0].lower()]


def _are(match: re.Match[str]) -> str:
    return "they are " if match[1].lower() == "them" else "it is "


def _bring(match: re.Match[str]) -> str:
    """A bare wish with "please"; it may say for whom."""
    whom = re.search(r"\b(?:for|to)\b", match[0], re.IGNORECASE)
    return f"bring {match[0]}" if whom else f"bring me {match[0]}"


def _all(match: re.Match[str]) -> str:
    """Each of a kind, one after the other, is all of that kind."""
    what = match["what"].strip()
    return f"{match['act']} all the {what if what.endswith('s') and not what.endswith('ss') else plural(what)} "


def _break(match: re.Match[str]) -> str:
    """What stands in an opener's place: a comma, unless there is one or the sentence ends."""
    return ", " if match.string[: match.start()].strip() and match.string[match.end() :].strip(" .!?") else " "


_FUNCTIONS: Final[Mapping[str, Callable[[re.Match[str]], str]]] = {
    "$full": _full,
    "$are": _are,
    "$bring": _bring,
    "$all": _all,
    "$break": _break,
}
