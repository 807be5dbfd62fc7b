"""Harness of the benchmarks: options from parameters, cases in processes, a file of results, and figures as JSON.

A benchmark draws cases, runs each of them in a folder of its own, and sums up their results:

    def cases(first: int = 0, count: int = 10, what: tuple[str, ...] = ("door",)) -> Iterable[tuple[str, int]]: ...
    def run_case(what, number, folder): return {"what": what, "reached": True}
    def summary(results): return {"reached": share([each.reached for each in results])}

    if __name__ == "__main__":
        benchmark(cases, run_case, summary)

The parameters of `cases`, and those of `summary` but the first, are options of the command line. All benchmarks have
`--jobs` (processes), `--json` (figures on one line), `--figures` (a file that pages quote) and `--out`, a folder that
stores the results and the files of the cases: after an interruption the same command goes on there. Results are stored
as JSON; a summary reads their fields as attributes. `command(measure)` does the same for a function without cases. What
a summary or a measure returns is printed; an integer is the exit code.
"""

import argparse
import inspect
import json
import re
import shutil
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, is_dataclass
from multiprocessing import get_context
from pathlib import Path
from types import SimpleNamespace, UnionType
from typing import Literal, get_args, get_origin

import numpy as np

from tests.benchmarks.figures import write_figures


def command(*functions):
    """Calls a function with the options of the command line; of several functions the first argument names one."""
    description, layout = sys.modules["__main__"].__doc__, argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=description, formatter_class=layout)
    parsers = parser.add_subparsers(required=True) if len(functions) > 1 else None
    for each in functions:
        own = parser if parsers is None else parsers.add_parser(each.__name__)
        for parameter in _parameters(each).values():
            _add_option(own, parameter)
        own.add_argument("--json", action="store_true", help="figures on one line")
        own.add_argument("--figures", metavar="NAME", help="store them as docs/figures/NAME.json, which pages quote")
        own.set_defaults(function=each)
    options = vars(parser.parse_args())
    function, on_one_line, name = (options.pop(key) for key in ("function", "json", "figures"))
    figures = function(**options)
    if isinstance(figures, int):
        raise SystemExit(figures)
    if name is not None:
        tell(f"written to {write_figures(name, json.loads(json.dumps(figures, default=_plain)), options)}")
    if figures is not None:
        show(figures, indent=None if on_one_line else 1)


def benchmark(cases, run, summary, *, alone=False):
    """Runs the cases that the command line asks for, each in a process of its own if `alone`; shows their summary."""

    def measure(jobs: int = 1, out: Path | None = None, **options):
        drawn = list(cases(**{name: options[name] for name in _parameters(cases)}))
        with tempfile.TemporaryDirectory(prefix="errand-") as made:
            results = run_all(run, drawn, out or Path(made), jobs=jobs, alone=alone)
            return summary(results, **{name: options[name] for name in [*_parameters(summary)][1:]})

    every = _parameters(cases) | dict([*_parameters(summary).items()][1:]) | _parameters(measure)
    del every["options"]
    vars(measure)["__signature__"] = inspect.Signature(list(every.values()))
    command(measure)


def _parameters(function):
    """Parameters of a function by name, as keyword arguments."""
    found = inspect.signature(function, eval_str=True).parameters
    return {name: each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for name, each in found.items()}


def _add_option(parser, parameter):
    """Adds the option for a parameter: one without a default is positional, a tuple is a list with commas."""
    kind, default, name = parameter.annotation, parameter.default, f"--{parameter.name.replace('_', '-')}"
    if isinstance(kind, UnionType):
        kind, _ = get_args(kind)
    read = {"type": kind}
    if kind is bool:
        read = {"action": argparse.BooleanOptionalAction}
    elif get_origin(kind) is tuple:
        read = {"type": lambda text: tuple(map(get_args(kind)[0], text.split(",")))}
    elif get_origin(kind) is Literal:
        read = {"choices": get_args(kind)}
    if default is parameter.empty:
        parser.add_argument(parameter.name, **read)
    else:
        parser.add_argument(name, default=default, help=f"by default {default}", **read)


def run_all(run, cases, out, *, jobs=1, alone=False):
    """Results of the cases, in their order; a case whose result the folder stores does not run again."""
    out.mkdir(parents=True, exist_ok=True)
    file = out / "results.jsonl"
    file.touch()
    found = dict(map(_stored, file.read_text().splitlines()))
    named = {re.sub(r"[^\w.+-]+", "_", "-".join(map(str, case)))[-120:]: case for case in cases}
    left, begun_s = {name: case for name, case in named.items() if name not in found}, time.monotonic()
    once = 1 if alone else None
    with file.open("a") as lines, ProcessPoolExecutor(jobs, get_context("spawn"), max_tasks_per_child=once) as pool:
        futures = [pool.submit(_run_one, run, case, out / name) for name, case in left.items()]
        for done, future in enumerate(as_completed(futures), start=1):
            if future.exception():
                pool.shutdown(cancel_futures=True)
            name, result = future.result()
            line = json.dumps({"case": name, "result": result}, default=_plain)
            print(line, file=lines, flush=True)
            left_s = (time.monotonic() - begun_s) / done * (len(left) - done)
            tell(f"{done} of {len(left)}, {left_s:.0f} s left: {line}")
            found.update([_stored(line)])
    return [found[name] for name in named]


def _stored(line):
    """Case and result of a line of the file."""
    read = json.loads(line, object_hook=lambda fields: SimpleNamespace(**fields))
    return read.case, read.result


def _run_one(run, case, folder):
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    return folder.name, run(*case, folder)


def tell(line):
    """Prints a line of progress to standard error."""
    print(line, file=sys.stderr, flush=True)


def show(figures, *, indent=None):
    """Prints figures as JSON."""
    print(json.dumps(figures, indent=indent, default=_plain), flush=True)


def _plain(value):
    if isinstance(value, SimpleNamespace):
        return vars(value)
    return asdict(value) if is_dataclass(value) else value.tolist() if hasattr(value, "tolist") else str(value)


def totals(results, *names):
    """Sums of fields over all results; a field that is true or false is counted."""
    return {name: sum(getattr(each, name) for each in results) for name in names}


def by(results, name):
    """Results by the value of a field, sorted."""
    values = sorted({getattr(each, name) for each in results})
    return {value: [each for each in results if getattr(each, name) == value] for value in values}


def for_each(name, figures):
    """Summary with the figures of the results for each value of a field."""
    return lambda results: {value: figures(own) for value, own in by(results, name).items()}


def share(flags, digits=3):
    """Share that is true; None without any."""
    return round(sum(flags) / len(flags), digits) if len(flags) else None


def quantile(values, part=0.5, digits=2):
    """Quantile of values, by default the median; None without any."""
    return round(float(np.quantile(list(values), part)), digits) if len(values) else None
