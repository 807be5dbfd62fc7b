"""What a run found out, in the words of its report: answers, speech, and what was seen on the way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from executive.app.artifacts import Artifacts
from executive.app.report import ReportedAnswer, ReportedObject, RunReport
from executive.record.reader import Event
from executive.record.sightings import seen_objects
from executive.run.outcome import Finding, RunResult
from executive.tree.compiler import StepPart
from executive.words.geometry import inside
from executive.words.knowledge import Knowledge
from skills.api import ObjectObservation

__all__ = ["with_found_out"]


def with_found_out(
    report: RunReport, knowledge: Knowledge, result: RunResult, artifacts: Artifacts, events: Sequence[Event]
) -> RunReport:
    """The report with what all missions of the run found out and said, in order, and what they saw."""
    results = [each for robot in result.robots for each in (*robot.preempting, robot)]
    parts = [part for tree in result.trees.values() for part in tree.parts]
    findings = sorted((one for each in results for one in each.findings), key=lambda one: one.t_s)
    said = sorted((one for each in results for one in each.said), key=lambda one: one.t_s)
    return replace(
        report,
        answers=tuple(_answer(one, parts, artifacts) for one in findings),
        said=tuple(said),
        seen_objects=tuple(_object(seen, knowledge) for seen in seen_objects(events)),
    )


def _answer(finding: Finding, parts: Sequence[StepPart], artifacts: Artifacts) -> ReportedAnswer:
    """A finding with the place of the command to which its node belongs, and its picture."""
    path_id = finding.path_id
    commands = (part.command for part in parts if f"{path_id}/".startswith(f"{part.path_id}/"))
    return ReportedAnswer(
        question=finding.question,
        answer=finding.answer,
        sentence=finding.sentence,
        t_s=finding.t_s,
        place=next((command.goal for command in commands if command is not None), None),
        picture=artifacts.numbers.get((path_id, finding.t_s)),
    )


def _object(seen: ObjectObservation, knowledge: Knowledge) -> ReportedObject:
    """An object that was seen, with the room that it is in."""
    x_m, y_m, _ = seen.position_W
    rooms = (name for name, room in knowledge.places.items() if inside(room.polygon, (x_m, y_m)))
    place = knowledge.room(seen.surface) if seen.surface in knowledge.surfaces else next(rooms, None)
    return ReportedObject(str(seen.thing), seen.surface, place, seen.position_W, seen.stamp_s)
