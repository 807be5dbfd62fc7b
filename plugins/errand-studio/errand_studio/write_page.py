"""Page on which a mission is written, checked, seen and run."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, Final

from nicegui import events, run, ui

from errand_studio import fragments, outline
from errand_studio.checking import Insight
from errand_studio.folder import ConflictError, Opened
from errand_studio.layout import frame, refused, tool
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
_STEPS: Final = ("steps",)
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
        self._notice = ui.element("div").classes("notice")
        with ui.element("div").classes("work") as self._work:
            self._build_files()
            self._build_editor()
            self._build_views()
        self._run_panel = RunPanel(self._workshop.runs, self._start, self._show_run)
        self._notice.set_visibility(False)
        self._draw_palette()
        ui.on("studio", self._event)
        names = self._folder.names()
        first = name if name in names else next(iter(names), "")
        if first:
            self._open(first)
        else:
            self._draw_files()
        ui.timer(LOOK_S, self._look)
        with suppress(TimeoutError):
            await ui.context.client.connected(timeout=30.0)
            ui.run_javascript(f"studio.attach({self._editor.id}); {self._theme_script}")

    _theme_script: Final = (
        'emitEvent("studio", {what: "theme", dark: document.documentElement.dataset.theme === "dark"})'
    )

    # Building

    def _build_bar(self) -> None:
        bar = next(each for each in ui.context.client.elements.values() if each.tag == "header")
        with bar:
            ui.element("span").classes("spring")
            self._state = ui.html("", sanitize=False)
            self._run_button = tool("Run", self._show_run, hint="Set up a run, and watch it (Ctrl-Enter)")
            tool("Save", self._save, hint="Save the file (Ctrl-S)", kind="main")
            tool("◐", lambda: ui.run_javascript("studio.toggleTheme()"), hint="Light or dark", kind="quiet")

    def _build_files(self) -> None:
        with ui.element("div").classes("stack"):
            with ui.element("section").classes("panel files-panel"):
                with ui.element("div").classes("head"):
                    ui.html("<h2>Missions</h2>", sanitize=False)
                    ui.element("span").classes("spring")
                    tool("New", self._ask_new, hint="Create a mission file", kind="quiet")
                self._files = ui.html("", sanitize=False).classes("body")
            with ui.element("section").classes("panel grow"):
                with ui.element("div").classes("head"):
                    ui.html("<h2>Steps</h2>", sanitize=False)
                    ui.label("click, or drag").classes("t")
                self._palette = ui.html("", sanitize=False).classes("body palette")

    def _build_editor(self) -> None:
        with ui.element("div").classes("stack"):
            with ui.element("section").classes("panel grow"):
                with ui.element("div").classes("head"):
                    self._name = ui.label("").classes("name")
                    self._dirty = ui.label("").classes("t")
                    ui.element("span").classes("spring")
                self._editor = ui.codemirror(on_change=self._changed, language="YAML", theme="githubLight", indent="  ")
                self._editor.classes("editor")
                with ui.element("div").classes("head").style("border-top:1px solid var(--edge);border-bottom:0"):
                    self._sentence = ui.input(placeholder='Say: "bring me a beer from the kitchen"').props(
                        "dense outlined"
                    )
                    self._sentence.classes("grow").on("keydown.enter", self._say)
                    tool("Add its steps", self._say, hint="The steps of the sentence, behind the cursor")
            with ui.element("section").classes("panel").style("max-height:30%;min-height:64px"):
                self._messages = ui.html("", sanitize=False).classes("body")

    def _build_views(self) -> None:
        with ui.element("div").classes("stack"):
            with ui.element("section").classes("panel grow"):
                with ui.element("div").classes("head"):
                    ui.html("<h2>Outline</h2>", sanitize=False)
                    ui.element("span").classes("spring")
                    self._build_edits()
                self._outline = ui.html("", sanitize=False).classes("body")
            with ui.element("section").classes("panel grow see-panel"):
                with ui.element("div").classes("head"):
                    self._tabs = {name: tool(name, self._choose(name)) for name in _VIEWS}
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
                item = ui.menu_item(kind)
                item.on(
                    "click",
                    js_handler=f'() => emitEvent("studio", {{what: "wrap in", kind: "{kind}", path: studio.path}})',
                )

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
        self._hide_notice()
        if opened.draft is not None:
            draft = opened.draft
            self._ask(
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
            self._open(name)

        with ui.dialog(value=True) as dialog, ui.element("div").classes("panel").style("padding:14px;gap:10px"):
            asked = ui.input(placeholder="name of the file, as in night_round").props("dense outlined autofocus")
            asked.on("keydown.enter", create)
            tool("Create", create, kind="main")

    @property
    def _is_dirty(self) -> bool:
        return bool(self._file.name) and self._text != self._file.text

    def _save(self) -> bool:
        """Saves the file; returns whether it is saved now."""
        if not self._file.name:
            self._ask_new()
            return False
        try:
            self._store(self._file.stamp)
        except ConflictError:
            self._ask(
                "The file has changed since you opened it.",
                {"Load it": self._reload, "Overwrite it": lambda: self._store(self._folder.stamp(self._file.name))},
            )
            return False
        except InputError as error:
            refused(error)
            return False
        return True

    def _store(self, stamp: str) -> None:
        saved = self._folder.save(self._file.name, self._text, stamp)
        self._file = Opened(self._file.name, self._text, saved)
        self._hide_notice()
        self._draw_dirty()

    def _reload(self) -> None:
        self._folder.drop_draft(self._file.name)
        self._open(self._file.name)

    def _ask(self, text: str, answers: Mapping[str, Callable[[], object]]) -> None:
        """Shows a question above the text until it is answered."""
        self._notice.clear()
        with self._notice:
            ui.label(text)
            for name, act in answers.items():
                tool(name, self._answering(act))
        self._notice.set_visibility(True)

    def _answering(self, act: Callable[[], object]) -> Callable[[], object]:
        def answer() -> None:
            self._hide_notice()
            act()

        return answer

    def _hide_notice(self) -> None:
        self._notice.set_visibility(False)

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
        if stamp == self._file.stamp or self._notice.visible or name != self._file.name:
            return
        if not stamp:
            self._ask("The file is gone.", {"Write it again": lambda: self._store("")})
        elif not self._is_dirty:
            self._open(name)
            ui.notify("The file has changed outside, and is loaded again.", position="top")
        else:
            self._ask(
                "The file has changed outside, and your text is not saved.",
                {"Load it": self._reload, "Overwrite it": lambda: self._store(self._folder.stamp(name))},
            )

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

    def _choose(self, name: str) -> Callable[[], object]:
        async def choose() -> None:
            self._tabs[self._view].classes(remove="here")
            self._view = name
            self._tabs[name].classes("here")
            await self._draw_view()

        return choose

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
        what, path = str(values.get("what")), _path(values.get("path"))
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
                self._insert_behind(path, self._examples[int(values["number"])].text)
            elif what == "drop":
                self._dropped(values)
            elif path is not None:
                self._edit(what, path, str(values.get("kind")))
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

    def _edit(self, what: str, path: KeyPath, kind: str) -> None:
        text, index, own = self._text, int(path[-1]), path[:-1]
        if what == "remove":
            self._edited(outline.remove(text, path), None)
        elif what == "double":
            self._edited(outline.double(text, path), (*own, index + 1))
        elif what == "wrap":
            self._wraps.open()
        elif what == "wrap in":
            self._edited(outline.wrap(text, path, kind), path)
        elif what == "up" and index > 0:
            self._edited(outline.move(text, path, own, index - 1), (*own, index - 1))
        elif what == "down":
            self._edited(outline.move(text, path, own, index + 1), (*own, index + 1))
        elif what == "out" and len(own) > 1:
            above = next(path[:n] for n in range(len(own) - 1, 0, -1) if isinstance(path[n - 1], int))
            self._edited(outline.move(text, path, above[:-1], int(above[-1]) + 1), (*above[:-1], int(above[-1]) + 1))
        elif what == "in" and index > 0:
            within = [each for each in outline.list_paths(text) if each[: len(path)] == (*own, index - 1)]
            if within:
                self._edited(outline.move(text, path, within[-1], 1_000), None)

    def _dropped(self, values: Mapping[str, Any]) -> None:
        to, place, path = _path(values["to"]) or (), values["place"], _path(values.get("path"))
        target, index = (to, 0) if place == "into" else (to[:-1], int(to[-1]) + (place == "behind"))
        if "pick" in values:
            step = self._examples[int(values["pick"])].text
            self._edited(outline.insert(self._text, target, index, step), (*target, index))
        elif path is not None:
            index -= target == path[:-1] and index > int(path[-1])
            self._edited(outline.move(self._text, path, target, index), None)

    def _insert_behind(self, path: KeyPath | None, *steps: str) -> None:
        """Inserts steps behind the step at `path`, or at the end of the mission."""
        text, number = self._text, 0
        if not text.strip():
            text = f"name: {self._file.name.removesuffix('.yaml').replace('_', ' ')}\nsteps: []\n"
        target, index = (_STEPS, 10_000) if path is None else (path[:-1], int(path[-1]) + 1)
        for number, step in enumerate(steps):
            text = outline.insert(text, target, index + number, step)
        self._edited(text, None if path is None else (*target, index + number))

    def _edited(self, text: str, path: KeyPath | None) -> None:
        """Shows an edited text, and selects a step."""
        self._show(text)
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
        steps = _items(steps_to_yaml(meaning.all_steps))
        try:
            self._insert_behind(_path(path), *steps)
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


def _path(value: Any) -> KeyPath | None:
    """Reads a path that a browser sends."""
    if not isinstance(value, list) or not all(isinstance(each, str | int) for each in value):
        return None
    return tuple(value)


def _items(lines: tuple[str, ...]) -> list[str]:
    """Splits the lines of steps into the steps."""
    found = list[list[str]]()
    for line in lines:
        if line.startswith("- "):
            found.append([])
        found[-1].append(line)
    return ["\n".join(each) for each in found]
