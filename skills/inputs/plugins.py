"""Loading of entry points from other distributions, with a time limit and one error for everything that they raise."""

import os
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from functools import cache
from importlib.metadata import Distribution, EntryPoint, EntryPoints, SelectableGroups, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, TypeVar

from skills.inputs.errors import InputError

CLASSES: Final = "errand.classes"
"""Group of the packages with classes of objects; the value names the package, whose code does not run."""

TASKS: Final = "errand.tasks"
"""Group of the classes of tasks by word (`executive.tree.task_page.TaskPage`)."""
NODES: Final = "errand.nodes"
"""Group of the modules with nodes for the trees of tasks."""
SENTENCES: Final = "errand.sentences"
"""Group of the functions that add the steps of a clause that they understand to a sentence's builder."""
STACKS: Final = "errand.stacks"
"""Group of the names of stack files; the value names the package with the file `NAME_stack.yaml`."""
WORLDS: Final = "errand.worlds"
"""Group of the names of worlds; the value names the package with the folder `NAME`."""
KERNELS: Final = "errand.kernels"
"""Group of the functions without arguments that run numeric code for a short time, so that it is compiled."""

RECOGNISERS: Final = "errand.recognisers"
"""Group of the functions that extend a detector by objects of a world (`skills.detection.Recogniser`)."""
OBSERVERS: Final = "errand.observers"
"""Group of the functions that return a visitor for a run (`errand run --observe NAME=VALUE`, or `--NAME VALUE`)."""
FUNCTIONS: Final = (KERNELS, RECOGNISERS, SENTENCES)
GROUPS: Final = (CLASSES, NODES, TASKS, STACKS, WORLDS, *FUNCTIONS, OBSERVERS)

OURS: Final = "spot-errand"
"""Distribution of this project, whose modules need no time limit."""
LIMIT_S: Final = 30.0
_BAD_INPUT: Final = 2
_LONGEST: Final = 300

ResultT = TypeVar("ResultT")


class PluginDefect(Exception):  # noqa: N818
    """Error raised by the code of a plug-in: its type and its text."""


def distribution_of(entry: EntryPoint) -> str:
    """Name of the distribution that registers an entry point."""
    return "an unknown distribution" if entry.dist is None else _name_of(entry.dist)


@cache
def _name_of(distribution: Distribution) -> str:
    """Name of a distribution, cached because it is read from a file each time."""
    return distribution.name


def installed_plugins(group: str) -> EntryPoints:
    """Entry points in a group, cached because reading them opens the files of all distributions."""
    return _all_installed().select(group=group)


@cache
def _all_installed() -> SelectableGroups:
    return entry_points()


@cache
def missing_plugin(group: str, name: str) -> tuple[str, str] | None:
    """Message and hint for a name that only a plug-in of this project registers, which is missing; None for others."""
    from skills.inputs.yaml_source import read_yaml

    table = read_yaml(Path(__file__).with_name("plugins.yaml")).data
    owner = next((each for each, groups in table.items() if name in groups.get(group, ())), None)
    return owner and (f"'{name}' needs the plug-in {owner}, which is not installed", f"pip install {owner}")


def class_tables(name: str) -> Iterator[tuple[Path, Any]]:
    """Yields path and data of the YAML file `name` from each package with object classes. Raises InputError."""
    from skills.inputs.yaml_source import read_yaml

    for entry in sorted(installed_plugins(CLASSES), key=lambda entry: entry.name):
        file = package_folder(entry) / name
        if file.is_file():
            yield file, read_yaml(file).data


def package_folder(entry: EntryPoint) -> Path:
    """Folder of the package that an entry point names, whose code does not run. Raises InputError."""
    try:
        spec = find_spec(entry.value)
    except (ImportError, ValueError):
        spec = None
    if spec is None or not spec.submodule_search_locations:
        what = f"{entry.value} of distribution {distribution_of(entry)}, for {entry.group}, is no package"
        raise InputError(what, hint="repair or uninstall that distribution")
    return Path(spec.submodule_search_locations[0])


def class_entries(name: str, kind: type[ResultT]) -> Iterator[tuple[Path, dict[str, ResultT]]]:
    """Yields, for each package with object classes, the YAML file `name` and its entries. Raises InputError."""
    from pydantic import TypeAdapter, ValidationError

    from skills.inputs.schema import first_error

    for file, data in class_tables(name):
        try:
            yield file, TypeAdapter(dict[str, kind]).validate_python(data)  # type: ignore[valid-type]
        except ValidationError as error:
            where, what, hint = first_error(error.errors())
            raise InputError(f"{'.'.join(map(str, where))}: {what}", hint=hint, file=file) from error


def run_plugin(entry: EntryPoint, call: Callable[[], ResultT], *, limit_s: float = LIMIT_S) -> ResultT:
    """Calls the code of an entry point, such as `entry.load`, and returns its result.

    A call that exceeds the limit (s of wall-clock time) ends the process with one line that names the distribution,
    since an import cannot be interrupted. Raises PluginDefect when the code raises anything but a plain
    KeyboardInterrupt, which is the user's.
    """
    with _ended_after(entry, limit_s):
        return call_plugin(call)


def call_plugin(call: Callable[[], ResultT]) -> ResultT:
    """Calls the code of a plug-in, without a time limit. Raises PluginDefect like `run_plugin`."""
    try:
        return call()
    except BaseException as defect:
        if type(defect) is KeyboardInterrupt:
            raise
        raise PluginDefect(_error_text(defect)) from defect


def run_in_thread(call: Callable[[], ResultT], *, limit_s: float) -> ResultT:
    """Calls the code of a plug-in in a thread, and returns its result.

    Raises PluginDefect when the code raises anything, or exceeds the limit (s of wall-clock time); then its thread is
    left behind.
    """
    result: Future[ResultT] = Future()

    def run() -> None:
        try:
            result.set_result(call())
        except BaseException as defect:
            result.set_exception(PluginDefect(_error_text(defect)))

    threading.Thread(target=run, daemon=True).start()
    try:
        return result.result(limit_s)
    except TimeoutError as error:
        raise PluginDefect(f"it is not done within {limit_s:g} s") from error


@contextmanager
def _ended_after(entry: EntryPoint, limit_s: float) -> Iterator[None]:
    """Ends the process when the block takes too long; the project's own modules have no limit."""
    if distribution_of(entry) == OURS:
        yield
        return
    timer = threading.Timer(limit_s, _end_process, (entry, limit_s))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _end_process(entry: EntryPoint, limit_s: float) -> None:
    what = f"{entry.group} '{entry.name}' ({entry.value}) of distribution {distribution_of(entry)}"
    sys.stderr.write(f"errand: {what} is not loaded within {limit_s:g} s; repair or uninstall that distribution\n")
    sys.stderr.flush()
    os._exit(_BAD_INPUT)


def _error_text(defect: BaseException) -> str:
    """Type and text of an error, whose text may be broken or very long."""
    try:
        text = str(defect)[:_LONGEST]
    except Exception:
        text = "without a text"
    return f"{type(defect).__name__}: {' '.join(text.split())}"
