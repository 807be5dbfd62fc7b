"""Runs of a folder as rows, filtered and compared."""

import json
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import pytest
from studio_user import play, studio

from errand_studio.board_page import picture, rows_html, strip_html
from errand_studio.runs_table import RunsTable, causes, chosen, first_difference
from executive.app.runs.folders import new_run
from executive.mission.request import Request
from executive.record.history import Entry
from skills.inputs.errors import InputError

BEGUN = datetime(2026, 12, 1, 12, 0).astimezone()
GOOD = {"outcome": "success", "referee": {"success": True, "collisions": 0, "drops": 0}, "sim_time_s": 61.5}
FALSE = {"outcome": "success", "referee": {"success": False, "collisions": 1, "drops": 2}}
FAILED = {"outcome": "failure", "cause": "PLANNING", "message": "no path", "referee": {"success": False}}
RUNS = (("round", GOOD), ("round", FALSE), ("fetch", FAILED), ("<b>evil</b>", GOOD), ("fetch", None))


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """Five runs, the last of which goes on, and a damaged one."""
    for number, (name, report) in enumerate(RUNS):
        request = Request(file=tmp_path / f"{number}.yaml", name=name, seed=number, out=tmp_path / "out")
        kept = new_run(request, BEGUN + timedelta(minutes=number))
        if report is not None:
            kept.end({"world": "flat", "message": "", **report})
    (tmp_path / "out" / "broken").mkdir()
    (tmp_path / "out" / "broken" / "run.json").write_text("{")
    (tmp_path / "out" / "2026-12-01-1200-round" / "map.png").write_bytes(b"\x89PNG")
    (tmp_path / "secret.png").write_bytes(b"\x89PNG")
    return tmp_path / "out"


def test_a_row_has_claim_and_verdict(out: Path) -> None:
    rows = [(row.mission, row.seed, row.outcome, row.verdict, row.contacts, row.look) for row in RunsTable(out).rows()]
    assert rows == [
        ("fetch", 4, "running or interrupted", "", 0, "running"),
        ("<b>evil</b>", 3, "success", "fulfilled", 0, "success"),
        ("fetch", 2, "failure", "not fulfilled", 0, "failure"),
        ("round", 1, "success", "not fulfilled", 3, "failure"),
        ("round", 0, "success", "fulfilled", 0, "success"),
        ("?", 0, "damaged", "", 0, "failure"),
    ]


def test_rows_are_filtered_with_failures_first(out: Path) -> None:
    rows = RunsTable(out).rows()
    assert [row.seed for row in chosen(rows, mission="round")] == [1, 0]
    assert [row.seed for row in chosen(rows, text="fetch plan")] == [2]
    assert [row.seed for row in chosen(rows, only="successes", failures_first=False)] == [3, 0]
    assert causes([row for row in rows if row.begun]) == {
        "running or interrupted": 1,
        "PLANNING": 1,
        "not fulfilled": 1,
    }


def test_a_changed_run_is_read_again(out: Path) -> None:
    table = RunsTable(out)
    before = table.rows()
    assert [id(row) for row in table.rows()] == [id(row) for row in before]
    file = next(out.glob("*fetch-2/run.json"), None) or next(out.glob("*1204*/run.json"))
    data = json.loads(file.read_text())
    file.write_text(json.dumps({**data, "report": {"world": "flat", "message": "", **GOOD}}))
    assert table.rows()[0].look == "success"


def test_names_of_missions_are_shown_as_texts(out: Path) -> None:
    rows = RunsTable(out).rows()
    shown = rows_html(rows, [], 0) + strip_html(rows, rows, "<b>evil</b>")
    assert "<b>evil" not in shown
    assert "&lt;b&gt;evil" in shown


@pytest.mark.parametrize("run", ["../", "..", ".", "", "/", "broken/..", "nothing"])
def test_a_run_outside_the_folder_is_refused(out: Path, run: str) -> None:
    with pytest.raises(InputError, match="no run"):
        RunsTable(out).folder(run)


def test_only_pictures_of_runs_are_sent(out: Path) -> None:
    table, run = RunsTable(out), "2026-12-01-1200-round"
    sent = {
        name: picture(table, run, name).status_code for name in ("map.png", "run.json", "../../secret.png", "no.png")
    }
    assert sent == {"map.png": 200, "run.json": 404, "../../secret.png": 404, "no.png": 404}


def test_the_first_difference_ignores_numbers() -> None:
    entries = [Entry(1.0, "a/go", "5.6 m to go"), Entry(2.0, "a/look", "saw a beer")]
    other = [replace(entries[0], t=1.5, text="5.9 m to go"), replace(entries[1], text="saw a coke")]
    assert first_difference(entries, other) == 1
    assert first_difference(entries, other[:1]) == 1
    assert first_difference(entries, entries) is None


def test_the_board_filters_and_ticks(out: Path) -> None:
    async def scenario() -> None:
        async with studio(out.parent, out) as page:
            await page.open("/board")
            shown = await page.see("PLANNING 1")
            assert shown.index("no path") < shown.index("&lt;b&gt;evil")
            await page.send("mission", name="round")
            shown = await page.see("all missions")
            assert "no path" not in shown
            await page.send("tick", run="2026-12-01-1200-round", ticked=True)
            assert "checked" in page.html()

    play(scenario)
