"""State that all browsers of a studio share."""

from __future__ import annotations

import re
from functools import cached_property
from pathlib import Path
from typing import Final

from errand_studio.checking import Insight, MissionChecks, PlanMaps
from errand_studio.folder import MissionFolder
from errand_studio.palette import Names
from errand_studio.running import MissionRuns
from errand_studio.runs_table import RunsTable
from executive.app.prepare.worlds import knowledge_of, open_world
from executive.words.knowledge import Knowledge
from skills.inputs.errors import InputError

_WORLD: Final = re.compile(r"^world:[ ]*([^#\n]+)", re.MULTILINE)


class Workshop:
    """State that all browsers of a studio share: folder, checks, runs."""

    def __init__(self, folder: Path, out: Path, *, live_port: int = 0) -> None:
        """`live_port` is that of the live page of runs; 0 takes a free one."""
        self.folder, self.out = MissionFolder(folder), out.resolve()
        self.checks, self.maps = MissionChecks(), PlanMaps()
        self.runs, self.table = MissionRuns(self.out, live_port), RunsTable(self.out)
        self._known: dict[str, Knowledge] = {}

    @cached_property
    def flat(self) -> Knowledge:
        """Knowledge of the default world."""
        return knowledge_of(open_world("flat"))

    def knowledge_for(self, text: str) -> Knowledge:
        """Returns what is known of the world that a text names; of the default world if there is none."""
        named = _WORLD.search(text)
        name = named[1].strip().strip("'\"") if named else ""
        if name not in self._known:
            try:
                self._known[name] = knowledge_of(open_world(name)) if name else self.flat
            except InputError:
                return self.flat
        return self._known[name]

    def check(self, name: str, text: str, *, saved: bool) -> Insight:
        """Checks a text; a text that is not saved becomes the file's draft, beside it."""
        file = self.folder.file(name) if saved else self.folder.keep_draft(name, text)
        return self.checks.check(file, name)

    def names(self, insight: Insight | None) -> Names:
        """Returns the names of a mission's world."""
        return Names.of(self.knowledge(insight))

    def knowledge(self, insight: Insight | None) -> Knowledge:
        """Returns what is known of a mission's world; of the default world if the mission could not be prepared."""
        return self.flat if insight is None or insight.prepared is None else insight.prepared.knowledge
