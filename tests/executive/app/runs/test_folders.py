"""Each run has a folder of its own, which says what was asked and how it ended; `last` leads to the newest."""

import subprocess
import sys
from datetime import UTC, datetime, timedelta

import pytest

from executive.app.runs.folders import kept_run, kept_runs, new_run, remove_runs
from executive.mission.request import Request
from skills.inputs.errors import InputError

NOON = datetime(2026, 11, 27, 12, 0, 30, 5, tzinfo=UTC)


def names(out):
    return sorted(path.name for path in out.iterdir())


@pytest.fixture
def asked(tmp_path):
    return Request(name="fetch a drink", seed=7, out=tmp_path / "out")


def test_a_folder_is_named_by_local_time_and_mission_and_last_leads_to_it(asked):
    kept = new_run(asked, NOON)
    assert kept.request.out.name == f"{NOON.astimezone():%Y-%m-%d-%H%M}-fetch-a-drink"
    assert (asked.out / "last").resolve() == kept.request.out.resolve()
    assert names(kept.request.out) == ["run.json"]


def test_runs_of_one_minute_have_folders_of_their_own_and_last_is_the_newest(asked):
    first, second, third = (new_run(asked, NOON) for _ in range(3))
    assert [each.request.out.name[-2:] for each in (first, second, third)] == ["nk", "-2", "-3"]
    assert (asked.out / "last").resolve() == third.request.out.resolve()


def test_a_folder_called_last_stays(asked):
    (asked.out / "last").mkdir(parents=True)
    new_run(asked, NOON)
    assert (asked.out / "last").is_dir() and not (asked.out / "last").is_symlink()


def test_a_run_is_read_back_with_its_request_and_report_also_through_last(asked):
    begun = new_run(asked, NOON)
    assert kept_run(asked.out / "last").report is None
    begun.end({"outcome": "success"})
    kept = kept_run(asked.out / "last")
    assert (kept.request.seed, kept.begun, kept.report) == (7, NOON.replace(microsecond=0), {"outcome": "success"})
    assert kept.request.out == begun.request.out.resolve()


def test_a_run_that_could_not_begin_leaves_no_folder_but_keeps_files(asked):
    empty, used = new_run(asked, NOON), new_run(asked, NOON)
    (used.request.out / "log.mcap").touch()
    empty.undo()
    used.undo()
    assert [path.name for path in asked.out.iterdir() if path.is_dir() and not path.is_symlink()] == [
        used.request.out.name
    ]


def test_after_an_undone_run_last_leads_to_the_run_before_it(asked):
    before, undone = new_run(asked, NOON), new_run(asked, NOON)
    undone.undo()
    assert (asked.out / "last").resolve() == before.request.out.resolve()


# ages of the runs in days, in the order in which they begin; the age of the run that `last` leads to after a clean
@pytest.mark.parametrize(("ages", "newest"), [((9, 3, 1), 1), ((3, 1, 9), 1), ((1, 3, 9), 1), ((9, 8), None)])
def test_last_leads_to_the_newest_run_that_is_left(asked, ages, newest):
    folders = {age: new_run(asked, NOON - timedelta(days=age)).request.out for age in ages}
    remove_runs(asked.out, timedelta(days=7), NOON)
    last = asked.out / "last"
    assert (last.resolve() if last.is_symlink() else None) == (folders[newest].resolve() if newest else None)


def test_only_folders_of_runs_that_are_older_are_removed(asked):
    days = [new_run(asked, NOON - timedelta(days=age)).request.out for age in (9, 8, 1)]
    (asked.out / "2026-11-01-1200-mine").mkdir()
    assert remove_runs(asked.out, timedelta(days=7), NOON) == (days[:2], [])
    assert [kept.request.out.name for kept in kept_runs(asked.out)] == [days[2].name]
    assert (asked.out / "2026-11-01-1200-mine").is_dir()


def test_the_folder_of_a_run_that_goes_on_stays(asked):
    going_on, ended = (new_run(asked, NOON - timedelta(days=age)) for age in (9, 8))
    with going_on.going_on():
        assert remove_runs(asked.out, timedelta(days=7), NOON) == ([ended.request.out], [going_on.request.out])
    assert remove_runs(asked.out, timedelta(days=7), NOON) == ([going_on.request.out], [])


def test_the_folder_of_a_killed_run_is_removed(asked):
    kept = new_run(asked, NOON - timedelta(days=9))
    script = (
        f"import fcntl, time; f = open({str(kept.request.out / 'run.json')!r}); fcntl.flock(f, 1); print(flush=True)"
    )
    with subprocess.Popen([sys.executable, "-c", f"{script}; time.sleep(60)"], stdout=subprocess.PIPE) as run:
        run.stdout.readline()
        assert remove_runs(asked.out, timedelta(days=7), NOON) == ([], [kept.request.out])
        run.kill()
    assert remove_runs(asked.out, timedelta(days=7), NOON) == ([kept.request.out], [])


# what is in the folder, what the error says
@pytest.mark.parametrize(("text", "said"), [(None, "it holds no run"), ("{", "it is damaged"), ("{}", "it is damaged")])
def test_a_folder_without_a_run_or_with_a_damaged_one_is_refused(tmp_path, text, said):
    if text is not None:
        (tmp_path / "run.json").write_text(text)
    with pytest.raises(InputError, match=said):
        kept_run(tmp_path)


def test_a_folder_that_cannot_be_written_is_one_clear_error(asked):
    asked.out.write_text("a file")
    with pytest.raises(InputError, match=r"cannot write it.*name another --out"):
        new_run(asked, NOON)
