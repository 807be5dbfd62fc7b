"""History of a mission: when its parts ran, what it found and said, and the text of its claim."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.record.schemas import SPEECH
from executive.run.outcome import Execution, Finding, Said
from executive.tree.behaviour import Explained
from executive.tree.board import Board
from executive.tree.compiler import CompiledTree
from executive.tree.node import NodeSpec
from executive.tree.nodes.search import ANSWER_TOPIC
from executive.words.slug import slug
from skills.api import Part
from skills.robot import Clock

MOST_CHARS: Final = 300
_DENIALS: Final = ("no ", "not ", "nobody ", "nothing ")
_ENDED: Final = (Status.SUCCESS, Status.FAILURE)


@dataclass(frozen=True)
class HistoryKeys:
    """The blackboard keys of one mission's history: its findings, its speech and when its robot last drove.

    After a restart `answered_before` are the nodes that give their answer again, and `ended_before` those that end once
    more because they had ended before.
    """

    findings: str
    said: str
    moved: str
    answered_before: str
    ended_before: str


def history_keys(robot_name: str, mission_name: str) -> HistoryKeys:
    """The keys for a mission."""
    base = f"{slug(robot_name)}/{slug(mission_name)}"
    names = ("findings", "said", "moved", "answered-before", "executed-before")
    return HistoryKeys(*(f"{base}/{name}" for name in names))


def is_speech(node: NodeSpec) -> bool:
    """Returns whether a node is a skill that says a text."""
    says = "text" in node.options.get("inputs", {})
    return node.kind == "skill" and says and node.options["skill"].uses == {Part.VOICE}


class Executions:
    """Notes the executions of a mission's parts and of what it says, on the blackboard, which outlives a restart.

    `visited` is called with each node that a tick visits, then `after_tick`. A node that had ended before a restart,
    and whose result is only given again, keeps its first times.
    """

    def __init__(self, tree: CompiledTree, nodes: Iterable[Behaviour], board: Board, clock: Clock) -> None:
        self._board, self._clock = board, clock
        self._keys = history_keys(tree.robot_name, tree.mission_name)
        parts = {part.node or part.path_id for part in tree.parts}
        self._parts = frozenset(n.path_id for n in tree.root.walk() if n.path_id in parts or is_speech(n))
        self._below: Mapping[str, frozenset[str]] = dict(_below(tree.root, self._parts))
        self._base = frozenset(
            n.path_id for n in tree.root.walk() if n.kind == "skill" and Part.BASE in n.options["skill"].uses
        )
        named = {node.path_id: node for node in nodes if isinstance(node, Explained) and isinstance(node, Behaviour)}
        self._nodes = {path: named[path] for path in self._below if path in named}
        self._drivers = {path: named[path] for path in self._base if path in named}
        self._driving = {path for path, node in self._drivers.items() if node.status is Status.RUNNING}
        self._open = {path for path in self._nodes if (kept := self._of(path)) and kept[-1].ended_s is None}
        self._taken_up = set(self._open)
        self._moved_s = board.get(self._keys.moved) if self._keys.moved in board else None
        self._paths: Mapping[Behaviour, str] = {node: path for path, node in self._nodes.items()}
        self._running: set[Behaviour] = {node for node in self._paths if node.status is Status.RUNNING}

    @property
    def all(self) -> tuple[Execution, ...]:
        """The executions so far, in the order of their ends; those that are not over come last."""
        found = [one for path in self._parts for one in self._of(path)]
        last = float("inf")
        return tuple(sorted(found, key=lambda one: (last if one.ended_s is None else one.ended_s, one.began_s)))

    @property
    def moved_s(self) -> float | None:
        """When a skill that may drive last ran; None: never."""
        return self._moved_s

    def visited(self, node: Behaviour, stopped: bool) -> None:
        """A tick has visited a node, after those below it; it was `stopped` since its last visit."""
        path = self._paths.get(node)
        if path is None:
            return
        if stopped or node not in self._running:
            self._begin(path)
        self._running.add(node)
        if node.status in _ENDED:
            self._running.discard(node)
            self._end(path, node.status is Status.SUCCESS)

    def after_tick(self, changed: Iterable[str]) -> None:
        """Notes what was stopped in this tick, and whether the robot may drive; `changed` are nodes that changed."""
        for path in [path for path in self._open if self._nodes[path].status is not Status.RUNNING]:
            if path not in self._taken_up:
                self._end(path, done=False)
        moving = self._drivers.keys() & set(changed)
        ended = [path for path in moving if self._drivers[path].status in _ENDED]
        self._driving -= moving
        self._driving |= {path for path in moving if self._drivers[path].status is Status.RUNNING}
        if self._driving or ended:
            self._moved_s = self._clock.now()
            if moving or self._keys.moved not in self._board:
                self._board.put(self._keys.moved, self._moved_s)

    def _begin(self, path: str) -> None:
        if path in self._taken_up:
            self._taken_up.discard(path)
            return
        if path in self._open:
            self._end(path, done=False)
        self._open.add(path)
        kept = self._of(path) if path in self._parts else ()
        self._put(path, (*kept, Execution(path, self._clock.now())))

    def _end(self, path: str, done: bool) -> None:
        """An execution is over: what ran in it, below the node, does not count unless it is done."""
        self._open.discard(path)
        executions = self._of(path)
        *before, one = executions
        again = frozenset(self._board.get(self._keys.ended_before) if self._keys.ended_before in self._board else ())
        if path in again:
            self._board.put(self._keys.ended_before, again - {path})
            if done:
                self._put(path, before)
                return
        if not done:
            for below in self._below[path] - {path}:
                spoiled = (replace(each, done=each.done and each.began_s < one.began_s) for each in self._of(below))
                self._put(below, spoiled)
        over = replace(one, ended_s=self._clock.now(), done=done)
        self._put(path, (*before, over) if path in self._parts else ())

    def _of(self, path: str) -> tuple[Execution, ...]:
        key = _executions_key(path)
        kept: tuple[tuple[float, float | None, bool], ...] = self._board.get(key) if key in self._board else ()
        return tuple(Execution(path, *one) for one in kept)

    def _put(self, path: str, executions: Iterable[Execution]) -> None:
        kept = tuple((one.began_s, one.ended_s, one.done) for one in executions)
        key = _executions_key(path)
        if kept or key in self._board:
            self._board.put(key, kept)


def _executions_key(path_id: str) -> str:
    return f"{path_id}/executions"


def _below(node: NodeSpec, parts: frozenset[str]) -> Iterator[tuple[str, frozenset[str]]]:
    """The parts at and below each node that has any."""
    found = frozenset(below.path_id for below in node.walk()) & parts
    if found:
        yield node.path_id, found
        for child in node.children:
            yield from _below(child, parts)


class Findings:
    """Collects the answers and the speech of one mission.

    Any node adds a finding by publishing under `ANSWER_TOPIC`: `node`, `question`, `answer` (a truth value, a text or
    a number) and `message`, the sentence. The time and the robot are added here. What is collected stands on the
    blackboard, which is kept: a mission that goes on after a restart has its earlier findings. A node that only gives
    its earlier answer once more, as the key `answered_before` says, makes no second finding.
    """

    def __init__(self, clock: Clock, board: Board, robot_name: str, mission_name: str) -> None:
        self._clock, self._board, self._robot_name = clock, board, robot_name
        self._keys = history_keys(robot_name, mission_name)

    def message(self, topic: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """Takes note of a message of the mission; an answer gets its time and the robot's name."""
        if topic == ANSWER_TOPIC:
            message = {**message, "robot": self._robot_name, "t": round(self._clock.now(), 6)}
            finding = _finding(message)
            again = frozenset(self._kept(self._keys.answered_before))
            if finding.path_id in again:
                self._board.put(self._keys.answered_before, again - {finding.path_id})
            before = next((one for one in reversed(self.findings) if one.path_id == finding.path_id), None)
            if finding.path_id not in again or before is None or before.answer != finding.answer:
                self._board.put(self._keys.findings, (*self.findings, finding))
        elif topic == SPEECH:
            now_s = round(self._clock.now(), 6)
            said = Said(now_s, str(message.get("text", "")), bool(message.get("asked", False)))
            self._board.put(self._keys.said, (*self.said, said))
        return message

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The findings so far."""
        return self._kept(self._keys.findings)

    @property
    def said(self) -> tuple[Said, ...]:
        """What was said so far."""
        return self._kept(self._keys.said)

    def _kept(self, key: str) -> tuple[Any, ...]:
        kept: tuple[Any, ...] = self._board.get(key) if key in self._board else ()
        return kept


def _finding(message: Mapping[str, Any]) -> Finding:
    answer = message.get("answer")
    plain = answer if answer is None or isinstance(answer, bool | str | int | float) else str(answer)
    plain = str(plain) if isinstance(plain, float) and not math.isfinite(plain) else plain
    texts = (str(message.get(name, "")) for name in ("node", "question", "message"))
    path_id, question, sentence = texts
    return Finding(path_id, float(message["t"]), question, plain, sentence or str(answer))


def claim(message: str, findings: Sequence[Finding], skipped: Sequence[str] = ()) -> str:
    """What a mission that gave answers claims: the answers, then what was skipped, or else its own `message`."""
    after = f"skipped: {'; '.join(skipped)}" if skipped else message
    return "; ".join(filter(None, (findings_in_words(findings), after)))


def findings_in_words(findings: Sequence[Finding]) -> str:
    """The answers in a row: one in its own words, several briefly, each sentence once; "and N more" for the rest."""
    counts = Counter(finding.sentence for finding in findings)
    if len(counts) == 1 and len(findings) == 1:
        return findings[0].sentence
    sentences = [_brief(sentence) + (f" ({n} times)" if n > 1 else "") for sentence, n in counts.items()]
    shown: list[str] = []
    for sentence in sentences:
        if shown and len("; ".join((*shown, sentence))) > MOST_CHARS:
            break
        shown.append(sentence if len(sentence) <= MOST_CHARS else f"{sentence[: MOST_CHARS - 1]}…")
    left = len(sentences) - len(shown)
    return "; ".join(shown) + (f"; and {left} more" if left else "")


def _brief(sentence: str) -> str:
    """ "no: no hammer in the office" without its first word."""
    denied = sentence.removeprefix("no: ")
    return denied if denied.startswith(_DENIALS) else sentence
