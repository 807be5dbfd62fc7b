"""A queue done by two robots in the plant."""

import json
import re
import subprocess
import sys
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
from typer.testing import CliRunner

from executive.cli import entry

pytestmark = pytest.mark.mission


def errand(*arguments):
    result = CliRunner().invoke(entry.app, [*map(str, arguments), "--json"])
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout.splitlines()[-1])


def test_a_mission_from_the_page_is_done_by_the_fleet_and_a_refused_one_changes_nothing(tmp_path):
    errand("queue", "add", "--say", "Go to the living room", "--no-wake", "--no-record", "--store", tmp_path / "q.db")
    robots = ["--robots", "alice=spot@8.7,4.0,1.57,bob=spot@8.4,6.5,1.57", "--no-record", "--json", "--view", "0.5"]
    command = [sys.executable, "-m", "executive.cli", "fleet", "run", str(tmp_path / "q.db"), *robots]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        lines = iter(process.stderr.readline, "")
        page, token = next(
            found.groups() for line in lines if (found := re.search(r"(http://\S+)/\?token=(\S+)", line))
        )

        def post(action, **values):
            headers = {"Content-Type": "application/json", "X-Errand-Token": token}
            asked = Request(f"{page}/action/{action}", json.dumps(values).encode(), headers)
            try:
                with urlopen(asked, timeout=60) as answer:
                    return json.load(answer)
            except HTTPError as refusal:
                return json.load(refusal)

        post("pause")
        assert "moon" in post("queue", text="Go to the moon")["error"]
        assert post("queue", text="Bob, go to the kitchen") == {"said": "Mission 2 is queued: go kitchen"}
        post("resume")
        process.stderr.read()
        missions = json.loads(process.stdout.read().splitlines()[-1])["missions"]
    assert process.returncode == 0
    assert [(each["robot"], each["outcome"]) for each in missions] == [("Alice", "success"), ("Bob", "success")]
    assert all(each["referee"]["success"] and not each["referee"]["collisions"] for each in missions)
    assert errand("fleet", "status", tmp_path / "q.db")["missions"] == missions
