"""Loads what other distributions register as entry points, in limited time; what they raise becomes one error."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from functools import cache
from importlib.metadata import Distribution, EntryPoint, EntryPoints, SelectableGroups, entry_points
from typing import Final, TypeVar

__all__ = ["LIMIT_S", "OURS", "PluginDefect", "distribution_of", "installed_plugins", "run_in_thread", "run_plugin"]

OURS: Final = "spot-errand"
"""The distribution of this project, whose modules need no time limit."""
LIMIT_S: Final = 30.0
_BAD_INPUT: Final = 2
_LONGEST: Final = 300

ResultT = TypeVar("ResultT")


class PluginDefect(Exception):  # noqa: N818
    """What the code of a plug-in raised, whatever that was: its type and its text."""


def distribution_of(entry: EntryPoint) -> str:
    """The distribution that registers an entry point."""
    return "an unknown distribution" if entry.dist is None else _name_of(entry.dist)


@cache
def _name_of(distribution: Distribution) -> str:
    """The name of a distribution, which each time is read from its file."""
    return distribution.name


def installed_plugins(group: str) -> EntryPoints:
    """The entry points of a group. They are read once: each reading opens the files of all distributions."""
    return _all_installed().select(group=group)


@cache
def _all_installed() -> SelectableGroups:
    return entry_points()


def run_plugin(entry: EntryPoint, call: Callable[[], ResultT], *, limit_s: float = LIMIT_S) -> ResultT:
    """The result of a call into the code of an entry point, such as `entry.load`.

    A call that is not over within the limit (s, on the wall's clock) ends the process with one line that names the
    distribution: an import cannot be broken off. Raises PluginDefect: the code raised anything but a plain
    KeyboardInterrupt, which is the user's.
    """
    try:
        with _ended_after(entry, limit_s):
            return call()
    except BaseException as defect:
        if type(defect) is KeyboardInterrupt:
            raise
        raise PluginDefect(_words(defect)) from defect


def run_in_thread(call: Callable[[], ResultT], *, limit_s: float) -> ResultT:
    """Calls the code of a plug-in in a thread, and returns its result.

    Raises PluginDefect: the code raised something, or is not done within the limit (s, on the wall's clock); then its
    thread is left behind.
    """
    result: Future[ResultT] = Future()

    def run() -> None:
        try:
            result.set_result(call())
        except BaseException as defect:
            result.set_exception(PluginDefect(_words(defect)))

    threading.Thread(target=run, daemon=True).start()
    try:
        return result.result(limit_s)
    except TimeoutError as error:
        raise PluginDefect(f"it is not done within {limit_s:g} s") from error


@contextmanager
def _ended_after(entry: EntryPoint, limit_s: float) -> Iterator[None]:
    """Ends the process when the block takes too long; our own modules are given all the time that they take."""
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


def _words(defect: BaseException) -> str:
    """The type and the text of what was raised; the text may be no text, and endless."""
    try:
        text = str(defect)[:_LONGEST]
    except Exception:
        text = "without a text"
    return f"{type(defect).__name__}: {' '.join(text.split())}"
