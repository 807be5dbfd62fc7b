"""Spelling and sound of words: finds the known name of a synonym, a misspelled or a misheard word.

Text and speech share tables and distance. Rules for letters convert a word to a sequence of sounds
(`letter_sounds.yaml`; Elovitz, Johnson, McHugh and Shore, "Letter-to-sound rules for automatic translation of English
text to phonetics", 1976, have the form of the rules, and far more of them). An edit distance compares two sequences;
substitutions cost less for similar sounds.

The sounds: p b t d k g f v s z h m n l r w y as in print, T (thin), S (ship), C (chip), J (jam), N (sing); the vowels i
(bit, beat), e (bet, bait), a (bat), V (but), o (pot, boat), u (boot), @ (the), and A (buy), W (now), Y (boy).

Two corrections are made without a question: a synonym (`synonyms.yaml`) of exactly one known name, and a non-English
word that misspells exactly one known name. All others become a question or a refusal.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt
from rapidfuzz.distance import OSA

from executive.language.lexicon import read_table
from executive.words.knowledge import Knowledge
from skills.inputs.plugins import class_tables

if TYPE_CHECKING:
    from executive.language.parser import DependencyParser

Costs = npt.NDArray[np.float64]

ALIKE_SOUND: Final = 0.16
ALIKE_MEANING: Final = 0.65
_WORD: Final = re.compile(r"[^\W\d_][\w'-]*")
_LONGEST_NAME: Final = 4
_FEWEST_LETTERS: Final = 4
_MOST_LETTERS: Final = 30
_LONG_NAME: Final = 7
_MOST_WORDS: Final = 60
_MOST_CANDIDATES: Final = 4
_PART_CHANGED: Final = 0.4
_ALWAYS_CHANGED: Final = 0.6
_MOST_COST: Final = 3.5
_MOST_ALIKES: Final = 8
_MOST_LETTERS_HEARD: Final = 200
_VOWEL_DROP: Final = 0.5
_CONSONANT_DROP: Final = 0.8


@dataclass(frozen=True)
class Alike:
    """Known phrase, and how similar it sounds to given words.

    `cost` is about 1 for each changed sound, `distance` from 0 (the same) to 1 (nothing in common). `name`
    distinguishes names of objects and places from other words.
    """

    phrase: str
    cost: float
    distance: float
    name: bool = True


class SoundAlikes:
    """Index that finds known phrases by sound: `names` of objects and places, and other words."""

    def __init__(self, names: Iterable[str], others: Iterable[str] = ()) -> None:
        kinds = {**dict.fromkeys(others, False), **dict.fromkeys(names, True)}
        self._phrases = tuple((phrase, name) for phrase, name in kinds.items() if sounds_of(phrase))
        self._words = frozenset(word for phrase, _ in self._phrases for word in phrase.lower().split())
        sounds = [sounds_of(phrase) for phrase, _ in self._phrases]
        self._letters = sorted(set("".join(sounds)))
        self._lengths = np.array(list(map(len, sounds)), int)
        code = {" ": 0, **{letter: number for number, letter in enumerate(self._letters)}}
        longest = max(map(len, sounds), default=0)
        rows = [[code[letter] for letter in its.ljust(longest)] for its in sounds]
        self._sounds = np.array(rows, int).reshape(len(sounds), longest)
        self._drops = np.array([_drop_cost(letter) for letter in self._letters])
        self.nearest = lru_cache(maxsize=4096)(self._nearest)

    def knows(self, word: str) -> bool:
        """Returns whether the word is a known phrase or occurs in one."""
        return word.lower() in self._words

    def similarities(self, words: str) -> tuple[Alike, ...]:
        """Returns all phrases that have a sound, in order, with their similarity to `words`."""
        heard = sounds_of(words)
        costs = self._costs(heard)
        longest = np.maximum(self._lengths, len(heard))
        distances = np.minimum(costs / longest, 1.0) if heard else np.ones(len(costs))
        rows = zip(self._phrases, costs.tolist(), distances.tolist(), strict=True)
        return tuple(Alike(phrase, cost, distance, name) for (phrase, name), cost, distance in rows)

    def _nearest(self, words: str) -> tuple[Alike, ...]:
        """Phrases that sound like `words`, the most similar first, without the words themselves."""
        heard, same = sounds_of(words), words.lower()
        most = min(_PART_CHANGED * len(heard) + _ALWAYS_CHANGED, _MOST_COST)
        found = [one for one in self.similarities(words) if heard and one.cost <= most and one.phrase.lower() != same]
        return tuple(sorted(found, key=lambda one: one.cost)[:_MOST_ALIKES])

    def _costs(self, heard: str) -> Costs:
        """Least cost of changing the given sounds to those of each phrase, computed for all phrases at once."""
        count, longest = self._sounds.shape
        above = np.zeros((longest + 1, count))
        above[1:] = np.cumsum(self._drops[self._sounds], axis=1).T
        for mine in heard:
            change = np.array([_change_cost(mine, other) for other in self._letters])
            dropped = _drop_cost(mine)
            row = np.empty_like(above)
            row[0] = above[0] + dropped
            for at in range(longest):
                other = self._sounds[:, at]
                least = np.minimum(above[at] + change[other], above[at + 1] + dropped)
                row[at + 1] = np.minimum(least, row[at] + self._drops[other])
            above = row
        costs: Costs = above[self._lengths, np.arange(count)]
        return costs


_alikes = lru_cache(maxsize=64)(SoundAlikes)


@lru_cache(maxsize=4096)
def sound_distance(first: str, second: str) -> float:
    """Distance in sound between two texts, from 0 to 1, without their blanks; up to 0.2 is a likely mishearing."""
    return next((one.distance for one in SoundAlikes((second,)).similarities(first)), 1.0)


@lru_cache(maxsize=4096)
def sounds_of(words: str) -> str:
    """Sounds of one or more words, one character for each sound; only Latin letters have sounds."""
    letters = unicodedata.normalize("NFKD", words[:_MOST_LETTERS_HEARD].lower())  # accents are taken off
    plain = re.sub(r"[^a-z ]", "", re.sub(r"[-_\s]", " ", letters))
    return "".join(map(_word_sounds, plain.split()))


def _word_sounds(word: str) -> str:
    sounds, at = "", 0
    while at < len(word):
        matches = ((before, letters.match(word, at), sound) for before, letters, sound in _rules(word[at]))
        fitting = ((found.end(), sound) for before, found, sound in matches if found and before.search(word[:at]))
        end, sound = next(fitting, (at, ""))
        sounds, at = sounds + sound, max(end, at + 1)
    return re.sub(r"(.)\1+", r"\1", sounds)


@cache
def _rules(letter: str) -> Sequence[tuple[re.Pattern[str], re.Pattern[str], str]]:
    """Rules for a letter: the letters that precede it, the letters that it covers, and their sounds."""
    return tuple(
        (re.compile(rf"(?:{left})$"), re.compile(rf"(?:{letters})(?={right})"), sounds)
        for left, letters, right, sounds in read_table("letter_sounds.yaml")[letter]
    )


@cache
def _drop_cost(sound: str) -> float:
    """Cost of omitting a sound, from 0 to 1; some sounds cost less."""
    usual = _VOWEL_DROP if sound in _vowels() else _CONSONANT_DROP
    return float(read_table("sounds.yaml")["weak"].get(sound, usual))


@cache
def _change_cost(a: str, b: str) -> float:
    """Cost of replacing one sound by another, from 0 to 1."""
    if a == b:
        return 0.0
    vowels, alike = _vowels(), read_table("sounds.yaml")["alike"].items()
    if a in vowels and b in vowels:
        (x, y), (other_x, other_y) = vowels[a], vowels[b]
        return min(0.15 + 0.6 * float(((x - other_x) ** 2 + (y - other_y) ** 2) ** 0.5), 0.8)
    return next((float(cost) for cost, pairs in alike for pair in pairs if {*pair} == {a, b}), 1.0)


@cache
def _vowels() -> Mapping[str, tuple[float, float]]:
    """Backness and height of each vowel, from 0 to 1."""
    return {sound: (float(back), float(high)) for sound, (back, high) in read_table("sounds.yaml")["vowels"].items()}


@dataclass(frozen=True)
class CorrectedText:
    """Sentence in which misspelled names are corrected, and a note on each correction."""

    text: str
    notes: tuple[str, ...] = ()


def synonyms_for(name: str) -> tuple[str, ...]:
    """Synonyms of `name`, and words for its kind."""
    wanted = name.lower()
    kinds = (kind for kind, members in _synonyms()[1].items() if wanted in members)
    return tuple(dict.fromkeys([*(word for word in _same(wanted) if word != wanted), *kinds]))


def synonyms_of(word: str, known: Mapping[str, str]) -> tuple[str, ...]:
    """Known names that an unknown word may stand for; `known` maps each spelling to a name."""
    members = _synonyms()[1].get(word.lower(), ())
    of_kind = (other for member in members for other in (member, *_same(member)))
    rings = (dict.fromkeys(known[one] for one in ring if one in known) for ring in (_same(word.lower()), of_kind))
    return tuple(next(filter(None, rings), ()))


def _same(word: str) -> Iterator[str]:
    """Yields the words of each ring of synonyms that has a word, itself included."""
    return (other for ring in _synonyms()[0] if word in ring for other in ring)


def look_alikes(word: str, known: Mapping[str, str], facts: DependencyParser) -> tuple[str, ...]:
    """Known names with a spelling or meaning similar to that of an unknown word, the likeliest first."""
    wanted = word.lower()
    if len(wanted) > _MOST_LETTERS:
        return ()
    sounds = {one.phrase: one.distance for one in _alikes(tuple(known)).similarities(wanted)}
    scores: list[tuple[float, str]] = []  # the lower, the likelier
    for spelling, name in known.items():
        slips, sound = _slips(wanted, spelling), sounds.get(spelling, 1.0)
        typed = len(wanted) >= _FEWEST_LETTERS - 1 and slips <= _slips_allowed(spelling) // 2 + (len(spelling) > 3)
        scores += [(slips / len(spelling), name)] if typed else [(sound, name)] if sound <= ALIKE_SOUND else []
    near = [name for score, name in sorted(scores) if score < 1.0]
    if not near:
        head = wanted.split()[-1] if wanted else ""
        scored = [(facts.similarity(head, spelling.split()[-1]), name) for spelling, name in known.items()]
        near = [name for score, name in sorted(scored, reverse=True) if score >= ALIKE_MEANING]
    return tuple(dict.fromkeys(near))[:_MOST_CANDIDATES]


def correct_spelling(text: str, knowledge: Knowledge, facts: DependencyParser) -> CorrectedText:
    """Replaces misspelled words that can only mean one known name.

    Only words that are not English count as misspelled; they may have one typing error, or two in long names. A name
    may be written as one word or two ("night stand", "nightstand").
    """
    own = [*knowledge.object_names(), *knowledge.place_names(), *knowledge.people]
    known = _known(knowledge.spellings(own))
    words = list(_WORD.finditer(text))[:_MOST_WORDS]
    pieces, notes, end, at = list[str](), list[str](), 0, 0
    while at < len(words):
        count, name = _corrected_at([word.group() for word in words[at : at + _LONGEST_NAME]], known, facts)
        if name is not None:
            start, behind = words[at].start(), words[at + count - 1].end()
            pieces, spoken, end = [*pieces, text[end:start], name], text[start:behind], behind
            same = _despaced(spoken) in (_despaced(name), _despaced(f"{name}s"))
            notes += [] if same else [f"I take '{spoken}' to be {name}"]
        at += count
    return CorrectedText("".join([*pieces, text[end:]]), tuple(notes))


class _Known:
    """Known spellings in lower case, and synonyms: names, their words, names without blanks, and the original forms."""

    def __init__(self, spelled: tuple[str, ...]) -> None:
        self.spelled = {name.lower(): name for name in spelled}
        names = dict.fromkeys([*self.spelled, *(word for name in self.spelled for word in synonyms_for(name))])
        self.names = names.keys()
        self.words = {word for name in names for word in name.split()}
        self.joined = {_despaced(name): name for name in reversed(names)}


_known = lru_cache(maxsize=16)(_Known)


def _corrected_at(words: Sequence[str], known: _Known, facts: DependencyParser) -> tuple[int, str | None]:
    """Number of words that form a name at the beginning, and the name if its spelling must change."""
    beginnings = [" ".join(words[:count]).lower() for count in range(len(words), 0, -1)]
    for spoken in beginnings:
        if spoken in known.names or _singular(spoken) in known.names:
            return len(spoken.split()), None
        if _despaced(spoken) in known.joined:
            return len(spoken.split()), known.joined[_despaced(spoken)]
    near = ((spoken, _only_near(spoken, known, facts)) for spoken in beginnings)
    return next(((len(spoken.split()), name) for spoken, name in near if name is not None), (1, None))


def _only_near(spoken: str, known: _Known, facts: DependencyParser) -> str | None:
    """Only known name that misspelled words can mean; None if they are English or ambiguous."""
    if not _is_misspelled([word for word in spoken.split() if word not in known.words], facts):
        return None
    names = (name for name in known.names if name.count(" ") == spoken.count(" "))
    forms = [form for name in names for form in (name, f"{name}s")]
    near = [(slips, form) for form in forms if (slips := _slips(spoken, form)) <= _slips_allowed(form)]
    nearest = [known.spelled.get(form, form) for slips, form in near if slips == min(near)[0]]
    return nearest[0] if len(nearest) == 1 else None


def _is_misspelled(strange: Sequence[str], facts: DependencyParser) -> bool:
    """Returns whether there are words that occur in no name, and all can be misspelled names: they are not English."""
    typed = bool(strange) and all(_FEWEST_LETTERS <= len(word) <= _MOST_LETTERS for word in strange)
    return typed and not any(facts.is_word(form) for word in strange for form in (word, _singular(word)))


def _slips(word: str, name: str) -> int:
    """Number of typing errors between two words (missing, extra, wrong or swapped letters); 3 if more than 2."""
    return OSA.distance(word, name, score_cutoff=2)


def _slips_allowed(name: str) -> int:
    return 1 if len(name) < _LONG_NAME else 2


def _singular(word: str) -> str:
    return re.sub(r"(?<=[sxh])es$|s$", "", word)


def _despaced(name: str) -> str:
    return re.sub(r"[\s'-]", "", name.lower())


@cache
def _synonyms() -> tuple[tuple[tuple[str, ...], ...], Mapping[str, tuple[str, ...]]]:
    data = read_table("synonyms.yaml")
    others = [ring for _, more in class_tables("synonyms.yaml") for ring in more["same"]]
    kinds = {kind: tuple(members) for kind, members in data["kinds"].items()}
    return tuple(map(tuple, [*data["same"], *others])), kinds
