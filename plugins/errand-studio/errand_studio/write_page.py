"""Page on which a mission is written, checked, seen and run."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, Final

from nicegui import events, run, ui

from errand_studio import fragments, outline
from errand_studio.checking import Insight
from errand_studio.folder import ConflictError, Opened
from errand_studio.layout import Notice, frame, head, panel, refused, tool
from errand_studio.mission_edits import Edited, dropped, edited, inserted, items, path_of
from errand_studio.palette import Example, examples
from errand_studio.run_panel import RunPanel
from errand_studio.workshop import Workshop
from executive import parse
from executive.language.understand import Status
from executive.words.steps import steps_to_yaml
from skills.inputs.errors import InputError
from skills.inputs.yaml_source import KeyPath

PAUSE_S: Final = 0.2
"""Pause of typing after which a text is checked."""
LOOK_S: Final = 1.0
"""Period in which drafts are kept, and files looked at; a crash loses at most so much."""
_FIRST: Final = "mission"
"""Name of the file that the first step creates in an empty folder."""
_VIEWS: Final = ("Tree", "Plan", "Commands")


class WritePage:
    """Page of one browser: an opened file, its check, and the run."""

    def __init__(self, workshop: Workshop) -> None:
        self._workshop, self._folder = workshop, workshop.folder
        self._file = Opened("", "", "")
        self._text = ""
        self._version = self._kept = 0
        self._insight: Insight | None = None
        self._stops: set[int] = set()
        self._examples: list[Example] = []
        self._view = _VIEWS[0]

    async def build(self, name: str) -> None:
        """Builds the page, and opens a file."""
        frame("errand studio", "Missions")
        self._build_bar()
        self._notice = Notice()
        with ui.element("div").classes("work") as self._work:
            self._build_files()
            self._build_editor()
            self._build_views()
        self._run_panel = RunPanel(self._workshop.runs, self._start)
        self._draw_palette()
        ui.on("studio", self._event)
        names = self._folder.names()
        first = name if name in names else next(iter(names), "")
        if first:
            self._open(first)
        else:
            self._draw_files()
            self._outline.content = fragments.outline_html((), {}, ())
        ui.timer(LOOK_S, self._look)
        with suppress(TimeoutError):
            await ui.context.client.connected(timeout=30.0)
            ui.run_javascript(f"studio.attach({self._editor.id}); {self._theme_script}")

    _theme_script: Final = (
        'emitEvent("studio", {what: "theme", dark: document.documentElement.dataset.theme === "dark"})'
    )

    # Building

    def _build_bar(self) -> None:
        with next(each for each in ui.context.client.elements.values() if each.tag == "header"):
            ui.element("span").classes("spring")
            self._state = ui.html("", sanitize=False)
            self._run_button = tool("Run", self._show_run, hint="Set up a run, and watch it (Ctrl-Enter)")
            tool("Save", self._save, hint="Save the file (Ctrl-S)", kind="main")
            tool("◐", lambda: ui.run_javascript("studio.toggleTheme()"), hint="Light or dark", kind="quiet")

    def _build_files(self) -> None:
        with ui.element("div").classes("stack"):
            with panel("files-panel"):
                with head("Missions"):
                    tool("New", self._ask_new, hint="Create a mission file", kind="quiet")
                self._files = ui.html("", sanitize=False).classes("body")
            with panel():
                with head("Steps"):
                    ui.label("click, or drag").classes("t")
                self._palette = ui.html("", sanitize=False).classes("body palette")

    def _build_editor(self) -> None:
        with ui.element("div").classes("stack"):
            with panel():
                with head():
                    self._name = ui.label("").classes("name")
                    self._dirty = ui.label("").classes("t")
                self._editor = ui.codemirror(on_change=self._changed, language="YAML", theme="githubLight", indent="  ")
                self._editor.classes("editor")
                with head().classes("foot"):
                    self._sentence = ui.input(placeholder='Say: "bring me a beer from the kitchen"')
                    self._sentence.props("dense outlined").classes("grow").on("keydown.enter", self._say)
                    tool("Add its steps", self._say, hint="The steps of the sentence, behind the cursor")
            with panel("found"):
                self._messages = ui.html("", sanitize=False).classes("body")

    def _build_views(self) -> None:
        with ui.element("div").classes("stack"):
            with panel():
                with head("Outline"):
                    self._build_edits()
                self._outline = ui.html("", sanitize=False).classes("body")
            with panel("grow see-panel"):
                with head():
                    self._tabs = {name: tool(name, partial(self._choose, name)) for name in _VIEWS}
                self._seen = ui.html("", sanitize=False).classes("body wide")
        self._tabs[self._view].classes("here")

    def _build_edits(self) -> None:
        send = 'studio.path && emitEvent("studio", {{what: "{0}", path: studio.path}})'
        for sign, what, hint in (
            ("↑", "up", "Move up (Alt-Up)"),
            ("↓", "down", "Move down (Alt-Down)"),
            ("→", "in", "Move into the list above (Alt-Right)"),
            ("←", "out", "Move out of the block (Alt-Left)"),
            ("Double", "double", "Double (D)"),
            ("Remove", "remove", "Remove (Delete)"),
        ):
            tool(sign, kind="quiet", hint=hint).on("click", js_handler=f"() => {{ {send.format(what)} }}")
        with tool("Wrap", kind="quiet", hint="Put the step into a block (W)"), ui.menu() as self._wraps:
            for kind in outline.WRAPS:
                send = f'() => emitEvent("studio", {{what: "wrap in", kind: "{kind}", path: studio.path}})'
                ui.menu_item(kind).on("click", js_handler=send)

    # Files

    def _open(self, name: str) -> None:
        try:
            opened = self._folder.open(name)
        except InputError as error:
            refused(error)
            return
        self._file, self._insight, self._stops = opened, None, set()
        self._name.text = name
        ui.run_javascript(f"history.replaceState(null, '', '/?file=' + encodeURIComponent({name!r}))")
        self._show(opened.text)
        self._notice.hide()
        if opened.draft is not None:
            draft = opened.draft
            self._notice.ask(
                "There is an unsaved draft of this file.", {"Take it": lambda: self._show(draft), "Drop it": self._drop}
            )
        self._draw_files()

    def _drop(self) -> None:
        self._folder.drop_draft(self._file.name)

    def _draw_files(self) -> None:
        self._files.content = fragments.files_html(self._folder.names(), self._file.name)

    def _ask_new(self) -> None:
        def create() -> None:
            try:
                name = self._folder.create((asked.value or "").strip())
            except InputError as error:
                refused(error)
                return
            dialog.close()
            typed = "" if self._file.name else self._text
            self._leave_for(name)
            if typed:
                self._show(typed)

        with ui.dialog(value=True) as dialog, ui.element("div").classes("panel asked"):
            asked = ui.input(placeholder="name of the file, as in night_round").props("dense outlined autofocus")
            asked.on("keydown.enter", create)
            tool("Create", create, kind="main")

    @property
    def _is_dirty(self) -> bool:
        return bool(self._file.name) and self._text != self._file.text

    def _save(self, stamp: str | None = None) -> bool:
        """Saves the file if it still has a stamp, by default that which it had; returns whether it is saved now."""
        name = self._file.name
        if not name:
            self._ask_new()
            return False
        try:
            saved = self._folder.save(name, self._text, self._file.stamp if stamp is None else stamp)
        except ConflictError:
            self._ask_which("The file has changed since you opened it.")
            return False
        except InputError as error:
            refused(error)
            return False
        self._file = Opened(name, self._text, saved)
        self._notice.hide()
        self._draw_dirty()
        return True

    def _ask_which(self, text: str) -> None:
        """Asks for one of two texts that differ."""

        def overwrite() -> None:
            self._save(self._folder.stamp(self._file.name))

        self._notice.ask(text, {"Load it": self._reload, "Overwrite it": overwrite})

    def _reload(self) -> None:
        self._folder.drop_draft(self._file.name)
        self._open(self._file.name)

    async def _look(self) -> None:
        """Keeps the draft, takes over what others have saved, and shows the run's lines."""
        self._run_panel.draw()
        name = self._file.name
        if not name:
            return
        if self._is_dirty and self._kept != self._version:
            self._kept = self._version
            await run.io_bound(self._folder.keep_draft, name, self._text)
        stamp = await run.io_bound(self._folder.stamp, name)
        if stamp == self._file.stamp or self._notice.is_shown or name != self._file.name:
            return
        if not stamp:
            self._notice.ask("The file is gone.", {"Write it again": lambda: self._save("")})
        elif not self._is_dirty:
            self._open(name)
            ui.notify("The file has changed outside, and is loaded again.", position="top")
        else:
            self._ask_which("The file has changed outside, and your text is not saved.")

    # Text and check

    def _show(self, text: str) -> None:
        """Shows a text in the editor, and checks it."""
        if self._editor.value != text:
            self._editor.value = text
        else:
            self._text = text
            ui.timer(0.0, self._check, once=True)
        self._text = text

    async def _changed(self, event: events.ValueChangeEventArguments[str]) -> None:
        self._text = event.value or ""
        self._version += 1
        version = self._version
        self._draw_dirty()
        await asyncio.sleep(PAUSE_S)
        if version == self._version:
            await self._check()

    async def _check(self) -> None:
        """Checks the text and shows what is found, unless the text has changed meanwhile."""
        version, text, name = self._version, self._text, self._file.name
        if not name:
            return
        self._draw_outline()
        try:
            insight = await run.io_bound(self._workshop.check, name, text, saved=text == self._file.text)
        except InputError as error:
            refused(error)
            return
        if version == self._version and name == self._file.name and insight is not None:
            self._insight = insight
            self._draw_insight(insight)
            await self._draw_view()

    def _draw_dirty(self) -> None:
        self._dirty.text = "not saved" if self._is_dirty else ""

    def _draw_insight(self, insight: Insight) -> None:
        self._state.content = fragments.state_html(insight)
        self._messages.content = fragments.messages_html(insight.messages, insight.summary)
        self._draw_palette()
        self._draw_outline()
        self._decorate()

    def _draw_palette(self) -> None:
        """Shows examples with the names of the mission's world."""
        found = examples(self._workshop.names(self._insight))
        if found != self._examples:
            self._examples = found
            self._palette.content = fragments.palette_html(found)

    def _decorate(self) -> None:
        """Marks the lines of the editor that have messages or breakpoints."""
        messages = () if self._insight is None else self._insight.messages
        last = self._text.count("\n") + 1
        marks = dict.fromkeys(self._stops, "stop-line")
        marks |= {each.line: "warned-line" for each in messages if not each.is_error}
        marks |= {each.line: "bad-line" for each in messages if each.is_error}
        shown = [{"kind": "line", "line": line, "class": name} for line, name in marks.items() if line <= last]
        self._editor.decorations = shown
        self._editor.line_tooltips = {each.line: f"{each.text} {each.hint}" for each in messages if each.line <= last}

    def _draw_outline(self) -> None:
        messages = () if self._insight is None else self._insight.messages
        marked = {each.line: each.is_error for each in messages}
        with suppress(InputError):  # a broken text keeps the outline of the text before
            self._outline.content = fragments.outline_html(outline.rows(self._text), marked, self._stops)
            ui.run_javascript("setTimeout(() => studio.redrawn(), 60)")

    async def _choose(self, name: str) -> None:
        self._tabs[self._view].classes(remove="here")
        self._view = name
        self._tabs[name].classes("here")
        self._seen.content = fragments.DRAWING
        await self._draw_view()

    async def _draw_view(self) -> None:
        insight, view = self._insight, self._view
        if insight is None:
            return
        drawn = await run.io_bound(self._drawn, insight, view)
        if view == self._view and insight is self._insight and drawn is not None:
            self._seen.content = drawn
        ui.run_javascript("setTimeout(() => studio.mark(), 60)")

    def _drawn(self, insight: Insight, view: str) -> str:
        if view == "Tree":
            return fragments.tree_html(insight.trees)
        if view == "Commands":
            return fragments.judged_html(insight.judged)
        return fragments.map_svg(self._workshop.maps.map_of(insight))

    # Edits

    async def _event(self, event: events.GenericEventArguments) -> None:
        """Handles what a user does in a panel."""
        values: Mapping[str, Any] = event.args if isinstance(event.args, dict) else {}
        what, path = str(values.get("what")), path_of(values.get("path"))
        try:
            if what == "theme":
                self._editor.theme = "githubDark" if values.get("dark") else "githubLight"
            elif what == "save":
                self._save()
            elif what == "run":
                await self._start()
            elif what == "open":
                self._leave_for(str(values.get("name")))
            elif what == "fix":
                self._fix(int(values["number"]))
            elif what == "stop line":
                self._stops ^= {int(values["at"])}
                self._draw_outline()
                self._decorate()
            elif what == "pick":
                self._insert(path, [self._examples[int(values["number"])].text])
            elif what == "drop":
                step = self._examples[int(values["pick"])].text if "pick" in values else ""
                to = path_of(values["to"]) or ()
                self._take(dropped(self._text, to, values["place"], None if step else path, step))
            elif what == "wrap":
                self._wraps.open()
            elif path is not None:
                self._take(edited(what, self._text, path, str(values.get("kind"))))
        except InputError as error:
            refused(error)
        except (KeyError, IndexError, ValueError, TypeError):
            ui.notify("The text has changed: choose again.", position="top")

    def _leave_for(self, name: str) -> None:
        if self._is_dirty:
            self._folder.keep_draft(self._file.name, self._text)
        self._open(name)

    def _fix(self, number: int) -> None:
        message = (self._insight or Insight()).messages[number]
        if message.replacement is None:
            return
        lines, (word, meant) = self._text.split("\n"), message.replacement
        lines[message.line - 1] = lines[message.line - 1].replace(word, meant, 1)
        self._show("\n".join(lines))

    def _insert(self, path: KeyPath | None, steps: list[str]) -> None:
        """Inserts steps behind the step at `path`, or at the end; without an open file, creates one."""
        if not self._file.name and not self._text.strip():
            self._open(self._folder.create(_FIRST))
        self._take(inserted(self._text, path, steps, Path(self._file.name or _FIRST).stem.replace("_", " ")))

    def _take(self, result: Edited) -> None:
        """Shows an edited text, and selects a step."""
        text, path = result
        self._show(text)
        self._draw_outline()
        row = next((row for row in outline.rows(text) if row.path == path), None) if path else None
        if row is not None:
            ui.run_javascript(f"studio.focus({list(row.path)!r}); setTimeout(() => studio.goTo({row.line}), 80)")

    async def _say(self) -> None:
        """Inserts the steps of the sentence behind the cursor, or says why there are none."""
        sentence = str(self._sentence.value or "").strip()
        if not sentence:
            return
        knowledge = self._workshop.knowledge(self._insight)
        meaning = await run.io_bound(parse, sentence, knowledge=knowledge)
        if meaning is None or meaning.status is not Status.OK:
            ui.notify(meaning.reason if meaning else "not understood", type="warning", position="top", multi_line=True)
            return
        path = await ui.run_javascript("studio.path", timeout=5.0)
        try:
            self._insert(path_of(path), items(steps_to_yaml(meaning.all_steps)))
        except InputError as error:
            refused(error)
            return
        self._sentence.value = ""

    # Running

    def _show_run(self) -> None:
        shown = not self._run_panel.is_shown
        self._run_panel.show(shown)
        self._work.set_visibility(not shown)
        self._run_button.text = "Text" if shown else "Run"

    async def _start(self) -> None:
        if self._is_dirty and not self._save():
            return
        if not self._run_panel.is_shown:
            self._show_run()
        try:
            file = self._folder.file(self._file.name)
            await self._workshop.runs.start(file, self._run_panel.options, self._stop_nodes())
        except InputError as error:
            refused(error)
        self._run_panel.draw()

    def _stop_nodes(self) -> list[str]:
        """Path ids of the steps on the lines with breakpoints."""
        trees = () if self._insight is None else self._insight.trees
        nodes = [node for tree in trees for _, node in tree.walk() if node.step and node.source is not None]
        lines = {node.source.line: node.path_id for node in reversed(nodes) if node.source is not None}
        return [lines[line] for line in sorted(self._stops) if line in lines]
