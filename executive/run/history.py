"""What a mission found out and what it said, in order, and what of it the mission's claim tells."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from executive.record.schemas import SPEECH
from executive.run.outcome import Finding, Said
from executive.run.visitor import RunVisitor
from executive.tree.behaviours.answer import ANSWER_TOPIC
from executive.tree.board import Board
from executive.words.slug import slug
from skills.robot import Clock

__all__ = ["Findings", "claim", "finding_keys", "findings_in_words"]

MOST_CHARS: Final = 300
_DENIALS: Final = ("no ", "not ", "nobody ", "nothing ")


@dataclass(frozen=True)
class FindingKeys:
    """The blackboard keys of one mission's findings, its speech, and the nodes that are to give their answer again."""

    findings: str
    said: str
    again: str


def finding_keys(robot_name: str, mission_name: str) -> FindingKeys:
    """The keys for a mission."""
    base = f"{slug(robot_name)}/{slug(mission_name)}"
    return FindingKeys(f"{base}/findings", f"{base}/said", f"{base}/answered-before")


class Findings(RunVisitor):
    """Collects the answers and the speech of one mission.

    Any node adds a finding by publishing under `ANSWER_TOPIC`: `node`, `question`, `answer` (a truth value, a text or
    a number) and `message`, the sentence. The time and the robot are added here. What is collected stands on the
    blackboard, which is kept: a mission that goes on after a restart has its earlier findings. A node that only gives
    its earlier answer once more, as the key `again` says, makes no second finding.
    """

    def __init__(self, clock: Clock, board: Board, robot_name: str, mission_name: str) -> None:
        self._clock, self._board, self._robot_name = clock, board, robot_name
        self._keys = finding_keys(robot_name, mission_name)

    def message(self, topic: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """Take note of a message of the mission; an answer gets its time and the robot's name."""
        if topic == ANSWER_TOPIC:
            message = {**message, "robot": self._robot_name, "t": round(self._clock.now(), 6)}
            self._add(_finding(message))
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

    def _add(self, finding: Finding) -> None:
        again = self._board.get(self._keys.again) if self._keys.again in self._board else frozenset()
        if finding.path_id in again:
            self._board.put(self._keys.again, again - {finding.path_id})
            before = next((one for one in reversed(self.findings) if one.path_id == finding.path_id), None)
            if before is not None and before.answer == finding.answer:
                return
        self._board.put(self._keys.findings, (*self.findings, finding))

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
