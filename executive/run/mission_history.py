"""Records a mission's history: executions of its steps, findings and speech; composes the text of its claim."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, pairwise
from typing import Any, Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.run.outcome import Execution, Finding, Said
from executive.tree.behaviour import Explained
from executive.tree.board import Board
from executive.tree.compiler import CompiledTree
from executive.tree.context import ANSWER_TOPIC
from executive.tree.node import NodeSpec
from executive.words.goal import GoalKind
from executive.words.schemas import SPEECH
from executive.words.slug import slug
from skills.api import Part
from skills.robot import Clock

MOST_CHARS: Final = 300
BEFORE: Final = "before the restart"
"""What the message of a step says that an earlier process has done."""
_GO: Final = "go to "
_JOINED: Final = (" and ", " or ")
_WITHOUT_NEWS: Final = (GoalKind.WENT, GoalKind.ANSWERED, GoalKind.DOOR_OPEN, GoalKind.MET, GoalKind.PICTURED)
"""Goals that change nothing: the answers tell them, or where the robot is."""
_LET_GO: Final = (GoalKind.HANDED_OVER, GoalKind.PLACED)
_DENIALS: Final = ("no ", "not ", "nobody ", "nothing ")
_ENDED: Final = (Status.SUCCESS, Status.FAILURE)


@dataclass(frozen=True)
class HistoryKeys:
    """Blackboard keys of one mission's history: its findings, its speech, and the time when its robot last drove.

    After a restart, `answered_before` has the nodes that will repeat an answer, and `ended_before` has the nodes that
    will end again because they had already ended before the restart.
    """

    findings: str
    said: str
    moved: str
    answered_before: str
    ended_before: str


def history_keys(robot_name: str, mission_name: str) -> HistoryKeys:
    """Returns the blackboard keys of a mission's history."""
    base = f"{slug(robot_name)}/{slug(mission_name)}"
    names = ("findings", "said", "moved", "answered-before", "executed-before")
    return HistoryKeys(*(f"{base}/{name}" for name in names))


def is_speech(node: NodeSpec) -> bool:
    """Returns whether a node is a skill that speaks a text."""
    return node.skill is not None and "text" in node.options.get("inputs", {}) and node.skill.uses == {Part.VOICE}


def looks_of(node: NodeSpec) -> Mapping[str, Sequence[str]]:
    """Returns the looks on which a node's answer rests: the path ids of the leaves for each surface or room."""
    looks: Mapping[str, Sequence[str]] = node.options.get("looks", {}) if node.behaviour.answers else {}
    return looks


class Executions:
    """Record on the blackboard of when a mission's steps, speech and looks were executed; it survives a restart.

    The run calls `note_visit` with each node that a tick visits, then `after_tick`. A node that only repeats its result
    from before a restart keeps the times that it had then.
    """

    def __init__(self, tree: CompiledTree, nodes: Iterable[Behaviour], board: Board, clock: Clock) -> None:
        self._board, self._clock = board, clock
        self._keys = history_keys(tree.robot_name, tree.mission_name)
        parts = {part.node or part.path_id for part in tree.parts}
        parts |= {leaf for node in tree.root.walk() for leaves in looks_of(node).values() for leaf in leaves}
        self._parts = frozenset(n.path_id for n in tree.root.walk() if n.path_id in parts or is_speech(n))
        self._below: Mapping[str, frozenset[str]] = _below(tree.root, self._parts)
        self._base = frozenset(n.path_id for n in tree.root.walk() if n.skill is not None and Part.BASE in n.skill.uses)
        named = {node.path_id: node for node in nodes if isinstance(node, Explained) and isinstance(node, Behaviour)}
        self._nodes = {path: named[path] for path in self._below if path in named}
        self._drivers = {path: named[path] for path in self._base if path in named}
        self._driving = {path for path, node in self._drivers.items() if node.status is Status.RUNNING}
        self._open = {path for path in self._nodes if (ran := self._executions(path)) and ran[-1].ended_s is None}
        self._resumed = set(self._open)
        self.moved_s: float | None = board.get(self._keys.moved, None)
        """Time (s) at which a skill that may drive last ran; None if none has run."""
        self._paths: Mapping[Behaviour, str] = {node: path for path, node in self._nodes.items()}
        self._running: set[Behaviour] = {node for node in self._paths if node.status is Status.RUNNING}

    @property
    def all(self) -> tuple[Execution, ...]:
        """All executions so far in the order in which they ended; unfinished executions come last."""
        found = [one for path in self._parts for one in self._executions(path)]
        last = float("inf")
        return tuple(sorted(found, key=lambda one: (last if one.ended_s is None else one.ended_s, one.began_s)))

    def note_visit(self, node: Behaviour, stopped: bool) -> None:
        """Records that a tick has visited a node; with `stopped`, the node was stopped since its last visit."""
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
        """Records which nodes the tick stopped and whether the robot may drive; `changed` has changed path ids."""
        for path in [path for path in self._open if self._nodes[path].status is not Status.RUNNING]:
            if path not in self._resumed:
                self._end(path, done=False)
        moving = self._drivers.keys() & set(changed)
        ended = [path for path in moving if self._drivers[path].status in _ENDED]
        self._driving -= moving
        self._driving |= {path for path in moving if self._drivers[path].status is Status.RUNNING}
        if self._driving or ended:
            self.moved_s = self._clock.now()
            if moving or self._keys.moved not in self._board:
                self._board.put(self._keys.moved, self.moved_s)

    def _begin(self, path: str) -> None:
        if path in self._resumed:
            self._resumed.discard(path)
            return
        if path in self._open:
            self._end(path, done=False)
        self._open.add(path)
        before = self._executions(path) if path in self._parts else ()
        self._put(path, (*before, Execution(path, self._clock.now())))

    def _end(self, path: str, done: bool) -> None:
        """Ends an execution; if it is not `done`, executions below the node during it do not count as done either."""
        self._open.discard(path)
        *before, one = self._executions(path)
        again = frozenset(self._board.get(self._keys.ended_before, ()))
        if path in again:
            self._board.put(self._keys.ended_before, again - {path})
            if done:
                self._put(path, before)
                return
        if not done:
            for below in self._below[path] - {path}:
                executions = self._executions(below)
                self._put(below, (replace(each, done=each.done and each.began_s < one.began_s) for each in executions))
        over = replace(one, ended_s=self._clock.now(), done=done, succeeded=done)
        self._put(path, (*before, over) if path in self._parts else ())

    def _executions(self, path: str) -> tuple[Execution, ...]:
        stored: tuple[tuple[float, float | None, bool, bool], ...] = self._board.get(f"{path}/executions", ())
        return tuple(Execution(path, *one) for one in stored)

    def _put(self, path: str, executions: Iterable[Execution]) -> None:
        stored = tuple((one.began_s, one.ended_s, one.done, one.succeeded) for one in executions)
        key = f"{path}/executions"
        if stored or key in self._board:
            self._board.put(key, stored)


def _below(node: NodeSpec, parts: frozenset[str]) -> Mapping[str, frozenset[str]]:
    """Returns each node that is a step of the mission or has steps below it, parents first, with all these steps."""
    below = [_below(child, parts) for child in node.children]
    own = (parts & {node.path_id}).union(*(next(iter(each.values()), ()) for each in below))
    return {node.path_id: own, **dict(chain.from_iterable(each.items() for each in below))} if own else {}


class Findings:
    """Collection of the answers and the speech of one mission.

    Any node adds a finding by publishing under `ANSWER_TOPIC`: `node`, `question`, `answer` (a truth value, a text or a
    number, perhaps `at_least` so many) and `message`, the sentence. The collection adds the time and the robot. It lies
    on the blackboard, so that a mission that continues after a restart has its earlier findings. A node listed under
    `answered_before` repeats its answer without a second finding.
    """

    def __init__(self, clock: Clock, board: Board, robot_name: str, mission_name: str) -> None:
        self._clock, self._board, self._robot_name = clock, board, robot_name
        self._keys = history_keys(robot_name, mission_name)

    def message(self, topic: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """Records a message of the mission and returns it; adds the time and the robot's name to an answer."""
        if topic == ANSWER_TOPIC:
            message = {**message, "robot": self._robot_name, "t": round(self._clock.now(), 6)}
            finding = _finding(message)
            again = frozenset(self._board.get(self._keys.answered_before, ()))
            if finding.path_id in again:
                self._board.put(self._keys.answered_before, again - {finding.path_id})
            before = next((one for one in reversed(self.findings) if one.path_id == finding.path_id), None)
            if finding.path_id not in again or before is None or before.answer != finding.answer:
                self._board.put(self._keys.findings, (*self.findings, finding))
        elif topic == SPEECH:
            now_s = round(self._clock.now(), 6)
            asked, silent = bool(message.get("asked", False)), str(message.get("silent", ""))
            said = Said(now_s, str(message.get("text", "")), asked, silent)
            self._board.put(self._keys.said, (*self.said, said))
        return message

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings so far."""
        found: tuple[Finding, ...] = self._board.get(self._keys.findings, ())
        return found

    @property
    def said(self) -> tuple[Said, ...]:
        """All sentences that the robot has said so far."""
        said: tuple[Said, ...] = self._board.get(self._keys.said, ())
        return said


def _finding(message: Mapping[str, Any]) -> Finding:
    answer = message.get("answer")
    plain = answer if answer is None or isinstance(answer, bool | str | int | float) else str(answer)
    plain = str(plain) if isinstance(plain, float) and not math.isfinite(plain) else plain
    path_id, question, sentence = (str(message.get(name, "")) for name in ("node", "question", "message"))
    least = bool(message.get("at_least", False))
    return Finding(path_id, float(message["t"]), question, plain, sentence or str(answer), least)


def claim(message: str, findings: Sequence[Finding], skipped: Sequence[str] = ()) -> str:
    """Composes a mission's claim from its answers, and from the skipped steps or, if none were skipped, `message`."""
    after = f"skipped: {'; '.join(skipped)}" if skipped else message
    return "; ".join(filter(None, (findings_in_words(findings), after)))


def achieved(reached: Sequence[tuple[GoalKind, str, str]], message: str) -> str:
    """Sums a mission up: what its steps have changed, else the places where the robot went; `message` without goals.

    `reached` has the kind of goal, the name and the message of each step. What was grasped and then put down or handed
    over is one change. A `message` that is empty stands for answers, which say enough where nothing was changed.
    """
    given_up = [number for number, (kind, _, _) in enumerate(reached) if kind in _LET_GO]
    news = [
        told
        for number, (kind, _, told) in enumerate(reached)
        if kind not in _WITHOUT_NEWS and not (kind is GoalKind.GRASPED and any(later > number for later in given_up))
    ]
    went = [name.removeprefix(_GO) for kind, name, _ in reached if kind is GoalKind.WENT and name.startswith(_GO)]
    if news or not message:
        return _counted(Counter(news))
    *first, last = list(dict.fromkeys(went)) or [""]
    places = f"{', '.join(first)} and {last}" if first else last
    return f"went to {places}" if places and all(kind is GoalKind.WENT for kind, _, _ in reached) else message


def findings_in_words(findings: Sequence[Finding]) -> str:
    """Text of the answers: a single one in full, several shortened and without repetition, the rest as "and N more"."""
    pairs = [(look, decision) for look, decision in pairwise(findings) if _repeats(look, decision)]
    again = [decision if look.answer == decision.answer else look for look, decision in pairs]
    findings = [one for one in findings if one not in again]
    counts = Counter(finding.sentence for finding in findings)
    if len(counts) == 1 and len(findings) == 1:
        return findings[0].sentence
    return _counted(counts)


def _repeats(look: Finding, decision: Finding) -> bool:
    """Returns whether a decision on one condition rests on the look that was just before it."""
    inside = look.path_id.startswith(f"{decision.path_id}/")
    return inside and not any(word in decision.question for word in _JOINED)


def _counted(counts: Mapping[str, int]) -> str:
    """Joins sentences with their counts up to `MOST_CHARS`; the rest is "and N more"."""
    sentences = [_brief(sentence) + (f" ({n} times)" if n > 1 else "") for sentence, n in counts.items()]
    shown: list[str] = []
    for sentence in sentences:
        if shown and len("; ".join((*shown, sentence))) > MOST_CHARS:
            break
        shown.append(sentence if len(sentence) <= MOST_CHARS else f"{sentence[: MOST_CHARS - 1]}…")
    left = len(sentences) - len(shown)
    return "; ".join(shown) + (f"; and {left} more" if left else "")


def _brief(sentence: str) -> str:
    """Shortens an answer such as "no: no hammer in the office" by its first word."""
    denied = sentence.removeprefix("no: ")
    return denied if denied.startswith(_DENIALS) else sentence
