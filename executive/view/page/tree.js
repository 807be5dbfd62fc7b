"use strict";
// The tree as nested lists, for eyes, keyboard and screen readers.
(() => {
  const { LOOKS, lookOf } = window.errand;
  const SMALL = 45; // a tree of so many nodes is shown whole

  function element(tag, name, text) {
    const made = document.createElement(tag);
    if (name) made.className = name;
    if (text !== undefined) made.textContent = text;
    return made;
  }

  class TreePanel {
    constructor(root, { follow, onBreakpoint }) {
      this.root = root;
      this.follow = follow;
      this.onBreakpoint = onBreakpoint;
      this.nodes = new Map();
      this.drawn = [];
      this.breakpoints = null;
      this.decisive = null;
      root.addEventListener("keydown", (event) => this.key(event));
      follow.addEventListener("change", () => { this.forgetFolds(); this.redraw(); });
    }

    draw(view) {
      this.view = view;
      const roots = view.trees.map((tree) => tree.root).reverse(); // what was begun last is done first
      if (roots.length !== this.drawn.length || roots.some((root, n) => root !== this.drawn[n])) this.build(roots);
      this.redraw();
    }

    build(roots) {
      this.drawn = roots;
      this.nodes.clear();
      this.root.replaceChildren();
      for (const root of roots) {
        const list = element("ul");
        list.setAttribute("role", "tree");
        list.setAttribute("aria-label", root.name);
        list.append(this.item(root, null, 1));
        this.root.append(list);
      }
      const first = this.root.querySelector("li");
      if (first) first.tabIndex = 0;
    }

    item(node, parent, level) {
      const li = element("li");
      li.setAttribute("role", "treeitem");
      li.setAttribute("aria-level", level);
      li.tabIndex = -1;
      li.dataset.id = node.id;
      const row = element("div", node.children.length ? "row" : "row leaf"), fold = element("span", "fold"), symbol = element("span", "symbol");
      const name = element("span", "name"), note = element("span", "note"), bar = element("span", "bar");
      const dot = element("button", "dot");
      fold.setAttribute("aria-hidden", "true");
      symbol.setAttribute("aria-hidden", "true");
      if (node.type !== "skill") name.append(element("span", "kind", node.type));
      const count = element("span", "count");
      name.append(node.name, " ", count, note, bar);
      bar.append(element("i"));
      dot.type = "button";
      dot.tabIndex = -1;
      dot.title = "Pause before this node (b)";
      dot.setAttribute("aria-label", `Breakpoint at ${node.name}`);
      dot.hidden = true;
      row.title = node.source ? `${node.id}\n${node.source.file}:${node.source.line}` : node.id;
      row.append(fold, symbol, name, dot);
      li.append(row);
      const entry = { node, parent, li, row, fold, symbol, note, bar, dot, count, list: null, open: true, chosen: undefined, size: 0 };
      this.nodes.set(node.id, entry);
      if (node.children.length) {
        entry.list = element("ul");
        entry.list.setAttribute("role", "group");
        for (const child of node.children) entry.list.append(this.item(child, entry, level + 1));
        li.append(entry.list);
        entry.size = node.children.reduce((sum, child) => sum + 1 + this.nodes.get(child.id).size, 0);
      }
      row.addEventListener("click", (event) => {
        if (event.target === dot) return this.toggleBreakpoint(entry);
        this.focus(entry);
        if (entry.list) this.choose(entry, !entry.open);
      });
      return li;
    }

    // What decided a failure shows it, also when a retry has reset the node since.
    stateOf(id) { return (id === this.decisive && this.view.failures.get(id)) || this.view.states.get(id); }

    forgetFolds() { for (const entry of this.nodes.values()) entry.chosen = undefined; }

    choose(entry, open) { entry.chosen = open; this.redraw(); }

    // Open what runs, failed or was cancelled, and the first levels; fold the rest of a large tree.
    interesting(entry, whole) {
      let alive = ["running", "failure", "cancelled"].includes(lookOf(this.stateOf(entry.node.id)));
      let level = 0;
      for (let up = entry.parent; up; up = up.parent) level += 1;
      for (const child of entry.node.children) alive = this.interesting(this.nodes.get(child.id), whole) || alive;
      const wanted = whole || alive || level < 2 || !this.follow.checked;
      entry.open = entry.chosen === undefined ? wanted : entry.chosen;
      return alive;
    }

    redraw() {
      if (!this.view) return;
      for (const root of this.drawn) {
        const entry = this.nodes.get(root.id);
        this.interesting(entry, entry.size < SMALL);
      }
      for (const entry of this.nodes.values()) this.paint(entry);
      if (this.follow.checked) this.showRunning();
    }

    paint(entry) {
      const state = this.stateOf(entry.node.id), look = lookOf(state);
      const progress = this.progress && this.progress.node === entry.node.id && look === "running" ? this.progress : null;
      const note = this.noteOf(entry, state, progress), cause = (state && state.cause) || "";
      const done = progress && typeof progress.progress === "number" ? progress.progress : null;
      const stops = this.breakpoints ? this.breakpoints.has(entry.node.id) : null;
      const key = [look, cause, note, done, entry.open, stops, this.at === entry.node.id, this.decisive === entry.node.id].join("\u0001");
      if (entry.key === key) return;
      entry.key = key;
      entry.row.dataset.look = look;
      entry.symbol.textContent = LOOKS[look].symbol;
      entry.note.replaceChildren();
      if (cause) entry.note.append(element("b", "", cause), note ? ": " : "");
      entry.note.append(note);
      entry.bar.hidden = done === null;
      if (done !== null) entry.bar.firstChild.style.width = `${Math.round(100 * done)}%`;
      if (entry.list) {
        entry.list.hidden = !entry.open;
        entry.fold.textContent = entry.open ? "▾" : "▸";
        entry.li.setAttribute("aria-expanded", entry.open);
        entry.count.textContent = entry.open ? "" : `(${entry.size} nodes)`;
      }
      const said = [entry.node.type, entry.node.name, LOOKS[look].word, [cause, note].filter(Boolean).join(": ")];
      entry.li.setAttribute("aria-label", said.filter(Boolean).join(", "));
      entry.dot.hidden = !this.breakpoints;
      entry.dot.setAttribute("aria-pressed", Boolean(stops));
      entry.row.classList.toggle("at", this.at === entry.node.id);
      entry.row.classList.toggle("decisive", this.decisive === entry.node.id);
    }

    // The sentence, only where it is not a child's already.
    noteOf(entry, state, progress) {
      if (progress && progress.message) return progress.message;
      if (!state || !state.message) return "";
      const told = entry.node.children.some((child) => (this.stateOf(child.id) || {}).message === state.message);
      return told || !(state.cause || entry.node.children.length === 0) ? "" : state.message;
    }

    showRunning() {
      const running = [...this.nodes.values()].filter((entry) => entry.row.dataset.look === "running");
      const last = this.nodes.get(this.decisive) || running[running.length - 1];
      if (!last || this.followed === last || this.root.contains(document.activeElement)) return;
      this.followed = last;
      const box = this.root.getBoundingClientRect(), row = last.row.getBoundingClientRect();
      if (row.top < box.top + 20 || row.bottom > box.bottom - 20) this.root.scrollTop += row.top - box.top - box.height / 2;
    }

    // Unfold the way to a node and go there.
    goTo(id) {
      const entry = this.nodes.get(id);
      if (!entry) return;
      for (let up = entry; up; up = up.parent) up.chosen = true;
      this.redraw();
      this.focus(entry);
    }

    focus(entry) {
      const before = this.root.querySelector('li[tabindex="0"]');
      if (before) before.tabIndex = -1;
      entry.li.tabIndex = 0;
      entry.li.focus();
    }

    toggleBreakpoint(entry) {
      if (this.breakpoints) this.onBreakpoint(entry.node.id, !this.breakpoints.has(entry.node.id));
    }

    key(event) {
      const li = event.target.closest("li");
      if (!li || event.ctrlKey || event.metaKey || event.altKey) return;
      const entry = this.nodes.get(li.dataset.id);
      const seen = [...this.root.querySelectorAll("li")].filter((each) => each.offsetParent !== null);
      const go = (to) => to && this.focus(this.nodes.get(to.dataset.id));
      const actions = {
        ArrowDown: () => go(seen[seen.indexOf(li) + 1]),
        ArrowUp: () => go(seen[seen.indexOf(li) - 1]),
        Home: () => go(seen[0]),
        End: () => go(seen[seen.length - 1]),
        ArrowRight: () => entry.list && (entry.open ? go(entry.list.firstElementChild) : this.choose(entry, true)),
        ArrowLeft: () => (entry.list && entry.open ? this.choose(entry, false) : entry.parent && this.focus(entry.parent)),
        Enter: () => entry.list && this.choose(entry, !entry.open),
        b: () => this.toggleBreakpoint(entry),
      };
      if (actions[event.key]) {
        actions[event.key]();
        event.preventDefault();
        event.stopPropagation();
      }
    }
  }

  Object.assign(window.errand, { TreePanel, element });
})();
