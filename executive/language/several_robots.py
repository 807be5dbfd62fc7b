"""Understands sentences for several robots: a part for each, the order of the parts, and objects that change hands."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby
from typing import Final

from executive.language.actions import Action
from executive.language.addressees import AddressedText, Addressee, RobotChoice, addressees, named_robots
from executive.language.clauses import Clause, split
from executive.language.cleaning import called_stranger, clean
from executive.language.parser import DependencyParser
from executive.language.phrases import Phrase
from executive.language.pipeline import Pipeline, Trace
from executive.language.questions import RefusalError, RefusalKind
from executive.language.reference import Memory
from executive.language.roles import Location
from executive.language.spelling import CorrectedText, correct_spelling
from executive.language.understand import Part, Status, Understanding, look_again, meaning, under_rules, understand
from executive.language.zone_rules import read_rules
from executive.words.knowledge import Knowledge
from executive.words.robot_config import display_name, find_robot
from skills.inputs.errors import listing

_IT: Final = r"\b(?:it|them)\b"
_FROM_THERE: Final = r"\s+from there\b"


def understand_for_robots(
    sentence: str,
    *,
    robots: Sequence[str],
    parser: DependencyParser,
    knowledge: Knowledge | None,
    require_wake: bool = False,
    memory: Memory | None = None,
    correct: bool = True,
) -> Understanding:
    """Understands `sentence` in parts for the robots named `robots`; for one robot, works like `understand`.

    Any robot may do a part that names none. With several robots, `knowledge` must be given. With `require_wake` the
    sentence must call one robot by name, or all robots. The other arguments are those of `understand`. Never raises,
    whatever the text.
    """
    text = clean(sentence)
    names = tuple(map(display_name, robots))
    if len(robots) == 1:
        understood = partial(understand, sentence, parser=parser, knowledge=knowledge)
        alone = understood(require_wake=require_wake, robot_name=names[0], memory=memory, correct=correct)
        part = Part(robots[0], alone, speaker_by=robots[0])
        return replace(alone, parts=(part,)) if alone.status is Status.OK else alone
    assert knowledge is not None
    said = correct_spelling(text, knowledge, parser) if correct else CorrectedText(text)
    addressed = True
    try:
        rules = read_rules(said.text, knowledge)
        assert rules.knowledge is not None
        listener, clauses = split(rules.rest, names)
        addressed = listener is not None
        found = Understanding(sentence, Status.NOT_ADDRESSED)
        stranger = None if addressed else called_stranger(text)
        if stranger is not None and not addressees(names).find_robots(stranger):
            what = f"there is no robot called {stranger}; there are {listing(names)}"
            found = replace(found, reason=what, unknown_words=(stranger,))
        elif require_wake and not addressed:
            called = listing((f'"Hey {name}"' for name in names), last="or")
            found = replace(found, reason=f"no robot's name was said; begin with {called}")
        else:
            reader = _Reader(tuple(robots), Pipeline(parser, rules.knowledge), rules.knowledge)
            found = under_rules(rules, reader.addressed(sentence, listener, clauses, memory))
            found = look_again(said.text, found, knowledge)
    except RefusalError as refusal:
        found = Understanding(sentence, Status.REFUSED, reason=refusal.reason, unknown_words=refusal.unknown)
        return replace(found, addressed=addressed)
    return replace(found, notes=(*said.notes, *found.notes), addressed=addressed)


@dataclass(frozen=True)
class _Read:
    """Part of a sentence with its meaning, and the numbers of the parts that it waits for."""

    part: AddressedText
    meaning: Understanding
    after: frozenset[int] = frozenset()


@dataclass(frozen=True)
class _Reader:
    robots: tuple[str, ...]
    pipeline: Pipeline
    knowledge: Knowledge

    def addressed(
        self, sentence: str, listener: Addressee | None, said: Sequence[Clause], memory: Memory | None
    ) -> Understanding:
        """Understands the parts into which a sentence was split."""
        read: list[_Read] = []
        pending: tuple[Clause, ...] = ()
        parts = [tuple(clauses) for _, clauses in groupby(said, key=lambda clause: id(clause.part))]
        for number, clauses in enumerate(parts):
            part = clauses[0].part
            assert part is not None
            if pending and pending[0].part is not None:
                part = replace(part, text=f"{pending[0].part.text.rstrip(' .')}. {part.text}")
                clauses = (*pending, replace(clauses[0], joint=". "), *clauses[1:])
            one = self._read(part, clauses, read, memory)
            if one.meaning.refused_as is RefusalKind.NOTHING_TO_DO and number < len(parts) - 1:
                pending = (replace(clauses[0], part=part), *clauses[1:])
                continue
            self._refuse_as_person(one.part.text)
            if one.meaning.status is not Status.OK:
                return replace(one.meaning, text=sentence)
            pending, memory = (), one.meaning.memory
            read.append(one)
        if not read:
            raise RefusalError(f"there is nothing to do for {self._named(self.robots)} in the sentence")
        notes = tuple(dict.fromkeys(note for one in read for note in one.meaning.notes))
        return Understanding(sentence, Status.OK, notes=notes, memory=memory, parts=tuple(self._parts(read, listener)))

    def _read(
        self, part: AddressedText, clauses: Sequence[Clause], before: Sequence[_Read], memory: Memory | None
    ) -> _Read:
        """Understands a part, and finds the parts that it waits for. Raises RefusalError."""
        other = before[-1].meaning if before and before[-1].part.who != part.who else None
        known = memory or Memory()
        if other is not None:
            if part.otherwise:
                raise RefusalError("what one robot finds cannot decide what another does; say it as two requests")
            known = _left_by(other)
            if re.search(_IT, part.text):
                part = replace(part, text=re.sub(_FROM_THERE, "", part.text))
                clauses = [replace(clause, text=re.sub(_FROM_THERE, "", clause.text)) for clause in clauses]
        meant = meaning(Trace(part.text, known), self.pipeline, clauses)
        after = set(self._said_before(part, before))
        for number, earlier in enumerate(before):
            if earlier.part.who == part.who:
                continue
            if (place := _moved(earlier.meaning, meant)) is not None:
                moved = replace(known, locations=(*known.locations, *((item, place) for item in known.objects)))
                meant = meaning(Trace(part.text, moved), self.pipeline, clauses)
            if _takes_put(earlier.meaning, meant):
                after.add(number)
        if other is not None:
            self._check_in_hand(other, meant, part.who)
        self._check_one_thing(part, meant)
        return _Read(part, meant, frozenset(after))

    def _said_before(self, part: AddressedText, before: Sequence[_Read]) -> Iterator[int]:
        """Yields the parts that must be done before this part, as the sentence says."""
        for number, one in reversed([*enumerate(before)] if part.then else []):
            if one.part.who != part.who:
                yield number
            if one.after or one.part.then:
                break
        if part.behind in (None, part.who):
            return
        behind = {*named_robots(part.behind)}
        whose = ((n, {*named_robots(one.part.who)}) for n, one in enumerate(before) if one.part.who is not None)
        found = [n for n, who in whose if not behind or not who or who & behind]
        if not found:
            named = self._named(part.behind)
            raise RefusalError(f"no earlier task of {named} is in the sentence", [named])
        yield found[-1]

    def _check_in_hand(self, before: Understanding, meant: Understanding, who: Addressee | None) -> None:
        """Refuses to take an object that another robot holds or has handed over. Raises RefusalError."""
        again = any(one.again for one in _actions(meant)) or re.search(_IT, meant.text, re.IGNORECASE)
        carried = [one for one in before.commands if one.item or one.object]
        if meant.status is not Status.OK or not again or not carried:
            return
        last = carried[-1]
        put_down = last.goal is not None and self.knowledge.place(last.goal) is not None
        if put_down if last.item else last.task is not None and not last.takes:
            return
        what = f"{self._named(who)} cannot take the {last.item or last.object} then"
        raise RefusalError(f"{what}; say on which table the other robot puts it", [str(last.item or last.object)])

    def _check_one_thing(self, part: AddressedText, meant: Understanding) -> None:
        """Refuses to send several robots for one single object. Raises RefusalError."""
        several = part.who is RobotChoice.ALL or len(named_robots(part.who)) > 1
        takes = any(command.takes for command in meant.commands)
        single = [target.text for _, target in _definite(meant) if not target.plural]
        if several and takes and single:
            what = f"{self._named(part.who)} cannot all take the one {single[0]}; say which of them"
            raise RefusalError(what, single[:1])

    def _refuse_as_person(self, text: str) -> None:
        """Raises RefusalError when a part treats a robot as a person, except within quotes and descriptions."""
        said = (name for name in self.robots if re.search(rf"\b{re.escape(name)}\b", text, re.IGNORECASE))
        named = [display_name(name) for name in said if self.knowledge.person(name) is None]
        quotes = re.match(r"(?:say|announce|shout)\b(?!.* to \w+\W*$)", text, re.IGNORECASE)
        calls = addressees(self.robots)
        if named and not quotes and calls.name.search(calls.without_descriptions(text)):
            reason = (
                f"{named[0]} is a robot, and not somebody to go to or to hand objects to; "
                f"say what {named[0]} is to do, or put objects on a table and let {named[0]} bring them from there"
            )
            raise RefusalError(reason, named[:1])

    def _parts(self, read: Sequence[_Read], listener: Addressee | None) -> Iterator[Part]:
        """Yields a part for each robot that each part of the text addresses."""
        by = next((find_robot(name, self.robots) for name in named_robots(listener)), None)
        numbers: list[range] = []
        for one in read:
            robots = [find_robot(name, self.robots) or name for name in named_robots(one.part.who)]
            who: list[str | RobotChoice] = [*robots] or [RobotChoice(one.part.who or RobotChoice.ANY)]
            after = tuple(sorted({at for number in one.after for at in numbers[number]}))
            begin = numbers[-1].stop if numbers else 0
            numbers.append(range(begin, begin + len(who)))
            yield from (Part(robot, one.meaning, after, by) for robot in who)

    def _named(self, who: Addressee | None) -> str:
        names = named_robots(who) or self.robots
        return listing(map(display_name, names), last="and" if who is not None else "or")


def _actions(meant: Understanding) -> Sequence[Action]:
    """Actions of a text, in which each pronoun is replaced by what it means."""
    return () if meant.trace is None else meant.trace.resolved


def _definite(meant: Understanding) -> list[tuple[Action, Phrase]]:
    """Actions on a certain object ("the beer"), and the object."""
    targets = ((one, one.target) for one in _actions(meant))
    return [(one, target) for one, target in targets if target is not None and not target.indefinite]


def _takes_put(before: Understanding, meant: Understanding) -> bool:
    """Returns whether `meant` takes an object from where it was put before."""
    put = {(str(one.item), one.goal) for one in before.commands if one.item is not None}
    return any((str(one.object), one.goal) in put for one in meant.commands if one.takes)


def _moved(before: Understanding, meant: Understanding) -> Location | None:
    """Last destination of an object that `meant` names again without a place ("the beer")."""
    texts = {target.text for one, target in _definite(meant) if one.source is None and not one.again}
    named = before.memory is not None and any(item.text in texts for item in before.memory.objects)
    puts = any(command.item is not None for command in before.commands)
    return _where(before) if named and puts and meant.status is Status.OK else None


def _left_by(meant: Understanding) -> Memory:
    """Memory after a text, in which objects are where they were put, or looked for."""
    memory, place = meant.memory or Memory(), _where(meant)
    return memory if place is None else replace(memory, where=place, place=place)


def _where(meant: Understanding) -> Location | None:
    """Last known place of the objects; None if the place is unknown or a person has them."""
    memory, actions = meant.memory or Memory(), _actions(meant)
    places = [one.goal or one.source for one in actions if one.target in memory.objects]
    place = places[-1] if places else None if actions else memory.place
    return None if place is None or place.phrase is None or place.living else place
