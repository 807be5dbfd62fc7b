"""`errand teleop` drives body and arm of a simulated robot by hand."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Final

import typer

from errand_teleop.driver import Teleop, TeleopOptions, axis_values
from errand_teleop.page import TeleopPage
from errand_teleop.poses import save_pose
from executive.app.prepare.placed_robots import only_robot, refuse_blocked
from executive.app.prepare.worlds import knowledge_of, open_world
from executive.app.runs.simulated import compile_first, simulate
from executive.cli.number_options import quantity_option
from executive.cli.options import HOST, PORT, START, start_pose
from executive.cli.output import console_for
from executive.cli.run_keys import read_keys
from executive.run.worker import LockStepWorker
from executive.view.feed import Feed
from executive.view.server import PageContent, serve
from plant.worlds.world import World
from skills.api import SkillContext
from skills.grid_map import load_grid_map
from skills.inputs.errors import InputError
from skills.quantities import Delay, Seed
from skills.robot import Clock, LeaseError, Pose2D, Robot
from skills.stack import default_stack

HOLDER: Final = "teleop"
SAVE_KEY: Final = "p"
_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,39}")
_HELP: Final = """w s a d q e  drive, turn, sideways       i k j l u o  hand ahead, left, up (body frame)
r f t g y h  hand about its axes         1-6 / Q W E R T Y  arm joints
v c  open, close    + - < >  height, tilt    p  save the pose    space  stop    Ctrl-C  end"""


def teleop(
    world: Annotated[str, typer.Option("--world", help="A world by name or folder.")] = "flat",
    robot: Annotated[str, typer.Option("--robot", help="Name of the robot.")] = "Alice",
    start: START = None,
    seed: Annotated[int, quantity_option(Seed, help="Seed of the objects and of all noise.")] = 1,
    poses: Annotated[Path, typer.Option("--poses", help="Folder for saved poses.")] = Path("poses"),
    view_port: PORT = 0,
    view_host: HOST = "127.0.0.1",
    limit: Annotated[
        float | None, quantity_option(Delay, "--for", help="End after this time (s) on the robot's clock.")
    ] = None,
) -> None:
    """Drives a robot's body and arm by hand. The robot stops without keys, and keeps the limits of the skills."""
    with ExitStack() as stack:
        if not _NAME.fullmatch(robot):
            raise InputError(f"'{robot[:60]}' is not a name for a robot", hint="use letters and digits, as in Alice")
        opened = open_world(world)
        placed = only_robot(robot, opened, seed=seed, start="unknown" if start == "unknown" else start_pose(start))
        if start is not None:
            refuse_blocked(opened, placed.start)
        compile_first()
        simulation = simulate(opened, {robot: placed}, seed=seed, record=False)
        driven, clock = simulation.robots[robot], simulation.clock
        context = context_for(opened, driven, clock, placed.start)
        stack.callback(driven.return_lease, context.lease)
        hands = Teleop(context)

        def save(name: str | None) -> str:
            """Saves the pose under a name, or under a free name if none is given; returns a sentence."""
            return f"saved as {save_pose(poses, name, hands.pose(), world=opened.name)}"

        feed, scene = Feed(), simulation.show_live()
        page = TeleopPage(hands, context, feed, save)
        page.show_map(opened, knowledge_of(opened))
        content = PageContent(feed, page.actions(), scene)
        server = stack.enter_context(serve(content, (view_host, view_port)))
        console = console_for(False)
        stack.enter_context(read_keys(TerminalKeys(hands, save, console.print).press))
        console.print(f"{server.lines}\n{_HELP}", markup=False)
        try:
            drive(hands, context, limit, page.report)
        except KeyboardInterrupt:
            return


def context_for(world: World, robot: Robot, clock: Clock, start: Pose2D) -> SkillContext:
    """Returns a robot with localiser, costmap and lease. Raises InputError without a free lease or a map."""
    components = default_stack()
    try:
        scan_map, keepout_map = load_grid_map(world.scan_map_path), load_grid_map(world.keepout_map_path)
        localiser = components.localiser.build(scan_map, start, surely=True)
        lease = robot.acquire_lease(HOLDER)
    except (OSError, LeaseError) as error:
        raise InputError(str(error)) from error
    return SkillContext(
        robot=robot,
        lease=lease,
        clock=clock,
        worker=LockStepWorker(clock),
        localiser=localiser,
        costmap=components.costmap.build(keepout_map),
        publish=lambda topic, message: None,
        seed=0,
        stack=components,
    )


def drive(hands: Teleop, context: SkillContext, limit_s: float | None, report: Callable[[], None]) -> None:
    """Drives until the limit (s, robot's clock), at most in real time; calls `report` in each period."""
    begun_s = context.clock.now()
    due_s = time.monotonic()
    while limit_s is None or context.clock.now() - begun_s < limit_s:
        advance(hands, context)
        report()
        due_s = max(due_s + TeleopOptions().period_s, time.monotonic())
        threading.Event().wait(due_s - time.monotonic())


def advance(hands: Teleop, context: SkillContext) -> None:
    """Updates the estimates, sends the commands for one period, and advances the clock by the period."""
    context.localiser.update(context.robot)
    context.costmap.update(context.robot, context.localiser.estimate())
    hands.tick()
    context.clock.advance(TeleopOptions().period_s)


class TerminalKeys:
    """Keys of a terminal, which reports presses and repeats of a held key, but no releases."""

    def __init__(self, hands: Teleop, save: Callable[[str | None], str], say: Callable[[str], None]) -> None:
        self._hands, self._save, self._say = hands, save, say

    def press(self, key: str) -> None:
        """Commands the motion for a key, or saves the pose; any other key stops the robot."""
        self._hands.ask(axis_values([key]))
        if key == SAVE_KEY:
            try:
                self._say(self._save(None))
            except InputError as error:
                self._say(str(error))
