"""`errand serve` serves Spot's API for a simulated robot; `errand sdk` runs a program of the SDK against it."""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from threading import Event, Thread
from typing import TYPE_CHECKING, Annotated, Final

import numpy as np
import typer

from executive.cli.number_options import quantity_option
from executive.cli.options import START, start_pose
from executive.cli.output import console_for
from skills.inputs.errors import InputError
from skills.inputs.outside import writing
from skills.quantities import Port, Seed
from skills.robot import Pose2D

if TYPE_CHECKING:
    from errand_spot.server.server import SpotServer
    from plant.worlds.world import World

USER: Final = "user"
PASSWORD: Final = "simulated"  # of a simulator that only this machine reaches
_FOLDER: Final = "spot-api"
LAUNCH: Final = str(Path(__file__).with_name("launch.py"))
_AROUND_M, _BESIDE_M, _FROM_PEOPLE_M, _AHEAD_M, _MOST_TRIED = 1.0, 0.5, 1.2, 3.0, 1000
"""Free floor around the robot's start, beside its way ahead and from people; that way's length; places to try."""
_SPOT: Final = re.compile(r"spot://(?P<host>[A-Za-z0-9.-]+)(:(?P<port>\d{1,5}))?")
WORLD = Annotated[str, typer.Option("--world", help="A world by name or folder.")]
SEED = Annotated[int, quantity_option(Seed, help="Seed of the objects and of all noise.")]
NO_TABLET = Annotated[
    bool, typer.Option("--no-tablet", help="No operator's tablet holds a released E-stop: the program brings its own.")
]


class PaceOption(StrEnum):
    """Driver of the robot's clock."""

    REAL = "real"
    CLIENT = "client"


PACE = Annotated[
    PaceOption, typer.Option("--pace", help="Wall time, or the client's calls step the robot, which is repeatable.")
]

PYTHON = Annotated[
    str, typer.Option("--python", metavar="COMMAND", help="Interpreter of the program; by default that of Errand.")
]
GRAPH = Annotated[
    Path | None, typer.Option("--graph", metavar="FOLDER", help="Writes a GraphNav map of the world there first.")
]


def serve(
    world: WORLD = "flat",
    seed: SEED = 1,
    port: Annotated[int, quantity_option(Port, help="Port on 127.0.0.1; 0 takes a free one.")] = 0,
    no_tablet: NO_TABLET = False,
    pace: PACE = PaceOption.REAL,
    graph: GRAPH = None,
    start: START = None,
) -> None:
    """Serves Spot's API for a simulated Spot, until Ctrl-C."""
    with _server(world, seed, port, pace, tablet=not no_tablet, graph=graph, start=start_pose(start)) as server:
        console = console_for(False)
        console.print(f"Spot's API: 127.0.0.1:{server.port} (Ctrl-C ends it)\n", markup=False)
        for name, value in _environment(server).items():
            console.print(f"export {name}={value}", markup=False)
        if pace is PaceOption.CLIENT:
            console.print("\nIt is stepped by calls of errand.Clock/Advance, google.protobuf.Duration -> Timestamp.")
        try:
            _drive_clock(server, Event())
        except KeyboardInterrupt:
            return


sdk = typer.Typer(
    help="Run a program of Spot's SDK, unchanged, with a simulated Spot.",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


@sdk.command(context_settings={"ignore_unknown_options": True, "allow_interspersed_args": False})
def run_program(
    script: Annotated[Path, typer.Argument(metavar="SCRIPT", help="A Python program that uses the SDK.")],
    arguments: Annotated[
        list[str] | None, typer.Argument(metavar="ARGUMENTS", help="Its arguments; the robot's address is 127.0.0.1.")
    ] = None,
    world: WORLD = "flat",
    seed: SEED = 1,
    no_tablet: NO_TABLET = False,
    pace: PACE = PaceOption.REAL,
    graph: GRAPH = None,
    start: Annotated[
        tuple[float, float, float] | None,
        typer.Option("--start", metavar="X Y YAW", help="Start of the robot, in metres and radians."),
    ] = None,
    python: PYTHON = sys.executable,
) -> None:
    """Runs a program of Spot's SDK, unchanged, with a simulated Spot; exits as the program does."""
    if not script.is_file():
        raise InputError(f"{script}: there is no such program", hint="name a Python file, after the options of Errand")
    if (interpreter := shutil.which(python)) is None:
        raise InputError(f"--python {python}: there is no such program", hint="name a Python interpreter with the SDK")
    pose = None if start is None else start_pose(" ".join(map(str, start)))
    with _server(world, seed, 0, pace, tablet=not no_tablet, graph=graph, start=pose) as server:
        ended, code = Event(), list[int]()

        def run() -> None:
            code.append(_run([interpreter, LAUNCH], [str(script), *(arguments or [])], server, pace))
            ended.set()

        program = Thread(target=run, name="sdk-program", daemon=True)
        program.start()
        _drive_clock(server, ended)
        program.join()
    raise typer.Exit(code[0])


def _drive_clock(server: SpotServer, ended: Event) -> None:
    """Steps the robot in wall time, or does what clients ask for, until something has ended."""
    from errand_spot.server.computer import Pace

    (server.computer.run if server.computer.pace is Pace.REAL else server.computer.serve)(ended)


def _run(interpreter: Sequence[str], program: Sequence[str], server: SpotServer, pace: PaceOption) -> int:
    """Runs a program in a process of its own; returns its exit code."""
    environment = _environment(server)
    launch = [*interpreter, environment["SPOT_CERTIFICATE"], str(server.port), pace.value]
    return subprocess.run([*launch, *program], env={**os.environ, **environment}).returncode


def _environment(server: SpotServer) -> dict[str, str]:
    """Environment variables with the server's address and login, for programs and drivers."""
    return {
        "SPOT_IP": "127.0.0.1",
        "SPOT_PORT": str(server.port),
        "SPOT_HTTPS_PORT": "" if server.downloads is None else str(server.downloads.port),
        "SPOT_CERTIFICATE": str(server.certificate),
        "BOSDYN_CLIENT_USERNAME": USER,
        "BOSDYN_CLIENT_PASSWORD": PASSWORD,
    }


def _write_graph(world: World, folder: Path) -> None:
    """Writes a GraphNav map of a world. Raises InputError."""
    from errand_spot.perception import world_map
    from errand_spot.server.graph_map import write_map

    with writing(folder, "name another --graph"):
        write_map(world_map(world), folder)


def free_floor(world: World) -> Pose2D:
    """Pose nearest to the world's start with free floor around and ahead, away from people; else the start itself."""
    from skills.grid_map import load_grid_map

    ground, start = load_grid_map(world.surveyed.keepout_map_path).with_unknown_blocked(), world.start
    people = [np.mean(each.ranges[:2], axis=1) for each in world.seed_rules.people if each.ranges is not None]
    people_W = [
        (start.x_m + far_m * math.cos(start.yaw_rad + turn), start.y_m + far_m * math.sin(start.yaw_rad + turn))
        for far_m, turn in [*people, (1e6, 0.0)]
    ]
    places = ground.centres(np.argwhere(ground.distance > _AROUND_M))
    far_m = np.hypot(*(places - [start.x_m, start.y_m]).T)
    for x, y in places[np.argsort(far_m, kind="stable")][:: max(1, len(places) // _MOST_TRIED)].tolist():
        for yaw_rad in (start.yaw_rad + 0.25 * math.pi * np.arange(8)).tolist():
            line = [x, y] + np.outer(np.arange(0.0, _AHEAD_M, 0.1), [math.cos(yaw_rad), math.sin(yaw_rad)])
            people_m = np.hypot(*(line[:, None] - people_W).transpose(2, 0, 1)).min()
            if people_m > _FROM_PEOPLE_M and ground.distance_m(line).min() > _BESIDE_M:
                return Pose2D(x, y, math.remainder(yaw_rad, math.tau))
    return start


@contextmanager
def _server(
    world: str, seed: int, port: int, pace: PaceOption, *, tablet: bool, graph: Path | None, start: Pose2D | None
) -> Iterator[SpotServer]:
    """Builds the simulation with Alice, and serves her. Raises InputError without the SDK or a free port."""
    from errand_spot.perception import SpotPerception
    from errand_spot.picking import PointPicker
    from errand_spot.server.computer import Pace
    from errand_spot.server.estop import Tablet
    from errand_spot.server.identity import credentials
    from errand_spot.server.server import Options, SpotServer
    from executive.app.prepare.placed_robots import only_robot, refuse_blocked
    from executive.app.prepare.worlds import knowledge_of, open_world
    from executive.app.runs.simulated import compile_first, simulate
    from plant.models.catalogue import user_cache
    from skills.geometry import compose, inverse
    from skills.manipulation.arm.kinematics import arm_model

    opened = open_world(world)
    if graph is not None:
        _write_graph(opened, graph)
    if start is not None:
        refuse_blocked(opened, start)
    placed = only_robot("Alice", opened, seed=seed, start=start or free_floor(opened))
    compile_first()
    simulation = simulate(opened, {"Alice": placed}, seed=seed, record=False)
    robot = simulation.robots["Alice"]
    robot.image(robot.capabilities().cameras[0].source)  # the first picture takes long: the renderer begins
    options = Options(
        {USER: PASSWORD},
        port,
        pace=Pace(pace.value),
        tablet=Tablet.TABLET if tablet else Tablet.NONE,
        picker=PointPicker(robot, simulation.clock),
        dock_O=None if placed.dock is None else compose(inverse(placed.start), placed.dock),
        perception=SpotPerception({tag.id: tag.size_m for tag in knowledge_of(opened).known_tags()}),
        downloads=True,
    )
    try:
        held = credentials(user_cache() / _FOLDER)
        server = SpotServer(robot, simulation.clock, arm_model(robot.capabilities()), held, options)
    except OSError as error:
        raise InputError(str(error), hint="name another --port, or 0 for a free one") from error
    with server.running():
        yield server
