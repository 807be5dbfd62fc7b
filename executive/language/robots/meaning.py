"""What a sentence means for several robots: a part for each, and which parts wait for which."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from executive.language.cleaning import clean
from executive.language.parser import DependencyParser
from executive.language.questions import Answerer, ClarifyingQuestion, RefusalError, RefusalKind, with_answer
from executive.language.reference import Memory
from executive.language.robots.calls import Whom, calls_of
from executive.language.robots.cutting import Cut, Piece, Who, cut_by_robot, narrates
from executive.language.robots.handing import handed_on, moved, takes_what_was_put, with_place
from executive.language.understand import Status, Understanding, understand
from executive.words.knowledge import Knowledge
from executive.words.robots import display_name, robot_called
from skills.files.errors import listing

__all__ = ["Addressed", "Part", "Whom", "understand_for_robots", "understand_for_robots_asking"]


@dataclass(frozen=True)
class Part:
    """What one robot is to do, or each (`Whom.ALL`), or any (`Whom.ANY`), once the parts `after` (from 0) are done.

    `speaker_by` is the robot by whose start the speaker stands: "me" and "here" are there. None: by the world's start.
    """

    robot: str | Whom
    meaning: Understanding
    after: tuple[int, ...] = ()
    speaker_by: str | None = None

    def to_json(self) -> dict[str, Any]:
        """The part as JSON values."""
        robot = self.robot.value if isinstance(self.robot, Whom) else self.robot
        return {
            "robot": robot,
            "after": list(self.after),
            "speaker_by": self.speaker_by,
            "meaning": self.meaning.to_json(),
        }


@dataclass(frozen=True)
class Addressed:
    """A sentence for several robots: its parts when `status` is OK, else the reason in one line.

    `question`, `notes`, `unknown_words` and `memory` are as those of `Understanding`.
    """

    text: str
    status: Status
    parts: tuple[Part, ...] = ()
    reason: str | None = None
    unknown_words: tuple[str, ...] = ()
    question: ClarifyingQuestion | None = None
    notes: tuple[str, ...] = ()
    memory: Memory | None = field(default=None, compare=False)

    def to_json(self) -> dict[str, Any]:
        """The answer as JSON values."""
        return {
            "text": self.text,
            "status": self.status.value,
            "reason": self.reason,
            "unknown_words": list(self.unknown_words),
            "question": None if self.question is None else self.question.to_json(),
            "notes": list(self.notes),
            "parts": [part.to_json() for part in self.parts],
        }


def understand_for_robots(
    sentence: str,
    *,
    robots: Sequence[str],
    parser: DependencyParser,
    knowledge: Knowledge,
    require_wake: bool = False,
    memory: Memory | None = None,
    correct: bool = True,
) -> Addressed:
    """What `sentence` asks of the robots called `robots`; with one robot just what `understand` makes of it.

    A part that nobody is named for is for any of them. `require_wake` says that one of the names, or a word that calls
    all, must be said. The other arguments are those of `understand`. Never raises on text.
    """
    reader = _Reader(tuple(robots), parser, knowledge, correct)
    if len(robots) == 1:
        meant = reader.meaning(sentence, robots[0], memory, require_wake)
        return _of_one(meant, robots[0])
    text = clean(sentence)
    stranger = re.match(rf"\W*{_GREETING}\b[\s,]+(?P<name>[A-Z][\w'-]*)\s*,", text)
    try:
        cut = cut_by_robot(text, tuple(map(display_name, robots)))
        if cut.listener is None and stranger is not None and not _calls_all(stranger["name"], robots):
            what = f"there is no robot called {stranger['name']}; there are {listing(map(display_name, robots))}"
            return Addressed(sentence, Status.NOT_ADDRESSED, reason=what, unknown_words=(stranger["name"],))
        if require_wake and cut.listener is None:
            called = listing((f'"Hey {display_name(name)}"' for name in robots), last="or")
            reason = f"no robot's name was said; begin with {called}"
            return Addressed(sentence, Status.NOT_ADDRESSED, reason=reason)
        return reader.addressed(sentence, cut, memory)
    except RefusalError as refusal:
        return Addressed(sentence, Status.REFUSED, reason=refusal.reason, unknown_words=tuple(refusal.unknown))


def understand_for_robots_asking(
    sentence: str,
    *,
    answer: Answerer,
    robots: Sequence[str],
    parser: DependencyParser,
    knowledge: Knowledge,
    require_wake: bool = False,
    correct: bool = True,
) -> Addressed:
    """The same once its questions are answered; one that is left open is what comes back."""
    for _ in range(_MOST_QUESTIONS + 1):
        meant = understand_for_robots(
            sentence, robots=robots, parser=parser, knowledge=knowledge, require_wake=require_wake, correct=correct
        )
        said = None if meant.question is None else answer(meant.question)
        if meant.question is None or said is None:
            break
        sentence = with_answer(sentence, meant.question, said)
    return meant


def _of_one(meant: Understanding, robot: str) -> Addressed:
    """The meaning of a sentence where there is but one robot."""
    parts = (Part(robot, meant, speaker_by=robot),) if meant.status is Status.OK else ()
    rest = (meant.reason, meant.unknown_words, meant.question, meant.notes, meant.memory)
    return Addressed(meant.text, meant.status, parts, *rest)


def _calls_all(name: str, robots: Sequence[str]) -> bool:
    return re.fullmatch(calls_of(tuple(robots)).called, name, re.IGNORECASE) is not None


@dataclass(frozen=True)
class _Read:
    """A piece with its meaning, and the numbers of the pieces that it waits for."""

    piece: Piece
    meaning: Understanding
    after: frozenset[int] = frozenset()


@dataclass(frozen=True)
class _Reader:
    robots: tuple[str, ...]
    parser: DependencyParser
    knowledge: Knowledge
    correct: bool

    def meaning(self, text: str, robot: str, memory: Memory | None, require_wake: bool = False) -> Understanding:
        """What a text without other robots means."""
        return understand(
            text,
            parser=self.parser,
            knowledge=self.knowledge,
            require_wake=require_wake,
            robot_name=display_name(robot),
            memory=memory,
            correct=self.correct,
        )

    def addressed(self, sentence: str, cut: Cut, memory: Memory | None) -> Addressed:
        """The parts of a sentence that was cut."""
        read: list[_Read] = []
        pieces, told = _joined(cut.pieces), ""
        for number, piece in enumerate(pieces):
            if piece.deed:
                piece = replace(piece, text=self._to_do(piece.text))
            text = f"{told}{piece.text}"
            one = self._read(replace(piece, text=text), read, memory)
            last = number == len(pieces) - 1
            if _only_tells(one.meaning) and not last:
                told = f"{text.rstrip(' .')}. "
                continue
            if (refused := self._refused(sentence, one)) is not None:
                return refused
            told, memory = "", one.meaning.memory
            read.append(one)
        if not read:
            names = listing(map(display_name, self.robots))
            return Addressed(sentence, Status.REFUSED, reason=f"nothing was said that {names} could do")
        notes = tuple(dict.fromkeys(note for one in read for note in one.meaning.notes))
        return Addressed(sentence, Status.OK, tuple(self._parts(read, cut)), notes=notes, memory=memory)

    def _read(self, piece: Piece, before: Sequence[_Read], memory: Memory | None) -> _Read:
        """The meaning of a piece, and what it waits for. Raises RefusalError."""
        if piece.otherwise and before and before[-1].piece.who != piece.who:
            raise RefusalError("what one robot finds cannot decide what another does; say it as two requests")
        robot = piece.who[0] if isinstance(piece.who, tuple) else self.robots[0]
        changes_hands = bool(before) and before[-1].piece.who != piece.who
        memory = handed_on(before[-1].meaning) if changes_hands else memory
        text = (
            re.sub(r"\s+from there\b", "", piece.text) if changes_hands and re.search(_IT, piece.text) else piece.text
        )
        piece = replace(piece, text=text)
        meant = self.meaning(piece.text, robot, memory)
        after = set(self._said_before(piece, before))
        for number, other in enumerate(before):
            if other.piece.who == piece.who:
                continue
            if (place := moved(other.meaning, meant)) is not None and memory is not None:
                meant = self.meaning(piece.text, robot, with_place(memory, place))
            if takes_what_was_put(other.meaning, meant):
                after.add(number)
        if changes_hands:
            self._check_in_hand(before[-1].meaning, meant, piece.who)
        self._check_one_thing(piece, meant)
        return _Read(piece, meant, frozenset(after))

    def _said_before(self, piece: Piece, before: Sequence[_Read]) -> Iterator[int]:
        """The pieces that are said to come before one."""
        if piece.then:
            yield from (n for n in _side_by_side(before) if before[n].piece.who != piece.who)
        if piece.behind is None or piece.behind == piece.who:
            return
        found = [n for n, other in enumerate(before) if _share(other.piece.who, piece.behind)]
        if not found:
            who = listing(map(display_name, piece.behind if isinstance(piece.behind, tuple) else self.robots))
            raise RefusalError(f"nothing was said that {who} is to do before", [who])
        yield found[-1]

    def _check_in_hand(self, before: Understanding, meant: Understanding, who: Who | None) -> None:
        """Refuse to take what another robot holds, or has given away."""
        again = meant.trace is not None and any(one.again for one in meant.trace.resolved)
        again = again or re.search(_IT, meant.text, re.IGNORECASE) is not None
        carried = [command for command in before.commands if command.item is not None or command.object is not None]
        if meant.status is not Status.OK or not again or not carried:
            return
        last = carried[-1]
        goal = last.goal
        if last.task is not None and last.item is None and last.task.value != "grasp":
            return
        gone = last.item is None or goal is None or self.knowledge.place(goal) is None
        if gone:
            thing = last.item or last.object
            raise RefusalError(
                f"the {thing} is then not where {self._named(who)} can take it; say on which table it is put before",
                [str(thing)],
            )

    def _check_one_thing(self, piece: Piece, meant: Understanding) -> None:
        """Refuse to send several robots for the one thing."""
        several = piece.who is Whom.ALL or (isinstance(piece.who, tuple) and len(piece.who) > 1)
        if not several or meant.trace is None:
            return
        grasps = {str(command.object) for command in meant.commands if command.task and command.task.value == "grasp"}
        targets = (one.target for one in meant.trace.resolved)
        definite = [target for target in targets if target is not None and not target.indefinite and not target.plural]
        if grasps and definite:
            what = f"{self._named(piece.who)} cannot all take the one {definite[0].text}; say which of them"
            raise RefusalError(what, [definite[0].text])

    def _refused(self, sentence: str, one: _Read) -> Addressed | None:
        """The answer where a piece is not understood, or speaks of a robot as of a person."""
        meant = one.meaning
        named = [name for name in self.robots if re.search(rf"\b{re.escape(name)}\b", one.piece.text, re.IGNORECASE)]
        named = [name for name in named if self.knowledge.person(name) is None]
        if named and not narrates(one.piece.text, self.robots) and not _quotes(one.piece.text):
            name = display_name(named[0])
            reason = (
                f"{name} is a robot, and not somebody to go to or to hand things to; "
                f"say what {name} is to do, or put things on a table and let {name} bring them from there"
            )
            return Addressed(sentence, Status.REFUSED, reason=reason, unknown_words=(name,))
        if meant.status is Status.OK:
            return None
        return Addressed(
            sentence, meant.status, (), meant.reason, meant.unknown_words, meant.question, meant.notes, meant.memory
        )

    def _parts(self, read: Sequence[_Read], cut: Cut) -> Iterator[Part]:
        """A part for each robot of each piece."""
        listener = cut.listener
        by = robot_called(listener[0], self.robots) if isinstance(listener, tuple) else None
        numbers: list[tuple[int, ...]] = []
        count = 0
        for one in read:
            who = self._who(one.piece.who)
            after = tuple(sorted({at for number in one.after for at in numbers[number]}))
            numbers.append(tuple(range(count, count + len(who))))
            count += len(who)
            yield from (Part(robot, one.meaning, after, by) for robot in who)

    def _who(self, who: Who | None) -> tuple[str | Whom, ...]:
        """The robots as they are called in the run."""
        if not isinstance(who, tuple):
            return (who or Whom.ANY,)
        return tuple(robot_called(name, self.robots) or name for name in who)

    def _named(self, who: Who | None) -> str:
        names = who if isinstance(who, tuple) else self.robots
        return listing(map(display_name, names), last="and" if who is not None else "or")

    def _to_do(self, deed: str) -> str:
        """What was done as what is to be done: "has brought a coke" -> "bring a coke"."""
        said = f"She has {deed}"
        tokens = self.parser.parse(said)
        verb = next((token for token in tokens[2:3]), None)
        return deed if verb is None else f"{verb.lemma} {said[verb.start + len(verb.text) :].strip()}"


def _joined(pieces: Sequence[Piece]) -> tuple[Piece, ...]:
    """Pieces in a row for the same robots as one."""
    found: list[Piece] = []
    for piece in pieces:
        last = found[-1] if found else None
        waits = piece.behind is not None and piece.behind != piece.who
        if last is not None and last.who == piece.who and not waits and not (last.deed or piece.deed):
            joint = ", otherwise " if piece.otherwise else ", then " if piece.then else " and "
            found[-1] = replace(last, text=f"{last.text}{joint}{piece.text}")
        else:
            found.append(piece)
    return tuple(found)


def _side_by_side(before: Sequence[_Read]) -> Iterator[int]:
    """The last piece, and those right before it that it does not wait for."""
    for number in range(len(before) - 1, -1, -1):
        yield number
        if before[number].after or before[number].piece.then:
            return


def _share(one: Who | None, other: Who) -> bool:
    """Whether robots are among others."""
    if isinstance(one, tuple) and isinstance(other, tuple):
        return bool(set(one) & set(other))
    return one is not None


def _only_tells(meant: Understanding) -> bool:
    """Whether a text only tells how something is."""
    return meant.status is Status.REFUSED and meant.refused_as is RefusalKind.NOTHING_TO_DO


def _quotes(text: str) -> bool:
    """Whether a text has the robot say something of another, and not to it."""
    return re.match(r"(?:say|announce|shout)\b(?!.* to \w+\W*$)", text, re.IGNORECASE) is not None


_MOST_QUESTIONS: Final = 3
_GREETING: Final = r"(?i:hey|hi|ok|okay|hello)"
_IT: Final = r"\b(?:it|them)\b"
