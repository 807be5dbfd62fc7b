"""`errand queue`: missions kept in a store, to be run one after another."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from executive.cli.durable import STORE
from executive.cli.output import NOT_ACHIEVED, console_for, print_json, refusals, show_table
from executive.cli.requests import prepare
from executive.cli.run_options import SET
from executive.cli.stack_command import STACK
from executive.mission.file.parameters import given_values
from executive.mission.request import Request
from executive.mission.stack_file import load_stack
from executive.store.missions import MissionState, MissionStore, StoredMission

__all__ = ["queue"]

queue = typer.Typer(
    name="queue",
    help="Missions kept in a store, to be run one after another.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

Out = Annotated[Path, typer.Option(help="Folder for logs; each mission gets one of its own in it.")]
Store = Annotated[Path | None, typer.Option(help="Where missions are kept; missions.sqlite in the folder for logs.")]
Number = Annotated[int, typer.Argument(metavar="NUMBER", help="The mission's number, as `errand queue list` shows it.")]
AsJson = Annotated[bool, typer.Option("--json", help="The last line of standard output is the result as JSON.")]


@queue.command()
def add(
    file: Annotated[
        Path | None,
        typer.Argument(metavar="MISSION", help="A file, or a name of `errand missions`.", show_default=False),
    ] = None,
    say: Annotated[str | None, typer.Option(help="What is said.")] = None,
    world: Annotated[str | None, typer.Option(help="World by name or folder.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Sets the things in the world and all noise.")] = 1,
    wake: Annotated[
        bool | None, typer.Option("--wake/--no-wake", help="Must the robot's name be said? If the world asks for it.")
    ] = None,
    given: SET = None,
    stack: STACK = None,
    out: Out = Path("out"),
    store: Store = None,
    no_record: Annotated[bool, typer.Option("--no-record", help="No recording and no pictures.")] = False,
    anyway: Annotated[bool, typer.Option("--anyway", help="Queue it although `errand check` would refuse it.")] = False,
    as_json: AsJson = False,
) -> None:
    """Queue a sentence or a mission file, checked."""
    with refusals():
        load_stack(stack)
        values = given_values(given or ())
        asked = Request(say, file, world, wake, seed=seed, out=out, record=not no_record, stack=stack, given=values)
        prepared = prepare(asked)
        if not anyway:
            from executive.cli.feasibility import refuse_impossible

            refuse_impossible(prepared)
        request = prepared.request.from_anywhere()
        with MissionStore(store or out / STORE) as missions:
            mission = missions.add(request, queued=True)
    console_for(as_json).print(f"Mission {mission.id} is queued: {request.name}", markup=False)
    if as_json:
        print_json(_told(mission))


@queue.command(name="list")
def show(out: Out = Path("out"), store: Store = None, as_json: AsJson = False) -> None:
    """Show all missions of the store and how far each is."""
    with refusals(), MissionStore(store or out / STORE, create=False) as missions:
        known = missions.missions()
    header = ("mission", "state", "name", "world", "seed", "commands", "message")
    show_table(console_for(as_json), header, map(_row, known))
    if as_json:
        print_json({"missions": [_told(each) for each in known]})


@queue.command()
def remove(number: Number, out: Out = Path("out"), store: Store = None) -> None:
    """Forget a mission."""
    with refusals(), MissionStore(store or out / STORE, create=False) as missions, missions.claimed():
        missions.remove(number)
    console_for(False).print(f"Mission {number} is removed.")


@queue.command()
def run(
    out: Out = Path("out"),
    store: Store = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="No lines and no tree while it runs.")] = False,
    as_json: AsJson = False,
) -> None:
    """Run all that is queued, each mission in the world as the one before has left it."""
    from executive.cli.queue_run import run_queue

    console = console_for(as_json)
    with refusals(), MissionStore(store or out / STORE, create=False) as missions, missions.claimed():
        results = run_queue(missions, console, quiet=quiet)
    console.print(f"{sum(result['achieved'] for result in results)} of {len(results)} missions achieved")
    if as_json:
        print_json({"missions": results})
    if not all(result["achieved"] for result in results):
        raise typer.Exit(NOT_ACHIEVED)


def _state(mission: StoredMission) -> str:
    return "running or broken off" if mission.state is MissionState.RUNNING else mission.state.value


def _row(mission: StoredMission) -> tuple[str, ...]:
    asked, commands = mission.request, "\n".join(mission.request.commands)
    return str(mission.id), _state(mission), asked.name, asked.world_name, str(asked.seed), commands, mission.message


def _told(mission: StoredMission) -> dict[str, Any]:
    asked = mission.request
    told = {"mission": mission.id, "state": mission.state.value, "name": asked.name, "world": asked.world_name}
    return {**told, "seed": asked.seed, "commands": list(asked.commands), "message": mission.message}
