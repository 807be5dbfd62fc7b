"use strict";
// The header, the hand camera, the 3D scene, and questions.
(() => {
  const { LOOKS, lookOf, element } = window.errand;
  const LOW_CHARGE = 0.2;
  const SVG = "http://www.w3.org/2000/svg";
  const byId = (id) => document.getElementById(id);

  const MODES = {
    ready: ["idle", "ready"], running: ["running", "running"], paused: ["cancelled", "paused"],
    stepping: ["running", "stepping"], pausing: ["cancelled", "pausing"],
    "lease lost": ["failure", "lease lost"], stopped: ["failure", "stop button"], ended: ["idle", "ended"], lost: ["failure", "no connection"],
  };
  const MODE_SYMBOLS = { paused: "‖", pausing: "‖", stopped: "■", "lease lost": "!", lost: "!" };
  const estimate = (sigma_m) => (100 * sigma_m).toFixed(sigma_m < 0.02 ? 1 : 0);
  const STANDS_M_S = 0.05; // odometry of a standing robot is not quite still

  const isOver = (control) => control !== null && ["ended", "lost"].includes(control.mode);
  const moves = (view) => [...view.robots.values()].some((robot) => robot.state && robot.state.speed_m_s > STANDS_M_S);
  const OUTCOMES = { success: "success", failure: "failure", cancelled: "cancelled", error: "failure" };

  // What the pill says: the outcome when there is one, else the mode of the control, else what the tree says.
  function modeOf(control, view) {
    const outcome = view.outcomes[view.outcomes.length - 1];
    if (outcome) {
      const look = OUTCOMES[outcome.outcome] || "failure";
      return [look, LOOKS[look].symbol, outcome.outcome + (look === "failure" && outcome.cause ? ` (${outcome.cause})` : ""), outcome.message];
    }
    const mode = control && (control.mode === "paused" && moves(view) ? "pausing" : control.mode);
    if (mode && MODES[mode]) return [MODES[mode][0], MODE_SYMBOLS[mode] || LOOKS[MODES[mode][0]].symbol, MODES[mode][1], control.reason || ""];
    return view.trees.length ? ["running", "▶", "running", ""] : ["idle", "○", "waiting", ""];
  }

  // The same for several robots, of which each says more itself.
  function modeOfAll(control, view, robots) {
    const ended = robots.map((name) => view.outcomes.filter((each) => each.robot === name).pop()).filter(Boolean);
    if (ended.length < robots.length && (control && control.mode) !== "ended") return modeOf(control, { ...view, outcomes: [] });
    const bad = ended.filter((each) => each.outcome !== "success");
    const look = bad.length || !ended.length ? "failure" : "success", why = bad.map((each) => `${each.robot}: ${each.message}`).join("; ");
    return [look, LOOKS[look].symbol, bad.length ? `${ended.length - bad.length} of ${ended.length} did it` : "success", why];
  }

  // The mission's own node, whose path id has two parts; what watches over it stands above it.
  function missionOf(root) {
    if (root.id.split("/").length <= 2) return root;
    return root.children.map(missionOf).find((node) => node.id.split("/").length === 2) || root;
  }

  // The leaf that decided a failure: the one whose sentence the outcome tells first, or the last that failed.
  function decisive(store, view) {
    const outcome = view.outcomes[view.outcomes.length - 1];
    if (!outcome || outcome.outcome === "success" || outcome.outcome === "cancelled") return null;
    const placeOf = (message) => (message ? (outcome.message || "").indexOf(message) : -1);
    const failed = [...view.failures].filter(([id]) => (store.known.get(id) || {}).leaf).map(([id, { message, t }]) => ({ id, t, place: placeOf(message) }));
    const placed = failed.filter((each) => each.place >= 0);
    const [first] = (placed.length ? placed : failed).sort((one, other) => one.place - other.place || other.t - one.t);
    return first ? first.id : null;
  }

  // What an operator looks at first: what is held, the battery, how well the place is known, the speed.
  class StatePanel {
    constructor(box) { Object.assign(this, { box, shown: "" }); }

    draw(view) {
      const robots = [...view.robots].filter(([, robot]) => robot.state);
      const rows = robots.map(([name, robot]) => [name, this.facts(robot)]);
      const key = JSON.stringify(rows);
      if (key === this.shown) return;
      this.shown = key;
      this.box.replaceChildren(...rows.map(([name, facts]) => this.row(name, facts)));
    }

    facts({ held, state }) {
      const { charge, localised, position_sigma_m: sigma_m, speed_m_s: speed } = state;
      return [
        ["holds", held || "nothing", false],
        ["battery", `${Math.round(100 * charge)} %`, charge < LOW_CHARGE],
        ["place", localised ? `own estimate ±${estimate(sigma_m)} cm (1σ)` : "lost", !localised],
        ["speed", `${speed.toFixed(1)} m/s`, false],
        ...(state.faults && state.faults.length ? [["reports", state.faults.join(", "), true]] : []),
      ];
    }

    row(name, facts) {
      const list = element("dl", "facts");
      for (const [term, text, bad] of [["robot", name, false], ...facts]) {
        const pair = element("div", bad ? "bad" : "");
        pair.append(element("dt", "", term), element("dd", "", text));
        list.append(pair);
      }
      return list;
    }
  }

  class Header {
    // Where a robot is driven by hand, there is no run, and its map names the world.
    draw(store, view, replaying, map) {
      const tree = view.trees[view.trees.length - 1], several = store.robots.length > 1, driven = store.live.teleop;
      const mission = !tree ? (driven ? `${driven.robot}, by hand` : "Errand") : several ? store.robots.join(", ") : missionOf(tree.root).name;
      byId("title").textContent = tree && !several ? `${tree.robot}: ${mission}` : mission;
      document.title = tree ? `${mission} – Errand` : "Errand";
      byId("clock").textContent = `${(replaying ? view.t : store.end).toFixed(1)} s`;
      byId("late").textContent = view.late;
      const told = { world: (store.run || map || {}).world, seed: (store.run || {}).seed };
      for (const [id, value] of Object.entries(told)) {
        byId(id).textContent = value;
        byId(id).parentElement.hidden = value === undefined;
      }
    }
  }

  // What a robot, or all of them, do: a pill, and the sentence of a failure.
  class ModePanel {
    constructor(pill, why) { Object.assign(this, { pill, why }); }

    draw([look, symbol, text, why], over, who = "") {
      const [mark, words] = this.pill.children, failed = over && look === "failure";
      this.pill.dataset.look = look;
      this.pill.title = why;
      this.why.hidden = !failed;
      this.why.textContent = failed ? why : "";
      mark.textContent = symbol;
      if (words.textContent !== text) {
        words.textContent = text;
        byId("announced").textContent = [who, text, why].filter(Boolean).join(": ");
      }
    }
  }

  // At the end: what the robot claims, what the referee saw, and the way to the report.
  class VerdictPanel {
    constructor(box) { this.box = box; }

    draw(verdict, addressOf) {
      if (verdict === this.shown) return;
      this.shown = verdict;
      this.box.hidden = !verdict;
      if (!verdict) return;
      const link = Object.assign(element("a", "", "Report"), { href: addressOf(verdict.report), target: "_blank", hidden: !verdict.report });
      this.box.replaceChildren(...verdict.verdicts.map((each) => this.said(each)), link);
      byId("announced").textContent = verdict.verdicts.map(({ who, word }) => `${who}: ${word}`).join("; ");
    }

    said({ who, good, word, text }) {
      const look = good === null ? "idle" : good ? "success" : "failure", said = element("p", "verdict");
      said.dataset.look = look;
      said.append(element("span", "", `${who}: `), element("b", "", `${good === null ? "?" : LOOKS[look].symbol} ${word}`), ` ${text}`);
      return said;
    }
  }

  // The latest picture with its boxes.
  class CameraPanel {
    constructor(box, seen, addressOf) { Object.assign(this, { box, seen, addressOf, shown: undefined }); }

    draw(view) {
      const picture = view.detections;
      if (this.shown === picture || (picture && this.shown && picture.t === this.shown.t)) return;
      this.shown = picture;
      if (!picture) {
        this.seen.textContent = "";
        return this.box.replaceChildren(element("p", "nothing", "No picture yet."));
      }
      const width = picture.width || 640, height = picture.height || 480;
      const svg = document.createElementNS(SVG, "svg");
      svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
      svg.setAttribute("role", "img");
      const image = this.shape("image", { width, height, href: this.addressOf(picture.picture) });
      svg.append(image, ...picture.detections.flatMap((each) => this.boxed(each)));
      const names = picture.detections.map((each) => `${each.class_name} ${Math.round(100 * each.score)} %`);
      const said = picture.caption || (names.length ? names.join(", ") : "nothing found");
      svg.setAttribute("aria-label", `Picture of a camera at ${picture.t.toFixed(1)} s: ${said}`);
      this.seen.textContent = `${picture.t.toFixed(1)} s: ${said}`;
      this.box.replaceChildren(svg);
    }

    boxed({ box: [u0, v0, u1, v1], class_name: name }) {
      const place = { x: u0, y: v0, width: u1 - u0, height: v1 - v0, rx: 3 };
      const text = this.shape("text", { x: u0, y: Math.max(18, v0 - 7) });
      text.textContent = name;
      return [this.shape("rect", { ...place, class: "back" }), this.shape("rect", place), text];
    }

    shape(tag, attributes) {
      const made = document.createElementNS(SVG, tag);
      for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
      return made;
    }
  }

  // True where the browser draws 3D on the processor: a scene then takes the time that the rest of the page needs.
  function drawsSlowly() {
    const brush = document.createElement("canvas").getContext("webgl");
    const info = brush && brush.getExtension("WEBGL_debug_renderer_info");
    const name = brush ? brush.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : brush.RENDERER) : "none";
    return /swiftshader|llvmpipe|softpipe|software|none/i.test(name);
  }

  // The scene while it runs, or its recording, which follows the slider.
  const EASY_PERIOD_MS = 700, BESIDE_M = [-1.0, 3.1, 2.2]; // so high that it looks over a cut wall half a metre behind the robot

  class ScenePanel {
    constructor(box, follow) {
      Object.assign(this, { box, follow, address: null, recorded: false, before: null, frame: null, poses: null, due: null, ready: false, lost: false, period: drawsSlowly() ? EASY_PERIOD_MS : 0 });
      addEventListener("message", ({ source }) => { if (this.frame && source === this.frame.contentWindow) this.ready = true; });
    }

    show(address, recorded) {
      if (!address || address === this.address) return;
      this.address = address;
      this.recorded = recorded;
      this.put({ title: recorded ? "3D recording of the run" : "3D scene", src: address });
    }

    // The newest poses of a running scene; a browser without a GPU draws few of them.
    move(poses) {
      this.poses = poses;
      if (this.due === null) this.due = setTimeout(() => this.post(), this.period);
    }

    // The scene's frame has an origin of its own, which no address names.
    post() {
      clearTimeout(this.due);
      this.due = null;
      if (this.frame && this.poses && !this.recorded) this.frame.contentWindow.postMessage({ ...this.poses, follows: this.follow.checked }, "*");
    }

    // A recording that the page brings with it. As the frame's own text it has the page's origin, also in a page that
    // was opened as a file; by an address of its own it would have another there, and could not be made to follow.
    showText(text) {
      this.recorded = true;
      this.put({ title: "3D recording of the run", srcdoc: text });
    }

    put(properties) {
      const frame = Object.assign(element("iframe"), properties), loading = element("p", "nothing loading", "Loading the 3D scene …");
      frame.addEventListener("load", () => {
        if (this.lost) return this.leave();
        if (!this.recorded) { this.post(); loading.remove(); }
      });
      this.box.closest("section").hidden = false;
      this.box.replaceChildren(frame, loading);
      Object.assign(this, { frame, loading, before: null, ready: "srcdoc" in properties });
    }

    // The server is gone: a scene that has not come by then does not come, and the browser would show its own error page.
    leave() {
      this.lost = true;
      if (!this.frame || this.ready) return;
      this.frame = null;
      this.box.replaceChildren(element("p", "nothing", "The 3D scene is not there: the connection to Errand was lost while it loaded."));
    }

    // Show the recording at a time, with the camera beside a robot at a pose.
    seek(t, pose) {
      if (!this.recorded || !this.frame) return;
      try {
        const viewer = this.frame.contentWindow.viewer;
        const animator = viewer && viewer.animator;
        if (!animator || !animator.duration) return;
        this.loading.remove();
        this.ready = true;
        animator.pause();
        animator.seek(Math.min(t, animator.duration));
        this.goAlong(viewer, pose);
      } catch { /* the recording is not there yet */ }
    }

    // The camera keeps the side from which it was turned to look at the robot. The scene's y axis points up.
    goAlong(viewer, pose) {
      const { camera, controls } = viewer, wanted = this.follow.checked && pose;
      if (!wanted && !this.before) return;
      if (!wanted) {
        camera.position.copy(this.before.camera);
        controls.target.copy(this.before.target);
        this.before = null;
      } else {
        const aside = this.before ? camera.position.clone().sub(controls.target) : camera.position.clone().set(...BESIDE_M);
        this.before = this.before || { camera: camera.position.clone(), target: controls.target.clone() };
        controls.target.set(pose.x, 0.5, -pose.y);
        camera.position.copy(controls.target).add(aside);
      }
      controls.update();
      viewer.set_dirty();
    }
  }

  class QuestionPanel {
    constructor(box, onAnswer) { Object.assign(this, { box, onAnswer, shown: "" }); }

    draw(questions, now) {
      const key = JSON.stringify(questions.map((each) => [each.id, each.text]));
      if (key !== this.shown) {
        this.shown = key;
        this.box.replaceChildren(...questions.map((each) => this.card(each)));
        if (questions.length) byId("announced").textContent = questions[0].text;
      }
      [...this.box.querySelectorAll(".limit")].forEach((limit, n) => {
        const left = Math.max(0, Math.ceil(questions[n].until_s - now));
        limit.textContent = !questions[n].default ? `${left} s` : `${left} s, then “${questions[n].default}”`;
      });
    }

    card({ id, text, options, default: otherwise }) {
      const card = element("form", "question"), said = element("p", "", text);
      card.append(said);
      card.setAttribute("aria-label", text);
      if (options.length) {
        for (const option of options) {
          const button = element("button", "", option);
          button.type = "button";
          button.addEventListener("click", () => this.onAnswer(id, option));
          card.append(button);
        }
      } else {
        const input = element("input");
        input.type = "text";
        input.value = otherwise || "";
        input.setAttribute("aria-label", text);
        card.append(input, element("button", "", "Answer"));
        card.addEventListener("submit", () => this.onAnswer(id, input.value));
      }
      card.addEventListener("submit", (event) => event.preventDefault());
      card.append(element("span", "limit"));
      return card;
    }
  }

  Object.assign(window.errand, { Header, ModePanel, VerdictPanel, isOver, modeOf, modeOfAll, missionOf, StatePanel, decisive, CameraPanel, ScenePanel, QuestionPanel, byId });
})();
