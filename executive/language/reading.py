"""Reads the words of a sentence from left to right as a row of items."""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

from executive.language.indirect import INDIRECT
from executive.language.items import (
    LONGEST,
    Adverb,
    Aside,
    Being,
    Chunk,
    Correction,
    Item,
    Negation,
    Outside,
    Row,
    Separator,
    Unknown,
    Verb,
    Whether,
    may_begin_command,
    verb,
)
from executive.language.lexicon import PrepositionRole, VerbKind, lexicon, word_list
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase
from executive.language.tokens import Token, longest_of

_SEPARATORS: Final = frozenset({"", ",", "and", "or", "then", ";"})
_VERB_TAGS: Final = frozenset({"VB", "VBP", "VBD", "VBN"})
_OF_ALL: Final = re.compile(r"all|none|(?:any|every|no)(?:where|one|body|thing)")
"""Words after which "but" means "except"."""


class Reader(Row):
    """Reads the words of a sentence from left to right."""

    def read(self, lead: Sequence[Item] = ()) -> tuple[Item, ...]:
        """Reads the words as items after `lead`: each word becomes an item, except the silent ones."""
        steps = (Reader._mark, *INDIRECT, Reader._verb, Reader._being, Reader._chunk, Reader._small, Reader._outside)
        items = list(lead)
        while self.at < len(self.tokens):
            if self.at in self.silent:
                self.at += 1
            else:
                found = next((item for step in steps if (item := step(self, items)) is not None), None)
                items.append(found or Unknown(self.take(1)))
        return tuple(items)

    def _mark(self, items: list[Item]) -> Item | None:
        """Reads a negation or correction: "not", "no, the hammer"; "no" in "no milk" is neither."""
        correction, negation = self.match(lexicon().corrections), self.match(lexicon().negations)
        nothing = correction == ("no",) and self.token(1).pos in ("NOUN", "ADJ")
        if correction and len(correction) >= len(negation) and not nothing:
            return Correction(self.take(len(correction)).lower(), lexicon().corrections[correction])
        return Negation(self.take(len(negation)).lower()) if negation else None

    def _verb(self, items: list[Item]) -> Item | None:
        found = self.match(lexicon().verbs) or self._gerund(items)
        if found and self._takes_preposition(found):
            found = found[:-1]
        token, behind = self.token(), self.token(len(found))
        inside = any(start < self.at < start + len(p.tokens) for start, p in self.phrases.items())
        acts = token.pos == "VERB" and token.tag in _VERB_TAGS and not inside
        if not found or not (acts or (may_begin_command(items) and behind.word not in _SEPARATORS)):
            return None
        self.at += len(found)
        return verb(" ".join(found))

    def _takes_preposition(self, verb: tuple[str, ...]) -> bool:
        """Returns whether a verb's last word begins a longer preposition instead ("go | in front of")."""
        place = self.phrase_at(self.at + len(verb))
        inside = verb[-1] in ("in", "on") and place is not None and place.kind is NounKind.PLACE
        longer = len(self.match(lexicon().prepositions, len(verb) - 1)) > 1
        return verb[:-1] in lexicon().verbs and (inside or longer)

    def _gerund(self, items: list[Item]) -> tuple[str, ...]:
        """Verb in a form such as "bringing" or "brought" where a command begins, as after "would you mind"."""
        first, rest = self.token(), self.tokens[self.at + 1 : self.at + LONGEST]
        begins = not items if first.tag in ("VBD", "VBN") else first.tag == "VBG" and may_begin_command(items)
        return longest_of(lexicon().verbs, [first.lemma, *(t.word for t in rest)]) if begins else ()

    def _being(self, items: list[Item]) -> Item | None:
        token, after = self.token(), self.token(1)
        modal = token.tag == "MD" and after.word == "be"
        if modal or (token.lemma == "be" and token.pos in ("AUX", "VERB") and not self.match(lexicon().fillers)):
            existential = self.token(1 + modal).tag == "EX"
            return Being(self.take(1 + modal + existential), existential, asked=not modal)
        if token.tag == "EX" or (token.word == "there" and after.lemma == "be"):
            end = next((n for n in range(1, 4) if self.token(n).lemma == "be"), 0)
            return Being(self.take(end + 1), existential=True, asked=False)
        return None

    def _chunk(self, items: list[Item]) -> Item | None:
        preposition = self.match(self.prepositions)
        start = self.at + len(preposition)
        phrase = self.phrase_at(start) or self._shown_at(start)
        if phrase is None:
            return None if preposition else self._level(items)
        self.at = start + len(phrase.tokens)
        if len(phrase.tokens) > 1 and phrase.tokens[0].word == "no":
            return Unknown(phrase.spoken)
        phrase = self._numbered(self._of(phrase.distributed if not preposition and _handles(items, phrase) else phrase))
        while (end := self._description_end(phrase)) > self.at:
            phrase = phrase.with_extra(*(t.text for t in self.tokens[self.at : end] if t.tag != "DT"))
            self.at = end
        return Chunk(phrase, " ".join(preposition), self.prepositions[preposition] if preposition else None)

    def _level(self, items: list[Item]) -> Item | None:
        """Reads "upstairs" as a destination or a place to search; before a place, the word adds nothing."""
        token, behind = self.token(), self.token(1)
        if token.word not in word_list("levels"):
            return None
        self.at += 1
        before = behind.word != "for" and (behind.pos == "ADP" or behind.tag in ("TO", "IN"))
        if before or (items and isinstance(items[-1], Chunk) and items[-1].role is not None):
            return Aside(token.text)
        kinds = _last_kinds(items, Being)
        return _place(token, PrepositionRole.GOAL if kinds and VerbKind.FIND not in kinds else PrepositionRole.AT)

    def _shown_at(self, start: int) -> Phrase | None:
        """Noun phrase after a "that" that the parser did not take as its article ("hand me that cup")."""
        that, phrase = self.token(start - self.at), self.phrase_at(start + 1)
        if phrase is None or phrase.named_person or phrase.head.word in word_list("subjects"):
            return None
        shown = Phrase((replace(that, tag="DT", pos="DET"), *phrase.tokens))
        return shown if that.word in word_list("pointing") else None

    def _of(self, phrase: Phrase) -> Phrase:
        """Joins "of wine" to "a bottle", and "of cups" to "two" or "a couple"."""
        while self.word() == "of" and (inner := self.phrase_at(self.at + 1)) is not None:
            self.at += 1 + len(inner.tokens)
            whole = phrase.counts or phrase.head.word in ("all", "both")
            counted = replace(inner, tokens=(*phrase.tokens, *inner.tokens))
            phrase = counted if whole else phrase.with_contents(inner)
        return phrase

    def _numbered(self, phrase: Phrase) -> Phrase:
        """Joins a number to the place before it: "room four"."""
        counts = self.token(1).pos in ("NOUN", "ADJ", "PROPN")
        countable = phrase.kind in (NounKind.PLACE, NounKind.THING) and not (phrase.plural or phrase.pronoun)
        joins = self.token().tag == "CD" and countable and not counts
        return phrase.with_extra(self.take(1)) if joins else phrase

    def _description_end(self, phrase: Phrase) -> int:
        """End of a description after a noun: of a person's activity or clothes, or of an object's contents."""
        who_is = self.word() in ("who", "that", "which") and self.word(1) in ("is", "'s", "are", "'re")
        if phrase.person and who_is and self.token(2).tag in ("VBG", "IN"):
            self.at += 2
        if phrase.person and self.token().tag == "VBG":
            return self._doing_end()
        inner = self.phrase_at(self.at + 1)
        return self.at if inner is None or not self._describes(phrase, inner) else self.at + 1 + len(inner.tokens)

    def _describes(self, phrase: Phrase, inner: Phrase) -> bool:
        """Returns whether the next word joins a description to a noun: "with", "on" the left, or "in" clothes."""
        word = self.word()
        if word == "on" and inner.head.word in ("left", "right"):  # in a world, it says which one
            apart = PrepositionRole.BESIDE in self.prepositions.values()
            return not apart and self.word(1 + len(inner.tokens)) != "of"
        worn = phrase.person and word in ("in", "wearing") and inner.head.lemma in word_list("worn")
        return (worn or word in ("with", "containing", "holding")) and not (inner.receiver or inner.pronoun)

    def _doing_end(self) -> int:
        """End of a description such as "raising their left arm" or "wearing a blue shirt"."""
        inner = self.phrase_at(self.at + 1)
        end = self.at + 1 + (0 if inner is None or inner.person else len(inner.tokens))
        while end < len(self.tokens) and (more := self._directional(end)):
            end += more
        return end

    def _directional(self, start: int) -> int:
        """Number of words from `start` on that give a direction or a posture."""
        if self.tokens[start].relation == "prt":
            return 1
        preposition = int(self.tokens[start].pos in ("ADP", "PART"))
        phrase = self.phrase_at(start + preposition)
        if phrase is None or phrase.head.lemma not in word_list("directions"):
            return 0
        return preposition + len(phrase.tokens)

    def _small(self, items: list[Item]) -> Item | None:
        token, then = self.token(), next((then for when, then in _SINGLE if when(self, items)), None)
        if then is not None:
            self.at += 1
            return then(token)
        if token.word == "but" and self.at > 0 and self._excepts(items):
            return None
        filler, noted = self._particle(items) or self.match(lexicon().fillers), self.match(lexicon().noted)
        if len(noted) > len(filler):
            return Aside(self.take(len(noted)))
        return Separator(self.take(len(filler)).lower()) if filler else None

    def _excepts(self, items: Sequence[Item]) -> bool:
        """Returns whether "but" means "except": after "everything", or after "all the drinks" if a noun follows."""
        last = items[-1] if items else None
        words = {token.word for token in last.phrase.tokens} if isinstance(last, Chunk) else set()
        of_all = bool(words & {"all", "any", "every", "each"}) and self.phrase_at(self.at + 1) is not None
        return of_all or _OF_ALL.fullmatch(self.word(-1)) is not None

    def _idle(self, items: Sequence[Item]) -> bool:
        """Returns whether the next word adds nothing, as in "that clamp over there" or "I need like a towel"."""
        token, word, behind = self.token(), self.word(), self.token(1)
        wants = bool(items) and (isinstance(items[-1], Verb) or self.word(-1) in ("me", "us"))
        purpose = behind.tag == "VB" and any(verb[0] == behind.word for verb in lexicon().verbs)
        rows = (
            word in word_list("there") and self._points(items),
            word == "like" and wants and self.phrase_at(self.at + 1) is not None,
            token.tag == "TO" and purpose and VerbKind.GO in _last_kinds(items, Being, Outside),  # go to take
            word in ("after", "upon", "by") and not items and behind.tag == "VBG",
            token.pos in ("ADP", "ADV") and word not in ("of", "from") and behind.word in ("here", "there"),
        )
        return any(rows)

    def _enters(self, items: Sequence[Item]) -> bool:
        """Returns whether "inside" means the house itself: behind a verb and its object."""
        chunks = [item for item in items if isinstance(item, Chunk)]
        named = bool(chunks) and not chunks[-1].phrase.pronoun and all(chunk.role is None for chunk in chunks)
        return named and self.word() == "inside" and not any(isinstance(item, Being) for item in items)

    def _describes_state(self, items: Sequence[Item]) -> bool:
        """Returns whether a posture says how somebody is ("the man lying there")."""
        chunk = next((item for item in reversed(items) if isinstance(item, Chunk)), None)
        return self.word() in word_list("postures") and chunk is not None and chunk.phrase.somebody

    def _points(self, items: Sequence[Item]) -> bool:
        """Returns whether "over there" only accompanies "that", as in "that clamp over there"."""
        match next((item for item in reversed(items) if not isinstance(item, Separator)), None):
            case Chunk(role=None, phrase=Phrase(pronoun=False, tokens=(first, *_))):
                beyond = self.word(-1) == "over" or self.token(1).tag == "IN"
                return beyond and first.word in word_list("pointing")
        return False

    def _particle(self, items: list[Item]) -> tuple[str, ...]:
        """Joins a particle to its verb: "put the cup down"."""
        particle = self.word()
        at, last = next(((n, item) for n, item in [*enumerate(items)][::-1] if isinstance(item, Verb)), (0, None))
        placed = self.word(1) in word_list("here") | word_list("there")
        if last is None or placed or (*last.text.split(), particle) not in lexicon().verbs:
            return ()
        items[at] = verb(f"{last.text} {particle}")
        return (particle,)

    def _outside(self, items: list[Item]) -> Item | None:
        """Unknown verb at a position where a clause may begin."""
        token = self.token()
        begins = token.tag == "VB" or (token.tag in _VERB_TAGS and may_begin_command(items))
        return Outside(self.take(1)) if token.pos == "VERB" and begins else None


def _handles(items: Sequence[Item], phrase: Phrase) -> bool:
    """Returns whether the last verb carries or finds objects like the phrase; "is every beer there" does not."""
    kinds = _last_kinds(items, Being, Outside, Whether)
    carries = kinds & {VerbKind.ROUND_TRIP, VerbKind.SINGLE_TRIP, VerbKind.PICK, VerbKind.PLACE}
    return bool(carries) or (VerbKind.FIND in kinds and phrase.kind in (NounKind.THING, None))


def _last_kinds(items: Sequence[Item], *others: type[Item]) -> frozenset[VerbKind]:
    """Kinds of the last verb; empty if one of the other items follows it."""
    last = next((item for item in reversed(items) if isinstance(item, (Verb, *others))), None)
    return last.kinds if isinstance(last, Verb) else frozenset()


def _place(token: Token, role: PrepositionRole) -> Chunk:
    """Makes a place out of a word."""
    return Chunk(Phrase((replace(token, pos="NOUN", tag="NN", kind=NounKind.PLACE),)), "", role)


_SINGLE: Final[Sequence[tuple[Callable[[Reader, Sequence[Item]], bool], Callable[[Token], Item]]]] = (
    (Reader._idle, lambda _: Separator("")),
    (Reader._enters, lambda token: _place(token, PrepositionRole.GOAL)),
    (lambda reader, _: reader.word() in word_list("here"), lambda _: Adverb(here=True)),
    (lambda reader, _: reader.word() in word_list("there"), lambda _: Adverb(here=False)),
    (lambda reader, _: reader.word() in ("if", "whether"), lambda _: Whether()),
    (Reader._describes_state, lambda token: Unknown(token.text)),
)
"""When a word stands alone, and as which item."""
