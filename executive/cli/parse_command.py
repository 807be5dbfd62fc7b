"""`errand parse` shows the commands that sentences mean, and the steps of understanding."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Final, Literal

import typer

import executive
from executive.app.prepare.worlds import knowledge_of, open_world
from executive.cli.output import BAD_INPUT, print_json
from executive.language.explain import Use, arcs_svg, explain, explanation_lines, word_uses
from executive.language.understand import Status, Understanding
from executive.words.knowledge import Knowledge
from executive.words.mission import DEFAULT_WORLD, Mission
from executive.words.steps import steps_to_yaml
from skills.inputs.errors import InputError
from skills.inputs.outside import read_text, writing


def parse(
    sentence: Annotated[str | None, typer.Argument(help="The sentence.", show_default=False)] = None,
    file: Annotated[Path | None, typer.Option(help="A file with one sentence on each line.")] = None,
    world: Annotated[str | None, typer.Option(help="World by name or folder; by default flat.")] = None,
    open_words: Annotated[bool, typer.Option("--open", help="Ground no names in a world.")] = False,
    jsonl: Annotated[bool, typer.Option("--jsonl", help="One JSON object for each sentence.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="The last line of standard output is the result as JSON.")
    ] = False,
    explained: Annotated[bool, typer.Option("--explain", help="Show each step from words to commands.")] = False,
    form: Annotated[
        Literal["text", "svg"], typer.Option("--format", help="svg draws the dependency arcs of the one sentence.")
    ] = "text",
    out: Annotated[Path | None, typer.Option("-o", "--out", help="The file of the drawing.")] = None,
) -> None:
    """Shows the commands that a sentence means."""
    if (sentence is None) == (file is None):
        raise InputError("errand parse takes one sentence or --file", hint='try: errand parse "go to the kitchen"')
    if (form == "svg") != (out is not None) or (out is not None and sentence is None):
        hint = 'try: errand parse "go to the kitchen" --format svg --out arcs.svg'
        raise InputError("--format svg draws one sentence into the file --out", hint=hint)
    knowledge = None if open_words else knowledge_of(open_world(world or DEFAULT_WORLD))
    if file is None:
        lines = [sentence or ""]
    else:
        lines = read_text(file, most_bytes=20_000_000, hint="name a text file in UTF-8").splitlines()
    wake = knowledge is not None and knowledge.robot.require_wake
    parsed = (
        _checked(executive.parse(line, knowledge=knowledge, require_wake=wake, open_words=open_words), knowledge)
        for line in lines
    )
    if jsonl:
        for meaning in parsed:
            print(json.dumps(_values(meaning, explained), ensure_ascii=False), flush=True)
        return
    meanings = list(parsed)
    if out is not None:
        trace = meanings[0].trace
        if trace is None or not trace.tokens:
            raise InputError("there are no words to draw", hint="give a sentence in English words", file=out)
        with writing(out):
            out.write_text(arcs_svg(trace.tokens), encoding="utf-8")
    for meaning in meanings:
        _show(meaning, as_json, explained)
    if as_json:
        values = [_values(meaning, explained) for meaning in meanings]
        print_json(values[0] if file is None else {"sentences": values})
    if any(meaning.status is not Status.OK for meaning in meanings):
        raise typer.Exit(BAD_INPUT)


def _checked(meaning: Understanding, knowledge: Knowledge | None) -> Understanding:
    """Compiles commands with a number, whose limits are those of the plans; returns a refusal as of `errand run`."""
    said = " ".join((*map(str, meaning.commands), *steps_to_yaml(meaning.steps)))
    if knowledge is None or not re.search(r"\d", said):
        return meaning
    from executive.tree.compiler import compile_mission  # loads Drake
    from executive.tree.registry import installed_skills

    mission = Mission.from_steps(meaning.all_steps, world=DEFAULT_WORLD, robot=knowledge.robot.name)
    try:
        compile_mission(mission, knowledge=knowledge, registry=installed_skills())
    except InputError as error:
        return replace(meaning, status=Status.REFUSED, reason=str(error), commands=(), steps=())
    return meaning


def _values(meaning: Understanding, explained: bool) -> dict[str, object]:
    """Returns a sentence's meaning as JSON values, with the steps of understanding if `explained`."""
    steps = None if meaning.trace is None else explain(meaning.trace)
    return {**meaning.to_json(), "steps": steps} if explained else meaning.to_json()


def _show(meaning: Understanding, as_json: bool, explained: bool) -> None:
    """Prints the commands on standard output, perhaps with the steps, or the reason for a refusal on standard error."""
    if explained and meaning.trace is not None:
        uses = (typer.style(word, fg=_COLOURS[use]) for word, use in word_uses(meaning.trace))
        _echo([" ".join(uses), *explanation_lines(meaning.trace)], as_json)
    elif meaning.steps:
        _echo(steps_to_yaml(meaning.steps), as_json)
    elif meaning.commands:
        _echo(map(str, meaning.commands), as_json)
    if meaning.status is not Status.OK:
        typer.echo(f"errand: {meaning.reason}", err=True)
    else:
        _echo(meaning.notes, True)


_COLOURS: Final = {Use.MEANING: "green", Use.NOTE: "yellow", Use.FILLER: "bright_black", Use.REFUSED: "red"}


def _echo(lines: Iterable[str], as_json: bool) -> None:
    for line in lines:
        typer.echo(line, err=as_json)
