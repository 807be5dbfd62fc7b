"""Finds the robots that a sentence addresses, and the text for each: "Alice, go home and let Bob bring a coke"."""

from __future__ import annotations

import enum
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import Any, Final

from executive.language.cleaning import find_address
from executive.language.lexicon import any_of, lexicon, word_list
from executive.language.questions import RefusalError
from executive.language.task_sentences import task_openers
from executive.language.templates import Match, Page, page, words_of
from executive.words.robot_config import display_name, find_robot
from skills.inputs.errors import listing


class RobotChoice(enum.Enum):
    """Addressee without a name: all robots, or any of them."""

    ALL = "all"  # each of the robots
    ANY = "any"  # whichever of them does it best: none was named


Addressee = tuple[str, ...] | RobotChoice
"""Robots by their names, or all of them, or any."""

_JOINTS: Final = re.compile(r"^(?:(?:and|but|so|then|while|meanwhile|first|also)\b[\s,]*)*", re.IGNORECASE)


def named_robots(who: Addressee | None) -> tuple[str, ...]:
    """Names of the robots; empty for all or any."""
    return who if isinstance(who, tuple) else ()


@dataclass(frozen=True)
class AddressedText:
    """Text for one addressee: `who` is None if the text names nobody; `joint` are the joining words before the text.

    `then` marks a text that follows the previous text; `behind` names the robots whose earlier parts must be done
    first. `otherwise` marks a text under the condition of the previous text. `past` marks a text that describes work as
    finished, which the robot must then do.
    """

    who: Addressee | None
    text: str
    joint: str = ""
    then: bool = False
    behind: Addressee | None = None
    otherwise: bool = False
    past: bool = False


@cache
def _verbs() -> Mapping[str, str]:
    """Returns verbs by their forms: "bring" and "brings" map to "bring"."""
    bases = {verb[0] for verb in lexicon().verbs} | word_list("verbs_too") | task_openers()
    stems = {base: re.sub("(?<=[^aeiou])y$", "ie", base) for base in bases}
    forms = {f"{stem}{'es' if re.search('(?:s|x|z|ch|sh|o)$', stem) else 's'}": base for base, stem in stems.items()}
    return {**forms, **lexicon().third_persons, **{base: base for base in bases}}


@dataclass(frozen=True)
class Addressees:
    """Finds the robots `names` in a sentence, and splits the text by robot."""

    names: tuple[str, ...]

    @cached_property
    def forms(self) -> Page:
        """Templates of calls and instructions."""
        return page("robots", one=tuple(sorted(self.names, key=len, reverse=True)), verb=tuple(_verbs()))

    @cached_property
    def name(self) -> re.Pattern[str]:
        """Pattern of the robots' names."""
        return re.compile(rf"\b(?:{any_of(self.names)})(?![\w'-])", re.IGNORECASE)

    @cached_property
    def _third_person(self) -> re.Pattern[str]:
        before = r"(^|[,.;]\s*|\b(?:and|then|or|also)\s+)(?:to\s+)?"
        return re.compile(rf"{before}({any_of(_verbs())})(?![\w'])", re.IGNORECASE)

    def words(self, name: str) -> Any:
        """Words of a list of the page."""
        return self.forms.table["lists"][name]

    def find_robots(self, said: str, but: Sequence[str] = ()) -> Addressee:
        """Finds the robots that `said` names, "the other robot" without those in `but`. Raises RefusalError."""
        if self.forms["other"].fullmatch(said):
            others = tuple(name for name in self.names if name not in but)
            if len(others) != 1:
                raise RefusalError(f"which robot is '{said}'? say its name", [said])
            return others
        if (everybody := self.forms["everybody"].fullmatch(said)) is not None:
            if int(everybody["count"] or len(self.names)) != len(self.names):
                known = listing(map(display_name, self.names))
                raise RefusalError(f"there are {len(self.names)} robots, {known}: which are '{said}'?", [said])
            return RobotChoice.ALL
        found = (find_robot(name, self.names) for name in self.name.findall(said))
        return tuple(dict.fromkeys(filter(None, found)))

    def split_call(self, text: str) -> tuple[Addressee, str] | None:
        """Splits off the robots that a text calls at its beginning. Raises RefusalError like `find_robots`."""
        match = self.forms["talk"].match(text)
        return None if match is None else (self.find_robots(match["who"]), match.rest)

    def parts(self, text: str) -> tuple[Addressee | None, tuple[AddressedText, ...]]:
        """Splits a sentence into its addressee and parts, one for adjacent parts of a robot. Raises RefusalError."""
        parting = _Parting(self, *self.listener(text))
        found: list[AddressedText] = []
        for part in parting.parts():
            last = found[-1] if found else None
            waits = part.behind not in (None, part.who)
            if last is None or last.who != part.who or waits or last.past or part.past:
                found.append(part)
            else:
                joint = part.joint if re.search(r"\w", part.joint) else " and "
                found[-1] = replace(last, text=f"{last.text}{joint}{part.text}")
        return parting.listener, tuple(found)

    def listener(self, text: str) -> tuple[Addressee | None, str]:
        """Splits off the addressee of a sentence. Raises RefusalError like `find_robots`."""
        if (match := self.forms["first"].match(text)) is not None:
            return self.find_robots(match["who"]), match.rest
        if (match := self.forms["last"].search(text)) is not None:
            before = text[: match.start]
            if not (before[:1].islower() and re.search(r"\b[A-Z]\w*$", before)):  # a beer for Robin, Alice and Bob
                return self.find_robots(match["who"]), before
        address = find_address(text, self.names)
        if address.name is not None:
            return (address.name,), address.text
        if (match := self.forms["called_back"].search(text)) is not None:
            return self.find_robots(match["who"]), f"{text[: match.start]}{match['mark']} {match.rest}"
        return None, text

    def without_descriptions(self, text: str) -> str:
        """Removes statements on how robots are: "Bob is not" of "Bob is not there"."""
        while (match := self.forms["narrated"].search(text)) is not None:
            text = f"{text[: match.start]}{match.rest}"
        return text

    def imperative(self, text: str) -> str:
        """Turns statements into commands: "goes to the hall and brings" -> "go to the hall and bring"."""
        return self._third_person.sub(lambda match: f"{match[1]}{_verbs()[match[2].lower()]}", text)

    def joint(self, text: str) -> int:
        """Position of the words at the end of a text that join it to the next one."""
        words = words_of(text)
        ends = (0, *(end for _, end in words.spans))
        joins = (end for n, end in enumerate(ends) if self.forms["joints"].fullmatch(text[words.start(n) :]))
        return next(joins, len(text))

    def opener(self, text: str) -> int:
        """Position of a condition or time at the end of a text, with no action behind it, which is for what follows."""
        words = words_of(text)
        begins = [words.start(n) for n in range(len(words.words)) if words.word(n - 1) in ("", ",", ".", ";", "and")]
        at = next((at for at in begins if self.forms["opener"].fullmatch(text[at:])), len(text))
        return len(text) if self.forms["opened"].search(text[at:]) else at


addressees: Final = cache(Addressees)
"""Returns the finder of the robots with some names, and keeps it."""


def _tidy(text: str) -> str:
    """Strips punctuation from both ends of a text, and joining words from its beginning."""
    return _JOINTS.sub("", text.strip(" ,;:-")).strip(" ,;:-")


@dataclass
class _Parting:
    """Splits one sentence into parts by robot."""

    calls: Addressees
    listener: Addressee | None
    text: str
    address: Addressee | None = None
    found: list[AddressedText] = field(default_factory=list)

    def parts(self) -> tuple[AddressedText, ...]:
        """Parts of the sentence, in order."""
        words, text, self.address, at = words_of(self.text), self.text, self.listener, 0
        self.found = [AddressedText(self.listener, "")]
        boundary, opening = self.calls.words("boundary"), self.calls.words("opening")
        for n, word in enumerate(words.words):
            start = words.start(n)
            if start < at or (n and words.words[n - 1] not in boundary and word not in opening):
                continue
            if (begun := self._begins(n, start, at)) is not None:
                if self.listener is None and begun["kind"] == "call":
                    self.listener = self.calls.find_robots(begun["who"]) or None
                self._take(begun, text[at:start])
                at = words.start(begun.after)
            elif self.found[-1].past and text[:start].rstrip().endswith(","):
                self._add(text[at:start])
                self.found.append(AddressedText(self.address, "", then=True))
                at = start
        self._add(text[at:])
        *before, last = self.found
        if before and last.behind is not None and not re.search(r"\w", last.text):
            self.found = [*before[:-1], replace(before[-1], behind=last.behind)]
        return tuple(self._sentences())

    def _begins(self, n: int, start: int, at: int) -> Match | None:
        """Beginning of a part for another robot at a word, with the verb that it implies. Raises RefusalError."""
        current = self.found[-1]
        for match in self.calls.forms["begins"].matches(self.text, n):
            if match["who"].lower() in self.calls.words("yourself") and (current.who is None or not n):
                continue
            if match["refused"]:
                raise RefusalError(f"{match['refused']}: '{match.text}'", [match.text])
            return match
        gap = self.calls.forms["gap"].match(self.text, n)
        if gap is None or current.who is None or not n:
            return None
        said = self.calls.imperative(_tidy(f"{current.text}{self.text[at:start]}"))
        verb = self.calls.forms["verb"].match(said)
        return None if verb is None else replace(gap, slots={**gap.slots, "lead": f"{verb.text} "})

    def _take(self, begun: Match, before: str) -> None:
        """Ends the present part with the text `before`, and begins the next one."""
        at = self.calls.joint(before)
        said, joint, kind, lead = before[:at], before[at:], begun["kind"], begun["lead"]
        if kind in ("after", "wait"):
            self._add(said)
            who = self.found[-1].who if kind == "wait" or self.address is None else self.address
            self.found.append(AddressedText(who, "", joint, behind=self._awaited(begun["who"])))
            return
        who, bare = self._who(begun["who"]), said.strip(" ,")
        opener = len(bare) if kind == "past" else self.calls.opener(bare)
        if opener < len(bare):  # it belongs to the next part: "if there is a coke,"
            said, lead = bare[:opener], f"{bare[opener:]}, {lead}"
        self._add(said)
        last = self.found[-1]
        joins = {*words_of(joint).words}
        follows, otherwise = (not joins.isdisjoint(self.calls.words(name)) for name in ("follows", "otherwise"))
        then = last.past or follows or (last.then and not last.text)
        behind = None if last.text else last.behind
        self.found.append(AddressedText(who, lead, joint, then, behind, otherwise, past=kind == "past"))
        self.address = who if kind == "call" else self.address

    def _awaited(self, said: str) -> Addressee:
        """Robots that must be done first, by their names or by "he": the latest ones. Raises RefusalError."""
        named = () if said.lower() in self.calls.words("him") else self.calls.find_robots(said)
        behind = named or next((one.who for one in reversed(self.found) if one.who is not None), None)
        if behind is None:
            raise RefusalError(f"who is '{said}'? say the robot's name", [said])
        return behind

    def _add(self, more: str) -> None:
        """Adds to the text of the last part, if the text is not empty."""
        last = self.found[-1]
        self.found[-1] = replace(last, text=_tidy(f"{last.text}{more}"))

    def _who(self, said: str) -> Addressee:
        """Robots that a name, "you" or "the other robot" stands for."""
        named = [name for one in self.found for name in named_robots(one.who)]
        if said.lower() in self.calls.words("yourself"):
            return self.calls.find_robots("the other robot", named) if self.address is None else self.address
        return self.calls.find_robots(said, named_robots(self.address) or named[-1:])

    def _sentences(self) -> Iterator[AddressedText]:
        """Yields the parts with text; a new sentence inside another robot's part is for the addressee again."""
        for one in self.found:
            split = self.address not in (None, one.who)
            first, *rest = re.split(r"(?<=[.!?])\s+", one.text) if split else [one.text]
            if re.search(r"\w", first):
                yield replace(one, text=_tidy(first) if one.past else self.calls.imperative(_tidy(first)))
            if rest:
                yield AddressedText(self.address, self.calls.imperative(_tidy(" ".join(rest))))
