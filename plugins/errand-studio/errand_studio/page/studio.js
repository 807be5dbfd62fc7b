"use strict";
// Clicks, keys and drags of the studio's panels become events for the server; a selected line is marked in all panels.
(() => {
  const studio = (window.studio = { line: 1, path: null, editor: null, edits: 0 });
  const send = (what, more = {}) => emitEvent("studio", { what, line: studio.line, path: studio.path, ...more });
  const all = (selector, within = document) => [...within.querySelectorAll(selector)];
  const rows = () => all(".outline li");
  const pathOf = (item) => JSON.parse(item.dataset.path);

  // The theme of the system, unless the user has chosen one.
  const system = matchMedia("(prefers-color-scheme: dark)");
  function theme(chosen) {
    if (chosen) localStorage.setItem("errand-theme", chosen);
    const dark = (localStorage.getItem("errand-theme") || (system.matches ? "dark" : "light")) === "dark";
    document.documentElement.dataset.theme = dark ? "dark" : "light";
    document.body?.classList.toggle("body--dark", dark);
    return dark;
  }
  theme();
  system.addEventListener("change", () => location.reload());
  studio.toggleTheme = () => {
    theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
    emitEvent("studio", { what: "theme", dark: theme() });
  };

  // The innermost step on a line, and everything that stands for it.
  const stepAt = (line) => rows().filter((row) => row.dataset.list === "0" && +row.dataset.line <= line && line <= +row.dataset.end).pop();
  function mark(line) {
    studio.line = line;
    const on = stepAt(line);
    studio.path = on ? pathOf(on) : null;
    all(".chosen[data-line]").forEach((each) => each.classList.remove("chosen"));
    if (!on) return;
    for (const each of all(`[data-line="${on.dataset.line}"]`)) if (each !== on && !each.closest(".outline")) each.classList.add("chosen");
    on.classList.add("chosen");
    rows().forEach((row) => { row.tabIndex = row === on ? 0 : -1; });
  }
  studio.mark = () => mark(studio.line);

  function goTo(line) {
    const view = studio.editor;
    if (view && line <= view.state.doc.lines) {
      const place = view.state.doc.line(line);
      view.dispatch({ selection: { anchor: place.from + (place.text.match(/^[\s-]*/)[0].length) }, scrollIntoView: true });
    }
    mark(line);
  }
  studio.goTo = goTo;

  studio.attach = async (id) => {
    const CM = await import("nicegui-codemirror");
    const find = () => getElement(id)?.editor;
    for (let tries = 0; !find() && tries < 100; tries++) await new Promise((done) => setTimeout(done, 50));
    const view = (studio.editor = find());
    if (!view) return;
    const source = async (context) => {
      const word = context.matchBefore(/[\w ]*/), line = context.state.doc.lineAt(context.pos);
      if (!context.explicit && !/[\w:,{[-] ?$/.test(line.text.slice(0, context.pos - line.from))) return null;
      const body = { text: context.state.doc.toString(), line: line.number, column: context.pos - line.from };
      const answer = await fetch("/complete", { method: "POST", body: JSON.stringify(body), headers: { "content-type": "application/json" } });
      const { from, options } = await answer.json();
      return options.length ? { from: line.from + from, options, validFor: /^[\w ]*$/ } : null;
    };
    view.dispatch({ effects: CM.StateEffect.appendConfig.of([
      CM.EditorView.updateListener.of((update) => {
        if (update.selectionSet || update.docChanged) mark(update.state.doc.lineAt(update.state.selection.main.head).number);
      }),
      CM.EditorState.languageData.of(() => [{ autocomplete: source }]),
    ]) });
    mark(1);
  };

  // A click on the number of a line sets a breakpoint at its step.
  document.addEventListener("click", (event) => {
    const gutter = event.target.closest(".cm-lineNumbers .cm-gutterElement");
    if (!gutter) return;
    const step = stepAt(+gutter.textContent);
    if (step) send("stop line", { at: +step.dataset.line });
  });

  document.addEventListener("click", (event) => {
    const on = event.target.closest("[data-stop],[data-fix],[data-pick],[data-file],[data-sort],[data-run],[data-mission],[data-do],[data-line]");
    if (!on) return;
    const data = on.dataset;
    if (data.stop) send("stop line", { at: +data.stop });
    else if (data.fix) send("fix", { number: +data.fix });
    else if (data.pick) send("pick", { number: +data.pick });
    else if (data.file) send("open", { name: data.file });
    else if (data.run && event.target.matches("input")) send("tick", { run: data.run, ticked: event.target.checked });
    else if (data.mission) send("mission", { name: data.mission });
    else if (data.do) send(data.do, { value: data.value });
    else if (data.line) {
      if (on.closest(".outline")) { on.focus(); studio.focused = on.dataset.path; }
      goTo(+data.line);
    }
  });

  document.addEventListener("mousedown", (event) => { if (!event.target.closest(".outline")) studio.focused = null; });
  document.addEventListener("keydown", (event) => {
    // While the server draws the outline again, its focused step is on no element.
    const last = event.target === document.body && rows().find((row) => row.dataset.path === studio.focused);
    const on = last || event.target.closest?.(".outline li, .messages li, .files li, .row, table.rows tr");
    if ((event.ctrlKey || event.metaKey) && event.key === "s") { event.preventDefault(); send("save"); return; }
    if ((event.ctrlKey || event.metaKey) && event.key === "Enter") { event.preventDefault(); send("run"); return; }
    if (!on || event.target.matches("button, input")) return;
    if (event.key === "Enter") { event.preventDefault(); on.click(); if (on.dataset.line) studio.editor?.focus(); return; }
    const outline = on.closest(".outline"), step = event.altKey || event.ctrlKey || event.metaKey;
    if (["ArrowUp", "ArrowDown"].includes(event.key) && !step) {
      const line = all("[tabindex]", on.closest("ul.outline, ol, ul.files, ul.tree, table")).filter((each) => each.offsetParent);
      const next = line[line.indexOf(on) + (event.key === "ArrowUp" ? -1 : 1)];
      if (next) { event.preventDefault(); next.focus(); if (outline) goTo(+next.dataset.line); }
      return;
    }
    if (event.key === "b" && on.matches(".row") && stepAt(+on.dataset.line)) send("stop line", { at: +stepAt(+on.dataset.line).dataset.line });
    if (!outline || on.dataset.list === "1") return;
    const keys = { Delete: "remove", d: "double", w: "wrap", b: "break", ArrowUp: "up", ArrowDown: "down", ArrowRight: "in", ArrowLeft: "out" };
    const what = keys[event.key];
    if (!what || (event.key.startsWith("Arrow") && !event.altKey)) return;
    event.preventDefault();
    if (Date.now() < studio.edits) return; // the outline is as it was before the last edit
    studio.edits = Date.now() + 1000;
    studio.focused = on.dataset.path;
    send(what === "break" ? "stop line" : what, { path: pathOf(on), at: +on.dataset.line });
  });

  // Steps and examples are dragged: before or behind a step, or to the start of a list.
  let dragged = null;
  document.addEventListener("dragstart", (event) => {
    const on = event.target.closest?.(".outline li, [data-pick]");
    if (!on) return;
    dragged = on.dataset.pick ? { pick: +on.dataset.pick } : { path: pathOf(on) };
    event.dataTransfer.setData("text/plain", on.textContent);
    event.dataTransfer.effectAllowed = "copyMove";
  });
  const clear = () => all(".before, .behind, .into").forEach((each) => each.classList.remove("before", "behind", "into"));
  document.addEventListener("dragover", (event) => {
    const on = event.target.closest?.(".outline li");
    clear();
    if (!on || !dragged) return;
    event.preventDefault();
    const box = on.getBoundingClientRect(), low = event.clientY > box.top + box.height / 2;
    on.classList.add(on.dataset.list === "1" ? "into" : low ? "behind" : "before");
  });
  document.addEventListener("drop", (event) => {
    const on = event.target.closest?.(".outline li");
    if (!on || !dragged) return;
    event.preventDefault();
    const to = pathOf(on), place = on.classList.contains("into") ? "into" : on.classList.contains("behind") ? "behind" : "before";
    send("drop", { ...dragged, to, place });
    clear();
    dragged = null;
  });
  document.addEventListener("dragend", () => { clear(); dragged = null; });
  studio.redrawn = () => { // after the server has drawn the outline again
    studio.edits = 0;
    studio.mark();
    const first = document.querySelector(".outline li.chosen") || rows()[0];
    if (first) first.tabIndex = 0;
    if (studio.focused && document.activeElement === document.body) rows().find((row) => row.dataset.path === studio.focused)?.focus();
  };
  studio.focus = (path) => { studio.focused = JSON.stringify(path); };
})();
