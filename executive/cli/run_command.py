"""`errand run` runs a sentence or a mission file in the simulated world."""

from __future__ import annotations

import re
from contextlib import nullcontext
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from executive.cli.options import (
    ANYWAY,
    AS_JSON,
    HOST,
    OBSERVE,
    PORT,
    QUIET,
    ROBOT,
    STORE,
    VIEW,
    grouped,
    takes_request,
)
from executive.cli.output import NOT_ACHIEVED, console_for, print_json, terminal_answerer
from executive.mission.request import Request
from executive.words.forms import OptionGroup as Group
from skills.inputs.errors import InputError
from skills.inputs.outside import is_file, writing
from skills.inputs.yaml_source import read_yaml

if TYPE_CHECKING:
    from rich.console import Console

    from executive.app.report.run_report import RunReport
    from executive.app.runs.profile import Profile


@takes_request()
def run(
    request: Request,
    listen_to: Annotated[Path | None, grouped(Group.REQUEST, "--listen", help="A wav file with the sentence.")] = None,
    as_json: AS_JSON = False,
    quiet: QUIET = False,
    whole_tree: Annotated[bool, grouped(Group.OUTPUT, "--tree", help="Show the whole tree at the end.")] = False,
    profile: Annotated[bool, grouped(Group.OUTPUT, "--profile", help="Print the CPU time by subsystem.")] = False,
    store: STORE = None,
    anyway: ANYWAY = False,
    aloud: Annotated[
        bool, grouped(Group.OUTPUT, "--voice", help="Say aloud what the robot says, by espeak-ng.")
    ] = False,
    view: VIEW = None,
    view_port: PORT = 0,
    view_host: HOST = "127.0.0.1",
    observe: OBSERVE = None,
    robot: ROBOT = None,
) -> None:
    """Runs a sentence or a mission file in the simulated world, or with a real robot."""
    refuse_unaddressed(request)
    from executive.app.prepare.from_request import prepare_checked
    from executive.app.runs.backend import observers
    from executive.app.runs.profile import Profile
    from executive.app.runs.queue import MissionRuns
    from executive.app.runs.real_robot import real_runner
    from executive.cli.screen import ConsoleScreen, page_of, voice_for
    from executive.store.missions import MissionStore, store_in

    console = console_for(as_json)
    kept_in = store or store_in(request.out)
    timing = Profile() if profile else None

    with voice_for(aloud) as voice, observers(observe) as observing:
        if listen_to is not None:
            from executive.cli.listen_command import hear_request

            request = replace(request, sentence=hear_request(listen_to, request, console=console))
        prepared = prepare_checked(request, ask=terminal_answerer(), anyway=anyway)
        page = None if view is None else page_of(console, (view_host, view_port), kept_in, request.out)
        screen = ConsoleScreen(console, quiet, whole_tree, voice, page, timing, observing)
        connection = real_runner(prepared, robot) if robot is not None else nullcontext()
        with writing(request.out, "name another --out"):
            request.out.mkdir(parents=True, exist_ok=True)
        with MissionStore(kept_in) as missions, missions.claim(), connection as runner:
            mission = missions.add(prepared.request.from_anywhere(), queued=False)
            ended = MissionRuns(missions, screen, run=runner).run(mission, prepared)
    _tell(console, timing, ended.report if as_json else None)
    screen.stay(view, hung_up=ended.hung_up)
    if not ended.achieved:
        raise typer.Exit(NOT_ACHIEVED)


def _tell(console: Console, timing: Profile | None, report: RunReport | None) -> None:
    """Prints the CPU times, and the report as JSON, if the user asked for them."""
    from executive.app.runs.profile import lines

    if timing is not None:
        for line in lines(timing.table()):
            console.print(line, markup=False)
    if report is not None:
        print_json(report.to_json())


def refuse_unaddressed(request: Request) -> None:
    """Raises InputError if a sentence lacks the robot's name although the request or the world requires it.

    A quick check without heavy imports. Understanding the sentence decides later whether the name calls the robot, and
    which of several robots is called.
    """
    if request.sentence is None or request.robots:
        return
    try:
        robot = _robot_of(request.world or "flat")
    except InputError:
        return
    required = robot.get("require_wake", False) if request.require_wake is None else request.require_wake
    name = str(robot.get("name") or "")
    if not (required and name) or re.search(rf"\b{re.escape(name)}\b", request.sentence, re.IGNORECASE):
        return
    hint = f'did you mean --no-wake? Or begin with "Hey {name}"'
    raise InputError(f"{name} is not called in '{request.sentence[:60]}'", hint=hint)


def _robot_of(world: str) -> dict[str, Any]:
    """Returns the robot that a world's knowledge file names; {} if it names no robot or several."""
    worlds = find_spec("plant.worlds")
    folders = [Path(world), *(Path(each) / world for each in (worlds and worlds.submodule_search_locations) or ())]
    file = next(file for folder in folders if is_file(file := folder / "knowledge.yaml") or folder is folders[-1])
    knowledge = read_yaml(file).data
    robot = knowledge.get("robot") if isinstance(knowledge, dict) and "robots" not in knowledge else None
    return robot if isinstance(robot, dict) else {}
