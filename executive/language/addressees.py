"""Finds the robots that a sentence addresses, and the text for each: "Alice, go home and let Bob bring a coke"."""

from __future__ import annotations

import enum
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property

from executive.language.cleaning import find_address
from executive.language.lexicon import Patterns, any_of, lexicon, read_table
from executive.language.questions import RefusalError
from executive.words.robot_config import display_name, find_robot
from skills.inputs.errors import listing


class RobotChoice(enum.Enum):
    """Addressee without a name: all robots, or any of them."""

    ALL = "all"  # each of the robots
    ANY = "any"  # whichever of them does it best: none was named


Addressee = tuple[str, ...] | RobotChoice
"""Robots by their names, or all of them, or any."""


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
    table = read_table("robots.yaml")
    bases = {verb[0] for verb in lexicon().verbs} | set(table["verbs_too"])
    forms = {f"{base}{'es' if re.search('(?:s|x|z|ch|sh)$', base) else 's'}": base for base in bases}
    return {**forms, **table["third_persons"], **{base: base for base in bases}}


@cache
def addressees(names: tuple[str, ...]) -> Addressees:
    """Returns the finder of robots with these names."""
    return Addressees(names)


@dataclass(frozen=True)
class Addressees:
    """Finds the robots `names` in a sentence, and splits the text by robot."""

    names: tuple[str, ...]

    @cached_property
    def begins(self) -> tuple[tuple[str, re.Pattern[str]], ...]:
        """Patterns that begin another robot's part, in the order in which they are tried."""
        return self.forms.mapping("begins")

    @cached_property
    def forms(self) -> Patterns:
        """Patterns for calls and instructions."""
        words = {"one": rf"(?:{any_of(self.names)})(?![\w'-])", "verbs": rf"(?:{any_of(_verbs())})(?![\w'])"}
        return Patterns("robots.yaml", words=words)

    def find_robots(self, said: str, but: Sequence[str] = ()) -> Addressee:
        """Finds the robots that `said` names; "the other robot" is the robot that is not in `but`.

        Raises RefusalError when `said` states a wrong number of robots.
        """
        words = " ".join(said.lower().split())
        if self.forms.other.fullmatch(words):
            others = tuple(name for name in self.names if name not in but)
            if len(others) != 1:
                raise RefusalError(f"which robot is '{said}'? say its name", [said])
            return others
        if self.forms.everybody.fullmatch(words):
            numbers = (int(read_table("robots.yaml")["numbers"].get(word, 0)) for word in words.split())
            if next(filter(None, numbers), len(self.names)) != len(self.names):
                known = listing(map(display_name, self.names))
                raise RefusalError(f"there are {len(self.names)} robots, {known}: which are '{said}'?", [said])
            return RobotChoice.ALL
        found = self.forms.one.findall(said)
        return tuple(dict.fromkeys(filter(None, (find_robot(name, self.names) for name in found))))

    def split_call(self, text: str) -> tuple[Addressee, str] | None:
        """Splits off the robots that a text calls at its beginning. Raises RefusalError like `find_robots`."""
        match = self.forms.talk.match(text)
        return None if match is None else (self.find_robots(match["who"]), text[match.end() :])

    def parts(self, text: str) -> tuple[Addressee | None, tuple[AddressedText, ...]]:
        """Splits a sentence into its addressee and its parts; joins adjacent parts that are for the same robots.

        Raises RefusalError when the sentence names robots unclearly, or forbids an action.
        """
        parting = _Parting(self, *self.listener(text))
        found: list[AddressedText] = []
        for part in parting.parts():
            last = found[-1] if found else None
            waits = part.behind is not None and part.behind != part.who
            if last is not None and last.who == part.who and not waits and not (last.past or part.past):
                joint = part.joint if re.search(r"\w", part.joint) else " and "
                found[-1] = replace(last, text=f"{last.text}{joint}{part.text}")
            else:
                found.append(part)
        return parting.listener, tuple(found)

    def listener(self, text: str) -> tuple[Addressee | None, str]:
        """Splits off the addressee of a sentence. Raises RefusalError like `find_robots`."""
        if (match := self.forms.first.match(text)) is not None:
            return self.find_robots(_who(match)), text[match.end() :]
        if (match := self.forms.last.search(text)) is not None:
            before = text[: match.start()]
            if not (before[:1].islower() and re.search(r"\b[A-Z]\w*$", before)):  # a beer for Robin, Alice and Bob
                return self.find_robots(_who(match)), before
        address = find_address(text, self.names)
        if address.name is not None:
            return (address.name,), address.text
        if (match := self.forms.called_back.search(text)) is not None:
            return self.find_robots(_who(match)), f"{text[: match.start()]}{match['mark']}{text[match.end() :]}"
        return None, text

    def imperative(self, text: str) -> str:
        """Turns statements into commands: "goes to the hall and brings" -> "go to the hall and bring"."""
        return self.forms.third_person.sub(lambda match: f"{match[1]}{_verbs()[match[2].lower()]}", text)

    def tidy(self, text: str) -> str:
        """Strips punctuation from both ends of a text, and joining words from its beginning."""
        return self.forms.begins_with_joints.sub("", text.strip(" ,;:-")).strip(" ,;:-")


@dataclass(frozen=True)
class _Found:
    """Beginning of another robot's part: the part's text begins at `end`, after the implied verb `lead`."""

    who: str
    end: int
    kind: str
    lead: str = ""


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
        text, self.address, at = self.text, self.listener, 0
        self.found = [AddressedText(self.listener, "")]
        for start in (0, *(match.end() for match in self.calls.forms.boundary.finditer(text))):
            if start < at:
                continue
            if (found := self._begins(start, at)) is not None:
                called = self.calls.find_robots(found.who) if self.listener is None and found.kind == "call" else None
                self.listener = self.listener or called
                self._take(found, text[at:start])
                at = found.end
            elif self.found[-1].past and text[:start].rstrip().endswith(","):
                self._add(text[at:start])
                self.found.append(AddressedText(self.address, "", then=True))
                at = start
        self._add(text[at:])
        if len(self.found) > 1 and not _says(self.found[-1]) and self.found[-1].behind is not None:
            behind = self.found.pop().behind
            self.found[-1] = replace(self.found[-1], behind=behind)
        return tuple(self._sentences())

    def _begins(self, start: int, at: int) -> _Found | None:
        """Part for another robot that begins here; None if none begins. Raises RefusalError if it forbids an action."""
        current, table = self.found[-1], read_table("robots.yaml")
        for kind, form in self.calls.begins:
            match = form.match(self.text, start)
            if match is None or (_who(match).lower() in table["you"] and (current.who is None or not start)):
                continue
            if kind in table["refused"]:
                raise RefusalError(f"{table['refused'][kind]}: '{match[0].strip()}'", [match[0].strip()])
            return _Found(_who(match), match.end(), kind, table["leads"].get(kind, ""))
        match = self.calls.forms.gap.match(self.text, start)
        if match is None or current.who is None or not self.text[:start].strip():
            return None
        said = self.calls.imperative(self.calls.tidy(f"{current.text}{self.text[at:start]}"))
        verb = self.calls.forms.begins_with_verb.match(said)
        return None if verb is None else _Found(match["who"], match.end(), "gap", f"{verb[1]} ")

    def _take(self, found: _Found, before: str) -> None:
        """Ends the present part with the text `before`, and begins the part that was found."""
        joint_at = self.calls.forms.joint.search(before)
        at = len(before) if joint_at is None else joint_at.start()
        said, joint = before[:at], before[at:]
        if found.kind in ("after", "wait"):
            self._add(said)
            now = self.found[-1].who
            who = now if found.kind == "wait" or self.address is None else self.address
            behind = (
                None
                if found.who.lower() in read_table("robots.yaml")["somebody"]
                else self.calls.find_robots(found.who)
            )
            behind = behind or next((one.who for one in reversed(self.found) if one.who is not None), None)
            if behind is None:
                raise RefusalError(f"who is '{found.who}'? say the robot's name", [found.who])
            self.found.append(AddressedText(who, "", joint, behind=behind))
            return
        who = self._who(found)
        bare, opener = said.strip(" ,"), ""  # a condition at its end belongs to the next part: "if there is a coke,"
        match = self.calls.forms.opener.search(bare) if found.kind != "past" else None
        if match is not None and not self.calls.forms.opened.search(match[1]):
            said, opener = bare[: match.start()], match[1]
        self._add(said)
        last = self.found[-1]
        begun = AddressedText(
            who,
            f"{opener}, {found.lead}" if opener else found.lead,
            joint,
            then=last.past or self.calls.forms.then.search(joint) is not None or (last.then and not last.text),
            behind=None if last.text else last.behind,
            otherwise=self.calls.forms.otherwise.search(joint) is not None,
            past=found.kind == "past",
        )
        self.found.append(begun)
        self.address = who if found.kind == "call" else self.address

    def _add(self, more: str) -> None:
        """Adds to the text of the last part, if the text is not empty."""
        last = self.found[-1]
        self.found[-1] = replace(last, text=self.calls.tidy(f"{last.text}{more}"))

    def _who(self, found: _Found) -> Addressee:
        """Robots that a name, "you" or "the other robot" stands for."""
        named = [name for one in self.found if isinstance(one.who, tuple) for name in one.who]
        if found.who.lower() in read_table("robots.yaml")["you"]:
            return self.calls.find_robots("the other robot", named) if self.address is None else self.address
        return self.calls.find_robots(found.who, self.address if isinstance(self.address, tuple) else named[-1:])

    def _sentences(self) -> Iterator[AddressedText]:
        """Yields the parts with text; a new sentence inside another robot's part is for the addressee again."""
        tidy, imperative = self.calls.tidy, self.calls.imperative
        for one in self.found:
            split = self.address is not None and self.address != one.who
            first, *rest = re.split(r"(?<=[.!?])\s+", one.text) if split else [one.text]
            if _says(replace(one, text=first)):
                yield replace(one, text=tidy(first) if one.past else imperative(tidy(first)))
            if rest:
                yield AddressedText(self.address, imperative(tidy(" ".join(rest))))


def _who(match: re.Match[str]) -> str:
    """Words in a match that name the robots."""
    return next(words for key, words in match.groupdict().items() if key.startswith("who") and words)


def _says(saying: AddressedText) -> bool:
    return re.search(r"\w", saying.text) is not None
