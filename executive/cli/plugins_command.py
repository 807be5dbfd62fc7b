"""`errand plugins` and `skills` list what is registered; `errand stack show` prints a stack with its options."""

from __future__ import annotations

import inspect
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from importlib.metadata import EntryPoint, version
from multiprocessing import get_context
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Annotated, Any, Final

import typer

import executive
from executive.cli.entry import COMMANDS, COMMANDS_GROUP, as_command, shipped_command
from executive.cli.number_options import quantity_option
from executive.cli.options import AS_JSON, takes_request
from executive.cli.output import console_for, finish, progress_bar, show_table
from executive.language.questions import RefusalKind
from executive.language.task_sentences import other_readings, sentence_faults
from executive.mission.load import load_stack
from executive.mission.request import Request
from executive.store import trigger_source
from executive.tree import registry
from executive.tree.port_values import describe_type, field_types
from executive.words.task import installed_tasks, task_of
from plant.models.catalogue import load_catalogue
from plant.robots import robot_kind as kinds
from plant.worlds.world import load_world
from skills.class_forms import class_forms
from skills.inputs import plugins as loading
from skills.inputs.errors import InputError, suggestion
from skills.inputs.yaml_source import yaml_of
from skills.quantities import Duration
from skills.stack import (
    BACKENDS,
    DOORS,
    SLOTS,
    is_frozen_dataclass,
    option_fields,
    option_kinds,
    stack_data,
    stack_file,
)

_WORKERS: Final = 4
_WORD: Final = re.compile(r"[a-z][a-z0-9_-]*")
_SCHEME: Final = re.compile(r"[a-z][a-z0-9+.-]*")
_MORE_S: Final = 30.0
"""Time of a process that loads a plug-in, beside the plug-in's own limit."""
_FORKS: Final = get_context("forkserver")
"""Starts each process as a fork of one that has imported this module, which takes longer than most plug-ins."""


@dataclass(frozen=True)
class Plugin:
    """Entry point of another distribution; `broken` says why it cannot be used (None: it can be used).

    `sample` is a sentence of a task that is understood.
    """

    group: str
    name: str
    distribution: str
    version: str
    value: str
    broken: str | None = None
    sample: str | None = None


def plugins(
    as_json: Annotated[bool, typer.Option("--json", help="The last line of standard output is the result.")] = False,
    limit: Annotated[float, quantity_option(Duration, "--limit", help="Time limit per plug-in.")] = loading.LIMIT_S,
) -> None:
    """Lists distributions, what each registers, and errors of loading it, each in a process of its own."""
    entries = _of_others()
    _FORKS.set_forkserver_preload([__name__])
    console, found = console_for(as_json), list[Plugin]()
    with ThreadPoolExecutor(_WORKERS) as pool, progress_bar(console, "plug-ins", len(entries)) as advance:
        for each in pool.map(lambda entry: _checked(entry, limit), entries):
            found.append(_with_sample(each) if each.group == loading.TASKS and not each.broken else each)
            advance()
    show_table(console, ("distribution", "version", "group", "name", "value", ""), list(_rows(found)))
    finish({"plugins": [asdict(each) for each in found]}, as_json, good=not any(each.broken for each in found))


def skills(
    skill: Annotated[str, typer.Argument(metavar="[SKILL]", help="One skill, whole.", show_default=False)] = "",
    as_json: AS_JSON = False,
) -> None:
    """Lists the installed skills: what each does, and the inputs that a step of a mission file gives it by `with`.

    Of one skill it prints the whole text, the default of each input, the outputs and the causes of failure.
    """
    found = registry.installed_skills()
    if skill:
        kind = _named(skill, found)
        others = [(port, hint, "output") for port, hint in kind.outputs.items()]
        others += [(cause.value, "failure", why) for cause, why in kind.causes.items()]
        return _show_whole(skill, kind, [*option_fields(kind.Inputs), *others])
    rows, values = list[tuple[str, ...]](), list[dict[str, object]]()
    for name, kind in found.items():
        about = (kind.__doc__ or "").partition("\n")[0]
        inputs = {port: describe_type(hint) for port, hint in field_types(kind.Inputs).items()}
        rows.append((name, about, ", ".join(f"{port} ({what})" for port, what in inputs.items())))
        values.append({"skill": name, "about": about, "inputs": inputs, "module": kind.__module__})
    rows += [(name, f"broken: {error.message}", "") for name, error in found.broken.items()]
    show_table(console_for(as_json), ("skill", "what it does", "inputs"), rows)
    return finish({"skills": values}, as_json, good=not found.broken)


def _named(name: str, known: Mapping[str, Any]) -> Any:
    """Returns the value of a name. Raises InputError for a name that is not known."""
    if name not in known:
        raise InputError(f"there is no '{name}'", hint=suggestion(name, known))
    return known[name]


def _show_whole(name: str, kind: type, rows: Iterable[tuple[str, Any, Any]]) -> None:
    """Prints a name, the docstring of its class, and a table of names with their types and defaults."""
    typer.echo(f"{name}: {inspect.cleandoc(kind.__doc__ or '')}\n")
    words = [(port, _plain(describe_type(hint)), str(default)) for port, hint, default in rows]
    show_table(console_for(as_json=False), ("name", "type", "default"), words)


def _plain(words: str) -> str:
    """Returns the words for a type without names of Python's types."""
    named = re.sub(r"collections\.abc\.Mapping\[.*?\]", "names to values", words).replace("Path", "path")
    return re.sub(r"Literal\[(.*?)\]", lambda found: found[1].replace("'", "").replace(", ", " or "), named)


def _rows(found: Sequence[Plugin]) -> Iterator[tuple[str, ...]]:
    """Yields the rows for the core and for the plug-ins."""
    yield (loading.OURS, version(loading.OURS), "", "", "", "the core")
    last = ""
    for each in sorted(found, key=lambda each: each.distribution):
        named = (each.distribution, each.version) if each.distribution != last else ("", "")
        used = f'"{each.sample}"' if each.sample else "can be used"
        yield (*named, each.group, each.name, each.value, each.broken or used)
        last = each.distribution


def groups() -> Sequence[str]:
    """Returns the entry-point groups that Errand reads."""
    own = (kinds.GROUP, BACKENDS, trigger_source.GROUP, COMMANDS_GROUP, *loading.GROUPS)
    return (registry.GROUP, *SLOTS.values(), DOORS, *own)


def _of_others() -> Sequence[EntryPoint]:
    found = (entry for group in groups() for entry in loading.installed_plugins(group))
    return sorted((each for each in found if loading.distribution_of(each) != loading.OURS), key=_key)


def _key(entry: EntryPoint) -> str:
    return f"{entry.group}:{entry.name}:{loading.distribution_of(entry)}"


def _checked(entry: EntryPoint, limit_s: float) -> Plugin:
    made = entry.dist.version if entry.dist else ""
    return Plugin(entry.group, entry.name, loading.distribution_of(entry), made, entry.value, _defect(entry, limit_s))


def _defect(entry: EntryPoint, limit_s: float) -> str | None:
    """Loads a plug-in in a separate process; returns why it cannot be used (None: it can be used)."""
    for each in loading.installed_plugins(entry.group).select(name=entry.name):
        if _key(each) != _key(entry):
            return f"{loading.distribution_of(each)} registers the same name"
    if entry.group == COMMANDS_GROUP and (why := _unusable(entry.name)):
        return why
    with NamedTemporaryFile("r", errors="replace") as errors:
        process = _FORKS.Process(target=_load_alone, args=(entry, limit_s, errors.name), daemon=True)
        process.start()
        process.join(limit_s + _MORE_S)
        if process.exitcode is None:
            process.kill()
            return f"it is not loaded within {limit_s:g} s"
        last = errors.read().strip().rpartition("\n")[2].removeprefix("errand: ")
    return (last or f"its process ended with status {process.exitcode}") if process.exitcode else None


def _unusable(name: str) -> str | None:
    """Returns why a name is not allowed for a command; None if it is allowed."""
    group, dot, short = name.rpartition(".")
    if _WORD.fullmatch(short) is None or (dot and _WORD.fullmatch(group) is None):
        return "a command's name is a word in lower case, or GROUP.WORD"
    if not dot:
        return "a command of Errand has this name" if name in COMMANDS else None
    below = getattr(shipped_command(group), "commands", None) if group in COMMANDS else None
    if below is None:
        return f"Errand has no group of commands '{group}'"
    return "a command of Errand has this name" if short in below else None


def _load_alone(entry: EntryPoint, limit_s: float, errors: str) -> None:
    """Loads one plug-in in a process of its own, which writes its errors to a file."""
    for stream, file in ((1, os.devnull), (2, errors)):
        os.dup2(os.open(file, os.O_WRONLY), stream)
    try:
        _load(entry, limit_s)
    except InputError as error:
        raise SystemExit(str(error)) from error


def _load(entry: EntryPoint, limit_s: float) -> None:
    """Loads one plug-in in this process. Raises InputError if it cannot be used."""
    if entry.group == registry.GROUP:
        registry.skills_of([entry], limit_s=limit_s)
    if entry.group == loading.CLASSES:  # its tables, and none of its code
        class_forms()
        load_catalogue()
        return
    if entry.group == loading.TASKS:
        for fault in (*sentence_faults(task_of(entry)), *other_readings(entry.name)):
            raise InputError(fault, hint="docs/how-to/own-task.md has the notation")
        return
    if entry.group == loading.STACKS:
        load_stack(stack_file(Path(entry.name)))
        return
    if entry.group == loading.WORLDS:
        load_world(loading.package_folder(entry) / entry.name)
        return
    load = entry.load if entry.group != COMMANDS_GROUP else lambda: as_command(entry.name, entry.load())
    try:
        used = loading.run_plugin(entry, load, limit_s=limit_s)
    except loading.PluginDefect as defect:
        raise InputError(f"cannot load {entry.value} ({defect})") from defect
    if entry.group == BACKENDS and not (is_frozen_dataclass(used) and callable(getattr(used, "connect", None))):
        raise InputError(f"{entry.value} is no frozen dataclass with a method connect")
    if entry.group == BACKENDS and _SCHEME.fullmatch(entry.name) is None:
        raise InputError(f"'{entry.name}' is no scheme in lower case")
    if entry.group in loading.FUNCTIONS and not callable(used):
        raise InputError(f"{entry.value} is no function")


def _with_sample(plugin: Plugin) -> Plugin:
    """Adds the first sample of a task that is understood in the world `flat`, or one that names what is not there.

    The task is broken if all its samples are refused.
    """
    task, best = installed_tasks()[plugin.name], plugin
    for sample in task.samples:
        meant = executive.parse(sample)
        tasks = {command.task for one in meant.all_steps for step in one.walk() for command in step.commands}
        if task in tasks or (tasks and not task.sentences):
            return replace(plugin, sample=sample)
        elsewhere = meant.refused_as is RefusalKind.OTHER and meant.unknown_words
        why = f"its sample '{sample}' is refused: {meant.reason or 'it has another meaning'}; give it other words"
        found = replace(plugin, sample=sample) if elsewhere else replace(plugin, broken=why)
        best = best if best.sample or (best.broken and not elsewhere) else found
    return best


stack = typer.Typer(name="stack", help="The robot's localiser, planners, controller, detector.", rich_markup_mode=None)


@stack.callback()
def _group() -> None:
    """Makes `show` a subcommand even though the group has no other."""


@stack.command()
@takes_request("stack")
def show(
    request: Request,
    name: Annotated[str, typer.Argument(metavar="[NAME]", help="A slot, component or skill.", show_default=False)] = "",
    options: Annotated[bool, typer.Option("--options", help="Say what each option takes.")] = False,
) -> None:
    """Prints a stack with all its options as YAML, which --stack takes again."""
    data = stack_data(load_stack(request.stack))
    for heading, kind in _named(name, option_kinds()) if options else ():
        _show_whole(heading, kind, option_fields(kind))
    if not options:
        typer.echo(yaml_of({name: _named(name, data)} if name else data, flow_style=False), nl=False)
