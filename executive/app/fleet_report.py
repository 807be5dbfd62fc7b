"""What a fleet's run leaves in its folder: the missions in the log, and a report of each of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from executive.app.artifacts import Artifacts
from executive.app.report import VERDICTS
from executive.app.report_file import EndedTree, MissionRow, ReportPage, ReportPart, map_of, part_of, save_report
from executive.record.reader import Event
from executive.store.given import GivenMission, GivenMissions
from executive.store.missions import MissionState, MissionStore, StoredMission

__all__ = ["EndedMission", "mission_rows", "missions_message", "told", "write_fleet_report"]

_OPEN = frozenset({MissionState.QUEUED.value, MissionState.RUNNING.value})


@dataclass(frozen=True)
class EndedMission:
    """A mission's tree as a robot left it; it was under way between two times (s on the robots' clock)."""

    number: int
    ended: EndedTree
    since_s: float
    until_s: float


def told(store: MissionStore, numbers: Sequence[int]) -> list[dict[str, Any]]:
    """Missions as JSON values, with their parts and what they are part of: whose each is or was, and how it ended."""
    given = GivenMissions(store).all()
    missions = {mission.id: mission for mission in store.missions()}
    wanted = {*numbers, *(whole for number in numbers if (whole := given.get(number, GivenMission()).part_of))}
    wanted |= {number for number, each in given.items() if each.part_of in wanted}
    return [_told(missions[number], given) for number in sorted(wanted)]


def _told(mission: StoredMission, given: Mapping[int, GivenMission]) -> dict[str, Any]:
    known = given.get(mission.id, GivenMission())
    parts = [each.robot for each in given.values() if each.part_of == mission.id and each.robot is not None]
    return {
        "id": mission.id,
        "robot": parts[-1] if parts else known.robot,
        "outcome": mission.state.value,
        "referee": known.referee,
        "reassigned": known.reassigned,
        "message": mission.message,
        "part_of": known.part_of,
        "after": known.follows,
    }


def missions_message(store: MissionStore, told: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    """Missions as the log has them: what was asked for, whose each is or was, and how it ended."""
    requests = {each.id: each.request for each in store.missions()}
    keys = ("id", "robot", "outcome", "reassigned", "message")
    rows = [
        {**{key: each[key] for key in keys}, "sentence": requests[each["id"]].sentence or requests[each["id"]].name}
        for each in told
    ]
    return {"missions": rows}


def mission_rows(store: MissionStore, told: Sequence[Mapping[str, Any]]) -> Sequence[MissionRow]:
    """Missions as the report has them."""
    rows = zip(missions_message(store, told)["missions"], told, strict=True)
    return [_row(row, each["referee"]) for row, each in rows]


def _row(row: Mapping[str, Any], referee: Mapping[str, Any] | None) -> MissionRow:
    seen = None if referee is None else referee["success"]
    word = row["outcome"] if referee is None else f"{row['outcome']}, {VERDICTS[seen]}"
    good = None if row["outcome"] in _OPEN else row["outcome"] == MissionState.SUCCESS.value and seen is not False
    return MissionRow(row["id"], row["sentence"], row["robot"] or "", good, word, row["reassigned"], row["message"])


def write_fleet_report(
    out: Path,
    rows: Sequence[MissionRow],
    ended: Sequence[EndedMission],
    robots: Mapping[str, str],
    artifacts: Artifacts,
    events: Sequence[Event],
    facts: Sequence[tuple[str, str]],
) -> Path:
    """Write the report of a fleet's run; its path. `robots` are their names and kinds."""
    did = sum(row.good is True for row in rows)
    page = ReportPage(
        title="Fleet",
        request=f"{did} of {len(rows)} missions done",
        facts=(("robots", ", ".join(f"{name} ({kind})" for name, kind in robots.items())), *facts),
        missions=rows,
        map=map_of(artifacts, events, several=len(robots) > 1),
        parts=[_part(each, tuple(robots), artifacts, events) for each in ended],
    )
    return save_report(out, page)


def _part(mission: EndedMission, robots: Sequence[str], artifacts: Artifacts, events: Sequence[Event]) -> ReportPart:
    name = mission.ended.tree.robot_name
    own = [event for event in events if mission.since_s <= event.stamp_s <= mission.until_s]
    title = f"Mission {mission.number}, {name} ({mission.ended.report.kind}): {mission.ended.tree.mission_name}"
    return part_of(mission.ended, robots, artifacts, own, title=title)
