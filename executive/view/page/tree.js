"use strict";
// The tree as nested lists, for eyes, keyboard and screen readers: the steps of the mission as its author wrote them,
// each with its policy in one row, and of the nodes that carry them out those that run or failed.
(() => {
  const { LOOKS, lookOf } = window.errand, SEEKERS = ["detect", "find_people"];

  function element(tag, name, text) {
    const made = document.createElement(tag);
    if (name) made.className = name;
    if (text !== undefined) made.textContent = text;
    return made;
  }

  // The nodes that share a node's row: `row` is that of the first, and null for the others. Older logs have no rows.
  function sharedRow(node) {
    const chain = [node];
    for (let next = node; next; ) {
      next = next.children.find((child) => child.row === null);
      if (next) chain.push(next);
    }
    return chain;
  }

  // The expected failures, by the rule of `executive.tree.node_view`; returns whether the node is one, null if it did not fail.
  function findExpected(node, states, inside, found) {
    const state = states.get(node.id), look = lookOf(state), failed = look === "failure";
    const here = look === "success" || (look === "running" && node.type === "selector") || (inside && failed && !node.step);
    const below = node.children.map((child) => findExpected(child, states, here, found)).filter((each) => each !== null);
    const none = failed && SEEKERS.includes(node.name) && state.cause === "POSTCONDITION";
    const expected = failed && here && (none || (below.length > 0 && below.every(Boolean)));
    if (expected) found.add(node.id);
    return failed ? expected : null;
  }

  class TreePanel {
    constructor(root, { follow, shown, onBreakpoint }) {
      this.root = root;
      this.follow = follow;
      this.shown = shown;
      this.onBreakpoint = onBreakpoint;
      this.nodes = new Map();
      this.drawn = [];
      this.breakpoints = null;
      this.decisive = null;
      root.addEventListener("keydown", (event) => this.key(event));
      for (const each of [follow, shown]) each.addEventListener("change", () => { this.forgetFolds(); this.redraw(); });
    }

    draw(view, now) {
      Object.assign(this, { view, now });
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

    item(first, parent, level) {
      const chain = sharedRow(first), node = chain[chain.length - 1], children = chain.flatMap((each) => each.children.filter((child) => !chain.includes(child)));
      const { kind, name: title, policy, step } = first.row || { kind: node.type, name: node.name, policy: "", step: level <= 3 };
      const li = element("li");
      li.setAttribute("role", "treeitem");
      li.setAttribute("aria-level", level);
      li.tabIndex = -1;
      li.dataset.id = node.id;
      const row = element("div", children.length ? "row" : "row leaf"), fold = element("span", "fold"), symbol = element("span", "symbol");
      const name = element("span", "name"), note = element("span", "note"), bar = element("span", "bar");
      const dot = element("button", "dot");
      fold.setAttribute("aria-hidden", "true");
      symbol.setAttribute("aria-hidden", "true");
      if (!["skill", "step", "mission"].includes(kind)) name.append(element("span", "kind", kind));
      const count = element("span", "count"), took = element("span", "t");
      name.append(title, " ", ...(policy ? [element("span", "policy", policy), " "] : []), count, note, bar);
      bar.append(element("i"));
      dot.type = "button";
      dot.tabIndex = -1;
      dot.title = "Pause before this node (b)";
      dot.setAttribute("aria-label", `Breakpoint at ${title}`);
      dot.hidden = true;
      row.title = node.source ? `${title}\n${node.source.file.split("/").pop()}:${node.source.line}` : title;
      row.append(fold, symbol, name, took, dot);
      li.append(row);
      const entry = { node, chain, title, kind, step, parent, li, row, fold, symbol, note, bar, dot, count, took, list: null, children: [], open: true, chosen: undefined, size: chain.length };
      for (const each of chain) this.nodes.set(each.id, entry);
      if (children.length) {
        entry.list = element("ul");
        entry.list.setAttribute("role", "group");
        for (const child of children) entry.list.append(this.item(child, entry, level + 1));
        li.append(entry.list);
        entry.children = children.map((child) => this.nodes.get(child.id));
        entry.size += entry.children.reduce((sum, child) => sum + child.size, 0);
      }
      entry.authors = entry.children.some((child) => child.step);
      row.addEventListener("click", (event) => {
        if (event.target === dot) return this.toggleBreakpoint(entry);
        this.focus(entry);
        if (entry.list) this.choose(entry, !entry.open);
      });
      return li;
    }

    // What decided a failure shows it, also when a retry has reset the node since.
    stateOf(id) { return (id === this.decisive && this.view.failures.get(id)) || this.view.states.get(id); }

    // A row has the state of its first node, which may have skipped a failure; what decided a failure shows it.
    rowState({ chain }) {
      const [first] = chain;
      return this.stateOf((chain.find((each) => each.id === this.decisive) || first).id);
    }

    lookOf(entry) {
      const look = lookOf(this.rowState(entry)), expected = (each) => this.expected.has(each.id) && each.id !== this.decisive;
      if (look === "failure" && entry.chain.some(expected)) return "expected";
      const skipped = (each) => lookOf(this.stateOf(each.id)) === "failure" && !expected(each);
      return look === "success" && entry.chain.some(skipped) ? "skipped" : look;
    }

    forgetFolds() { for (const entry of this.nodes.values()) entry.chosen = undefined; }

    choose(entry, open) { entry.chosen = open; this.redraw(); }

    // Steps are open; what carries a step out is shown where it runs, failed or was cancelled, and where it is asked for.
    interesting(entry) {
      const whole = this.shown.value === "all";
      let alive = ["running", "failure", "cancelled"].includes(this.lookOf(entry)), seen = 0;
      for (const child of entry.children) {
        const lives = this.interesting(child);
        alive = alive || lives;
        child.li.hidden = !(whole || child.step || lives || entry.chosen === true);
        if (!child.li.hidden) seen += 1;
      }
      entry.open = entry.chosen === undefined ? seen > 0 : entry.chosen;
      return alive;
    }

    redraw() {
      if (!this.view) return;
      this.expected = new Set();
      for (const root of this.drawn) findExpected(root, this.view.states, false, this.expected);
      for (const root of this.drawn) this.interesting(this.nodes.get(root.id));
      for (const entry of this.nodes.values()) this.paint(entry);
      if (this.follow.checked) this.showRunning();
    }

    paint(entry) {
      const state = this.rowState(entry), look = this.lookOf(entry), has = (id) => entry.chain.some((each) => each.id === id);
      const progress = this.progress && has(this.progress.node) && look === "running" ? this.progress : null;
      const note = this.noteOf(entry, state, progress), cause = (look !== "expected" && state && state.cause) || "";
      const done = progress && typeof progress.progress === "number" ? progress.progress : null;
      const stops = this.breakpoints ? entry.chain.some((each) => this.breakpoints.has(each.id)) : null;
      const span = entry.step && look !== "idle" ? this.view.spans.get(entry.chain[0].id) : null;
      const took = span ? `${((span.over ? span.to : this.now) - span.from).toFixed(0)} s` : "";
      const key = [took, look, cause, note, done, entry.open, stops, has(this.at), has(this.decisive)].join("\u0001");
      if (entry.key === key) return;
      entry.key = key;
      entry.row.dataset.look = look;
      entry.symbol.textContent = LOOKS[look].symbol;
      entry.took.textContent = took;
      entry.note.replaceChildren();
      if (cause) entry.note.append(element("b", "", cause), note ? ": " : "");
      entry.note.append(note);
      entry.bar.hidden = done === null;
      if (done !== null) entry.bar.firstChild.style.width = `${Math.round(100 * done)}%`;
      if (entry.list) {
        entry.list.hidden = !entry.open;
        entry.fold.textContent = entry.open ? "▾" : "▸";
        entry.li.setAttribute("aria-expanded", entry.open);
        entry.count.textContent = entry.open ? "" : `(${entry.size - entry.chain.length} nodes)`;
      }
      const said = [entry.kind, entry.title, LOOKS[look].word, [cause, note].filter(Boolean).join(": ")];
      entry.li.setAttribute("aria-label", said.filter(Boolean).join(", "));
      entry.dot.hidden = !this.breakpoints;
      entry.dot.setAttribute("aria-pressed", Boolean(stops));
      entry.row.classList.toggle("at", has(this.at));
      entry.row.classList.toggle("decisive", has(this.decisive));
    }

    // The sentence, only where it is not a child's already.
    noteOf(entry, state, progress) {
      if (progress && progress.message) return progress.message;
      const inner = entry.chain.map((each) => this.stateOf(each.id)).reverse().find((each) => each && each.message);
      if (state && state.status === "RUNNING" && !entry.authors && inner) return inner.message;
      if (!state || !state.message) return "";
      const told = entry.children.some((child) => !child.li.hidden && (this.rowState(child) || {}).message === state.message);
      return told || !(state.cause || !entry.authors) ? "" : state.message;
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
      for (let up = entry.parent; up; up = up.parent) up.chosen = true;
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
      if (!this.breakpoints) return;
      const set = entry.chain.filter((each) => this.breakpoints.has(each.id));
      for (const each of set.length ? set : [entry.chain[0]]) this.onBreakpoint(each.id, !set.length);
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
        ArrowRight: () => entry.list && (entry.open ? go(seen[seen.indexOf(li) + 1]) : this.choose(entry, true)),
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
