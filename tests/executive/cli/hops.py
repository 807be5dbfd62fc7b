"""Counts the hops of a request through the code: moves from one module to another, told as JSON.

    python -m tests.executive.cli.hops OUT [--to-gripper]

The route to the first tick is that of the functions in the order in which each is first handed the sentence or what is
made of it. The route from a tick to a command of the gripper is that of the functions on the stack.
"""

import json
import os
import sys
from itertools import groupby
from pathlib import Path
from types import CodeType, FrameType

from executive.app.runs import queue, simulated  # noqa: F401
from executive.cli import entry, run_command  # noqa: F401
from executive.language.parser import load_parser
from executive.run.tree_run import TreeRun
from plant.engine import PipelinedRobot

ROOT = Path(__file__).resolve().parents[3]
SENTENCE = "fetch me a coke"
DATA = frozenset({"Understanding", "Request", "Prepared", "StoredMission", "Mission", "CompiledTree"})
"""What is made of the sentence; a look into it is no hop."""
MADE_OF_IT = DATA | {"Session", "RobotRun", "TreeRun"}


def module_of(code):
    """The file of a function of the product."""
    path = Path(code.co_filename)
    if not path.is_relative_to(ROOT):
        return None
    name = str(path.relative_to(ROOT))
    return name if name.startswith(("executive/", "skills/", "plant/")) else None


class Route:
    """The modules of the functions that were handed the request, in their order."""

    def __init__(self):
        self.modules: list[str] = []
        self._known: set[CodeType] = set()

    def __call__(self, frame, event, argument):
        code = frame.f_code
        if event != "call" or code in self._known or code.co_name.startswith("<"):
            return
        module = module_of(code)
        if module is None:
            self._known.add(code)
            return
        given = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
        values = [frame.f_locals.get(name) for name in given]
        if given and given[0] == "self" and type(values[0]).__name__ in DATA:
            self._known.add(code)
        elif any(carries(value) for value in values):
            self._known.add(code)
            self.modules.append(module)


def carries(value):
    """Whether a value is the sentence or what is made of it."""
    return type(value).__name__ in MADE_OF_IT or (isinstance(value, str) and SENTENCE in value)


def stays(modules):
    """The modules without the ones that follow themselves."""
    return [name for name, _ in groupby(modules)]


def below_the_tick():
    """The modules on the stack from the tick of a tree to whoever calls the caller of this."""
    found: list[str] = []
    frame: FrameType | None = sys._getframe(2)
    while frame is not None and frame.f_code is not TICK.__code__:
        module = module_of(frame.f_code)
        found += [] if module is None else [module]
        frame = frame.f_back
    return found[::-1]


def report(route):
    """Write the route and end the process."""
    sys.stdout.write(json.dumps({"hops": len(route), "route": route}) + "\n")
    sys.stdout.flush()
    os._exit(0)


TICK = TreeRun.tick


def main(out, to_gripper):
    route = Route()

    def tick(run, breakpoints):
        sys.setprofile(None)
        if not to_gripper:
            report(stays(route.modules))
        return TICK(run, breakpoints)

    def set_gripper(robot, *given, **named):
        report(stays(route.modules) + stays(below_the_tick()))

    TreeRun.tick = tick
    PipelinedRobot.set_gripper = set_gripper
    sys.argv = ["errand", "run", "--say", SENTENCE, "--no-record", "--quiet", "--out", out]
    load_parser().is_word("coke")  # what is loaded before is not profiled
    sys.setprofile(route)
    entry.command_line()


if __name__ == "__main__":
    main(sys.argv[1], "--to-gripper" in sys.argv)
