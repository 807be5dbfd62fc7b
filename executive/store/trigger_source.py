"""Trigger sources: plug-ins that receive messages, such as those of an MQTT broker or a Zenoh network.

A distribution registers one in the entry-point group `errand.triggers`, name = the KIND in `--on "topic KIND:TOPIC"`,
value = "module:factory". The factory takes no arguments and returns an object of the protocol below.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Final, Protocol

from skills.inputs.errors import InputError, listing
from skills.inputs.plugins import PluginDefect, run_plugin

GROUP: Final = "errand.triggers"

Fire = Callable[[str, bytes], None]
"""Receives a topic, as it was given to `start`, and the payload: empty, or a JSON object of parameter values."""


class TriggerSource(Protocol):
    """Receiver of the topics of one kind."""

    def start(self, topics: Sequence[str], fire: Fire) -> None:
        """Begins to listen, and returns within 10 s; from then on calls `fire` for each message.

        A separate thread calls `start` and `stop`, which have 10 s each. Any thread may call `fire`. It queues the
        mission or prints the reason why it cannot, and raises nothing. With a payload of values it takes a second or
        more.
        """

    def stop(self) -> None:
        """Stops listening and closes what it opened; `fire` is not called after it returns. Idempotent."""


def trigger_source(kind: str) -> TriggerSource:
    """Creates a trigger source of a kind. Raises InputError when there is none, or it cannot be created."""
    entry = installed_source(kind)
    try:
        source: Any = run_plugin(entry, lambda: entry.load()())
    except PluginDefect as defect:
        what = f"trigger source '{entry.name}' ({entry.value}) cannot be made ({defect})"
        raise InputError(what, hint="repair or uninstall that package") from defect
    lacking = [name for name in ("start", "stop") if not callable(getattr(source, name, None))]
    if lacking:
        what = f"trigger source '{kind}' ({entry.value}) has no {listing(lacking)}"
        raise InputError(what, hint="see executive.store.trigger_source.TriggerSource")
    found: TriggerSource = source
    return found


def installed_source(kind: str) -> EntryPoint:
    """Returns the trigger source of a kind. Raises InputError unless exactly one installed distribution has it."""
    known = entry_points(group=GROUP)
    found = {entry.value: entry for entry in known if entry.name == kind}
    if len(found) > 1:
        raise InputError(f"{listing(sorted(found))} both are trigger source '{kind}'", hint="uninstall one of them")
    if not found:
        others = f"installed are {listing(sorted({entry.name for entry in known}))}" if known else "none is installed"
        hint = f"install a package that registers '{kind}' in the entry-point group '{GROUP}'; {others}"
        raise InputError(f"there is no trigger source '{kind}'", hint=hint)
    return next(iter(found.values()))
