"""What an unknown name may stand for: other words for the same, words of a kind, and names that look or sound alike.

Only what is certain is taken: a general synonym (`synonyms.yaml`) of one known name, and a word that is no English at
all and is spelled nearly like one known name. All else becomes a question or a refusal.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Final, Protocol, runtime_checkable

from rapidfuzz.distance import OSA

from executive.language.lexicon import read_table
from executive.language.sounds import sound_distance
from executive.words.knowledge import Knowledge

__all__ = ["Corrected", "WordFacts", "correct_spelling", "look_alikes", "synonyms_of", "words_for"]

ALIKE_SOUND: Final = 0.16
ALIKE_MEANING: Final = 0.65
_WORD: Final = re.compile(r"[^\W\d_][\w'-]*")
_LONGEST_NAME: Final = 4
_FEWEST_LETTERS: Final = 4
_MOST_LETTERS: Final = 30
_LONG_NAME: Final = 7
_MOST_WORDS: Final = 60


@runtime_checkable
class WordFacts(Protocol):
    """What is known of English words."""

    def is_word(self, word: str) -> bool:
        """Whether it is a frequent English word."""

    def similarity(self, word: str, other: str) -> float:
        """How near two words are in meaning, from -1 to 1."""


@dataclass(frozen=True)
class Corrected:
    """A sentence with known names in place of misspelled ones, and a word on each ("I take ...")."""

    text: str
    notes: tuple[str, ...] = ()


def words_for(name: str) -> tuple[str, ...]:
    """Other words for the same as `name`, and words for its kind."""
    rings, kinds = _synonyms()
    wanted = name.lower()
    same = [word for ring in rings if wanted in ring for word in ring if word != wanted]
    return tuple(dict.fromkeys([*same, *(kind for kind, members in kinds.items() if wanted in members)]))


def synonyms_of(word: str, known: Mapping[str, str]) -> tuple[str, ...]:
    """The known names that a word which is none of them stands for; `known` gives the name for each spelling."""
    wanted = word.lower()
    rings, kinds = _synonyms()
    ring = (known[other] for ring in rings if wanted in ring for other in ring if other in known)
    kind = (known[other] for member in kinds.get(wanted, ()) for other in _with_ring(member) if other in known)
    return tuple(dict.fromkeys(ring)) or tuple(dict.fromkeys(kind))


def look_alikes(word: str, known: Mapping[str, str], facts: WordFacts | None) -> tuple[str, ...]:
    """The known names that an unknown word may be a slip for, or is near in meaning, the likeliest first."""
    wanted = word.lower()
    if len(wanted) > _MOST_LETTERS:
        return ()
    found = sorted((distance, name) for spelling, name in known.items() if (distance := _slip(wanted, spelling)) < 1.0)
    near = [name for _, name in found]
    if facts is not None and not near:
        head = wanted.split()[-1] if wanted else ""
        scored = [(facts.similarity(head, spelling.split()[-1]), name) for spelling, name in known.items()]
        near = [name for score, name in sorted(scored, reverse=True) if score >= ALIKE_MEANING]
    return tuple(dict.fromkeys(near))[:_MOST_CANDIDATES]


def correct_spelling(text: str, knowledge: Knowledge, facts: WordFacts) -> Corrected:
    """Write known names in place of what is misspelled so that only one of them can be meant.

    A word is misspelled when it is no English word; the name must be within one slip, or two for long names. Names
    that are written together or apart ("night stand", "nightstand") are the same.
    """
    known = _known(knowledge)
    words = list(_WORD.finditer(text))[:_MOST_WORDS]
    pieces, notes, end, at = [], [], 0, 0
    while at < len(words):
        count, name = _corrected_at(words, at, known, facts)
        if name is not None:
            spoken = text[words[at].start() : words[at + count - 1].end()]
            pieces += [text[end : words[at].start()], name]
            notes += [] if _despaced(spoken) in (_despaced(name), _despaced(f"{name}s")) else [_note(spoken, name)]
            end = words[at + count - 1].end()
        at += count
    return Corrected("".join([*pieces, text[end:]]), tuple(notes))


def _note(spoken: str, name: str) -> str:
    return f"I take '{spoken}' to be {name}"


@dataclass(frozen=True)
class _Known:
    """The spellings that count as known, in lower case: the names, their words, the names by their letters without
    blanks, and how each name is written.
    """

    names: frozenset[str]
    words: frozenset[str]
    joined: Mapping[str, str]
    spelled: Mapping[str, str]


def _corrected_at(words: Sequence[re.Match[str]], at: int, known: _Known, facts: WordFacts) -> tuple[int, str | None]:
    """How many words from here on are one name, and that name where it must be written anew."""
    rows = [[word.group().lower() for word in words[at : at + count]] for count in range(_LONGEST_NAME, 0, -1)]
    fitting = [row for row in rows if at + len(row) <= len(words)]
    for row in fitting:
        spoken = " ".join(row)
        if spoken in known.names or _singular(spoken) in known.names:
            return len(row), None
        if _despaced(spoken) in known.joined:
            return len(row), known.joined[_despaced(spoken)]
    for row in fitting:
        name = _only_near(row, known, facts)
        if name is not None:
            return len(row), name
    return 1, None


def _only_near(row: Sequence[str], known: _Known, facts: WordFacts) -> str | None:
    """The one known name that misspelled words can mean; None where they are English or could be several."""
    strange = [word for word in row if word not in known.words]
    if not strange or any(_may_be_right(word, facts) for word in strange):
        return None
    spoken = " ".join(row)
    names = [name for name in known.names if name.count(" ") == len(row) - 1]
    forms = [form for name in names for form in (name, f"{name}s")]
    near = sorted((distance, form) for form in forms if (distance := _slips(spoken, form)) <= _slips_allowed(form))
    unsure = len(near) > 1 and near[1][0] == near[0][0]
    return None if unsure or not near else known.spelled.get(near[0][1], near[0][1])


def _may_be_right(word: str, facts: WordFacts) -> bool:
    """Whether a word that is no known name is one that was meant."""
    return not _FEWEST_LETTERS <= len(word) <= _MOST_LETTERS or facts.is_word(word) or facts.is_word(_singular(word))


def _slips(word: str, name: str) -> int:
    """How many slips lie between two words: letters too few, too many, wrong, or two swapped; above 2 it says 3."""
    return OSA.distance(word, name, score_cutoff=2)


def _slips_allowed(name: str) -> int:
    return 1 if len(name) < _LONG_NAME else 2


def _slip(word: str, name: str) -> float:
    """How likely a word is a slip for a name: below 1 when it looks or sounds alike, the less the likelier."""
    slips = _slips(word, name)
    if len(word) >= _FEWEST_LETTERS - 1 and slips <= _slips_allowed(name) // 2 + (len(name) > 3):
        return slips / len(name)
    sound = sound_distance(word, name)
    return sound if sound <= ALIKE_SOUND else 1.0


def _known(knowledge: Knowledge) -> _Known:
    own = [*knowledge.thing_names(), *knowledge.place_names(), *knowledge.people]
    return _known_of(knowledge.spellings(own))


@lru_cache(maxsize=16)
def _known_of(spelled: tuple[str, ...]) -> _Known:
    """The names of a world with their aliases, and the general synonyms of those."""
    written = {name.lower(): name for name in spelled}
    names = tuple(dict.fromkeys([*written, *(word for name in written for word in words_for(name))]))
    words = frozenset(word for name in names for word in name.split())
    return _Known(frozenset(names), words, {_despaced(name): name for name in reversed(names)}, written)


def _singular(word: str) -> str:
    return re.sub(r"(?<=[sxh])es$|s$", "", word)


def _despaced(name: str) -> str:
    return re.sub(r"[\s'-]", "", name.lower())


def _with_ring(word: str) -> Iterator[str]:
    yield word
    yield from (other for ring in _synonyms()[0] if word in ring for other in ring)


@cache
def _synonyms() -> tuple[tuple[tuple[str, ...], ...], Mapping[str, tuple[str, ...]]]:
    data = read_table("synonyms.yaml")
    return tuple(map(tuple, data["same"])), {kind: tuple(members) for kind, members in data["kinds"].items()}


_MOST_CANDIDATES: Final = 4
