"""The command line: `errand parse | tree | run | evaluate`."""

from __future__ import annotations

import json
import logging
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from executive.cli.assembly import knowledge_of, open_world
from executive.cli.check_command import check
from executive.cli.check_command import check
from executive.cli.live import live_view
from executive.cli.log_command import log
from executive.cli.mission_run import Finished, run_request
from executive.cli.new_skill_command import new_skill
from executive.cli.output import BAD_INPUT, NOT_ACHIEVED, console_for, print_json, refusals
from executive.cli.page_view import PageView
from executive.cli.replay_command import replay
from executive.cli.requests import Request, filed, said
from executive.cli.sweep import rows, seed_range, sweep, totals
from executive.cli.tree_command import tree
from executive.compiler import CompiledTree
from executive.errors import InputError
from executive.language import Status, Understanding, load_parser, parse_lines
from executive.mission import DEFAULT_WORLD
from executive.view.text import to_rich

app = typer.Typer(
    name="errand",
    help="From an English request to a robot's work.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

World = Annotated[str | None, typer.Option(help="World by name or folder; flat unless said.")]
Say = Annotated[str | None, typer.Option(help='What is said, as in "Hey Alice, fetch me a drink".')]
MissionFile = Annotated[Path | None, typer.Argument(metavar="FILE", help="A mission file.", show_default=False)]
NoWake = Annotated[bool, typer.Option("--no-wake", help="The robot's name need not be said.")]
AsJson = Annotated[bool, typer.Option("--json", help="The last line of standard output is the result as JSON.")]


app.command()(check)
app.command()(check)
app.command()(tree)
app.command()(log)
app.command()(replay)
app.command()(new_skill)


@app.command()
def parse(
    sentence: Annotated[str | None, typer.Argument(help="The sentence.", show_default=False)] = None,
    file: Annotated[Path | None, typer.Option(help="A file with one sentence on each line.")] = None,
    world: World = None,
    open_words: Annotated[bool, typer.Option("--open", help="Ground nothing in a world; names as spoken.")] = False,
    jsonl: Annotated[bool, typer.Option("--jsonl", help="One JSON object for each sentence.")] = False,
    as_json: AsJson = False,
) -> None:
    """Show the commands that a sentence means."""
    with refusals():
        if (sentence is None) == (file is None):
            raise InputError("errand parse takes one sentence or --file", mend='try: errand parse "go to the kitchen"')
        knowledge = None if open_words else knowledge_of(open_world(world or DEFAULT_WORLD))
        parser = load_parser()
        lines = [sentence] if sentence is not None else _lines_of(file)
        told = parse_lines(lines, parser=parser, knowledge=knowledge)
        if jsonl:
            for meaning in told:
                print(json.dumps(meaning.to_json(), ensure_ascii=False), flush=True)
            return
        meanings = list(told)
        for meaning in meanings:
            _show_meaning(meaning, as_json)
        if as_json:
            print_json(meanings[0].to_json() if file is None else {"sentences": [m.to_json() for m in meanings]})
        if any(meaning.status is not Status.OK for meaning in meanings):
            raise typer.Exit(BAD_INPUT)


@app.command()
def run(
    file: MissionFile = None,
    say: Say = None,
    world: World = None,
    seed: Annotated[int, typer.Option(min=0, help="Sets the things in the world and all noise.")] = 1,
    no_wake: NoWake = False,
    out: Annotated[Path, typer.Option(help="Folder for log, tree, recording and pictures.")] = Path("out"),
    as_json: AsJson = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No live tree.")] = False,
    no_record: Annotated[bool, typer.Option("--no-record", help="No recording and no pictures.")] = False,
    view: Annotated[bool, typer.Option("--view", help="Serve a live page on 127.0.0.1, also after the end.")] = False,
    view_for: Annotated[float | None, typer.Option(min=0.0, help="The page stays so long (s) after the end.")] = None,
    view_port: Annotated[int, typer.Option(min=0, max=65535, help="The page's port; 0 takes a free one.")] = 0,
) -> None:
    """Run a sentence or a mission file in the simulated world."""
    with refusals():
        request = _request(file, say, world, require_wake=not no_wake)
        compiled = request.compile()
        page = PageView(request, console_for(as_json), port=view_port) if view or view_for is not None else None
        finished = _run_shown(
            request, compiled, seed, out, record=not no_record, as_json=as_json, quiet=quiet, page=page
        )
    if as_json:
        print_json(finished.report.to_json())
    if page is not None:
        page.stay(view_for)
    if not finished.report.achieved:
        raise typer.Exit(NOT_ACHIEVED)


@app.command()
def evaluate(
    file: MissionFile = None,
    say: Say = None,
    world: World = None,
    seeds: Annotated[str, typer.Option(help="Such as 1-20 or 1,4,7.")] = "1-20",
    jobs: Annotated[int, typer.Option(min=1, help="How many runs at a time.")] = 2,
    no_wake: NoWake = False,
    out: Annotated[Path, typer.Option(help="Folder for the logs.")] = Path("out/evaluate"),
    as_json: AsJson = False,
) -> None:
    """Run a mission at many seeds and count what the trees claim and what the referee saw."""
    with refusals():
        chosen = seed_range(seeds)
        _request(file, say, world, require_wake=not no_wake).compile()
    arguments = [*([str(file)] if file else ["--say", say or ""]), *(["--world", world] if world else [])]
    arguments += ["--no-wake"] if no_wake else []
    console = console_for(as_json)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console) as bar:
        task = bar.add_task("seeds", total=len(chosen))
        reports = sweep(arguments, chosen, jobs=jobs, out=out, done=lambda report: bar.advance(task))
    table = Table("seed", "tree", "referee", "collisions", "drops", "sim s", "x real", "message")
    for row in rows(reports):
        table.add_row(*row)
    console.print(table)
    result = totals(reports)
    counts = ", ".join(f"{result[key]} {key.replace('_', ' ')}" for key in _COUNTS)
    console.print(f"{len(reports)} runs: {counts}")
    if as_json:
        print_json(result)
    if result["referee_successes"] < len(reports) or result["false_claims"]:
        raise typer.Exit(NOT_ACHIEVED)


def main() -> None:
    """The entry point of the console script."""
    logging.getLogger("drake").setLevel(logging.WARNING)
    app()


def _request(file: Path | None, say: str | None, world: str | None, *, require_wake: bool) -> Request:
    if (file is None) == (say is None):
        raise InputError("a mission file or --say is needed, and not both", mend='try: --say "Hey Alice, ..."')
    if say is not None:
        return said(say, world=world, require_wake=require_wake)
    assert file is not None
    return filed(file, world=world)


def _run_shown(
    request: Request,
    compiled: CompiledTree,
    seed: int,
    out: Path,
    *,
    record: bool,
    as_json: bool,
    quiet: bool,
    page: PageView | None = None,
) -> Finished:
    """Run it with the commands before, the tree while it runs, and the verdicts after."""
    console = console_for(as_json)
    for command in request.mission.commands:
        console.print(str(command), markup=False)
    seen: dict[str, Any] = {} if page is None else {"page": page, "control": page.control}
    start = partial(run_request, request, compiled, seed=seed, out=out, record=record, **seen)
    if quiet:
        finished = start()
    else:
        with live_view(compiled, console) as observer:
            finished = start(observer=observer)
        console.print(to_rich(finished.tree, collapsed=False))
    for line in finished.report.lines():
        console.print(line)
    console.print(f"Written to {out}: {', '.join(sorted(path.name for path in out.iterdir()))}", markup=False)
    return finished


def _show_meaning(meaning: Understanding, as_json: bool) -> None:
    """The commands on standard output, or the reason on standard error."""
    if meaning.status is not Status.OK:
        typer.echo(f"errand: {meaning.reason}", err=True)
    for command in meaning.commands:
        typer.echo(str(command), err=as_json)


def _lines_of(file: Path | None) -> list[str]:
    assert file is not None
    try:
        return file.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read it ({error})", mend="name a text file in UTF-8", file=file) from error


_COUNTS: Final = ("successes", "referee_successes", "false_claims")
