"""`errand ros2` writes bags and interface packages; `errand serve-ros2` serves a simulated robot."""

from __future__ import annotations

from contextlib import closing, suppress
from pathlib import Path
from threading import Event
from typing import Annotated

import typer

from executive.cli.number_options import quantity_option
from executive.cli.options import START, start_pose
from executive.record.history import read_history
from skills.inputs.outside import writing
from skills.quantities import Delay, Seed

ros2 = typer.Typer(name="ros2", help="Bags, and interface packages.", no_args_is_help=True, rich_markup_mode=None)


@ros2.command()
def bag(
    file: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run, or its log.mcap.", show_default=False)],
    out: Annotated[Path, typer.Option("-o", "--out", help="New folder for the bag, or its file *.mcap.")],
    robot: Annotated[str | None, typer.Option(metavar="NAME", help="Only this one of several robots.")] = None,
) -> None:
    """Writes a ROS 2 bag: map, transforms, scans, joint states, poses, paths and pictures."""
    from errand_ros2.bag import write_bag

    history = read_history(file)
    history = history if robot is None else history.of_robot(robot)
    typer.echo(f"{write_bag(history.events, out)} messages in {out}", err=True)


@ros2.command()
def interfaces(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder, such as src of a workspace.")],
    package: Annotated[list[str] | None, typer.Option(metavar="NAME", help="Only this one; repeatable.")] = None,
) -> None:
    """Writes packages of the interfaces that Errand uses and ROS 2 may lack, for colcon or CMake to build."""
    from errand_ros2.packages import PACKAGES, write_packages

    with writing(folder, "name another folder"):
        write_packages(folder, package := package or PACKAGES)
    typer.echo(f"{', '.join(package)} in {folder}; build them by colcon build", err=True)


def serve_ros2(
    place: Annotated[str, typer.Argument(metavar="[WIRE:][DOMAIN][@HOST[:PORT]]", help="Network, as of --ros2.")] = "",
    world: Annotated[str, typer.Option("--world", help="A world by name or folder.")] = "flat",
    robot: Annotated[str, typer.Option("--robot", help="Name of the robot; in lower case its namespace.")] = "Alice",
    kind: Annotated[str, typer.Option("--kind", help="Kind of the robot.")] = "spot",
    start: START = None,
    seed: Annotated[int, quantity_option(Seed, help="Seed of the objects and of all noise.")] = 1,
    with_map: Annotated[bool, typer.Option("--map", help="Publish the world's map as /map, too.")] = False,
    truth: Annotated[bool, typer.Option("--ground-truth", help="Publish the true pose under /ground_truth.")] = False,
    limit: Annotated[
        float | None, quantity_option(Delay, "--for", help="End after so long (s, robot's clock).")
    ] = None,
) -> None:
    """Serves a simulated robot in ROS 2, without navigation, until Ctrl-C."""
    from errand_ros2.adapter.description import capabilities_of
    from errand_ros2.server import RobotServer
    from errand_ros2.wire.node import Place
    from errand_ros2.wire.session import open_session
    from errand_ros2.wire.types import topic_name
    from executive.app.prepare.placed_robots import only_robot, refuse_blocked
    from executive.app.prepare.worlds import open_world
    from executive.app.runs.simulated import compile_first, simulate
    from executive.record.other_tools import ros_name
    from skills.grid_map import load_grid_map

    at, opened, space = Place.parse(place), open_world(world), topic_name(f"/{ros_name(robot)}")
    capabilities_of(kind)
    placed = only_robot(robot, opened, seed=seed, start=start_pose(start), kind=kind)
    if start is not None:
        refuse_blocked(opened, placed.start)
    with open_session(at) as session:
        compile_first()
        simulation = simulate(opened, {robot: placed}, seed=seed, record=False)
        grid = load_grid_map(opened.scan_map_path) if with_map else None
        X_WB = (lambda: simulation.engine.poses_W()[robot]) if truth else None
        server = RobotServer(session, simulation.robots[robot], simulation.clock, grid=grid, truth=X_WB)
        typer.echo(f"ROS 2: {space}, {session.told}; Ctrl-C ends it")
        with closing(server), suppress(KeyboardInterrupt):
            server.run(Event(), limit)
