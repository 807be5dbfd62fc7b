"use strict";
// What is shown of one robot, the buttons that are for it alone, and the missions that are given out among several.
(() => {
  const { LOOKS, TreePanel, StatePanel, CameraPanel, QuestionPanel, ModePanel, isOver, modeOf, missionOf, decisive, element, byId } = window.errand;
  const COLOURS = 6;

  // A robot's colour and dashes by its place among the names; the name always stands beside them.
  function colourOf(robots, name) { return `--robot-${Math.max(0, robots.indexOf(name)) % COLOURS}`; }

  // What a view says of one robot. Of a fleet's robot only the latest mission is shown.
  function viewOf(view, name) {
    const mine = (each) => each.robot === name, trees = view.trees.filter(mine), robot = view.robots.get(name);
    const own = trees.length ? `${trees[0].root.id.split("/")[0]}/` : "";
    return {
      ...view,
      trees: view.missions ? trees.slice(-1) : trees,
      outcomes: view.outcomes.filter(mine),
      robots: new Map(robot ? [[name, robot]] : []),
      detections: robot ? robot.detections : null,
      failures: new Map([...view.failures].filter(([id]) => id.startsWith(own))),
    };
  }

  class RobotPanel {
    // `parts` are the elements that it draws into. Without a name it is that of the only robot.
    constructor(parts, name, control, addressOf) {
      Object.assign(this, { parts, name, control });
      this.tree = new TreePanel(parts.tree, { follow: parts.follow, shown: parts.nodes, onBreakpoint: (node, wanted) => control.do(wanted ? "break" : "unbreak", { node }) });
      this.mode = new ModePanel(parts.mode, parts.why);
      this.state = new StatePanel(parts.state);
      this.camera = new CameraPanel(parts.camera, parts.seen, addressOf);
      this.questions = new QuestionPanel(parts.questions, (id, text) => (id === null ? control.answer(text, name) : control.do("answer", { id, text })));
    }

    // A panel made for one of several robots.
    static made(name, robots, control, addressOf) {
      const section = byId("robot-panel").content.firstElementChild.cloneNode(true), part = (cls) => section.querySelector(`.${cls}`);
      const parts = Object.fromEntries(["tree", "follow", "mode", "why", "nodes", "state", "camera", "seen", "questions", "doing", "mission", "pause", "cancel", "stop"].map((cls) => [cls, part(cls)]));
      const panel = new RobotPanel(parts, name, control, addressOf);
      Object.assign(panel, { section });
      section.setAttribute("aria-label", name);
      section.dataset.robot = name;
      part("robot-name").textContent = name;
      part("swatch").style.background = `var(${colourOf(robots, name)})`;
      parts.pause.addEventListener("click", () => control.do(panel.now.mode === "paused" ? "resume" : "pause", { robot: name }));
      parts.cancel.addEventListener("click", () => control.do("cancel", { robot: name }));
      parts.stop.addEventListener("click", () => control.do(panel.now.mode === "stopped" ? "release" : "stop", { robot: name }));
      for (const key of ["pause", "cancel", "stop"]) parts[key].setAttribute("aria-label", `${parts[key].textContent} ${name}`);
      return panel;
    }

    draw(store, whole, replaying) {
      const view = (this.view = this.name === null ? whole : viewOf(whole, this.name)), controlState = store.live.control || null;
      const tree = view.trees[view.trees.length - 1], over = view.outcomes.length > 0, progress = replaying || over ? null : this.progress(store, tree);
      const own = controlState && this.name !== null && !isOver(controlState) ? (controlState.robots || {})[this.name] || { mode: "ready" } : controlState;
      this.tree.progress = progress;
      this.tree.breakpoints = controlState && !isOver(controlState) && this.control.actions.has("break") ? new Set(controlState.breakpoints) : null;
      this.tree.at = controlState ? controlState.at : null;
      this.tree.decisive = decisive(store, view);
      this.state.draw(view);
      this.mode.draw(modeOf(replaying ? null : own, view), over, this.name || "");
      this.parts.doing.textContent = progress ? progress.message : "";
      this.questions.draw(controlState ? this.asked(store, controlState) : [], store.end);
      if (this.name !== null) this.drawOwn(controlState, own, tree, over);
      this.tree.draw(view, replaying ? view.t : store.end); // it scrolls, so all else has its place before
    }

    progress(store, tree) {
      const robots = (store.live.progress || {}).robots || {};
      return robots[this.name === null ? tree && tree.robot : this.name] || null;
    }

    // What the mission asks, and what the robot asks of a sentence, as long as it waits for the answer.
    asked(store, controlState) {
      const mine = (each) => this.name === null || each.robot === this.name;
      const back = Object.entries(store.live).filter(([about]) => about.split("/")[0] === "asked").map(([, { question }]) => question);
      const waits = (each) => each && !isOver(controlState) && this.control.actions.has("say") && each.until_s > store.end;
      const own = (each) => ({ ...each, id: null, default: null, options: each.options.length ? [...each.options, "never mind"] : [] });
      return [...controlState.questions, ...back.filter(waits).map(own)].filter(mine);
    }

    // The mission's name, and the buttons; what holds all robots is let go of above.
    drawOwn(controlState, own, tree, over) {
      const { parts } = this, mode = (this.now = own || { mode: "ready" }).mode, all = controlState && ["paused", "stepping", "stopped", "ended", "lost"].includes(controlState.mode);
      parts.mission.textContent = tree ? missionOf(tree.root).name : "nothing to do";
      parts.pause.querySelector("span").textContent = mode === "paused" ? "Go on" : "Pause";
      parts.pause.setAttribute("aria-pressed", mode === "paused");
      parts.stop.querySelector("span").textContent = mode === "stopped" ? "Release" : "Stop";
      parts.stop.setAttribute("aria-pressed", mode === "stopped");
      for (const key of ["pause", "cancel", "stop"]) {
        parts[key].hidden = !this.control.actions.has(key);
        parts[key].disabled = !controlState || isOver(controlState) || (all && key !== "cancel") || (over && key !== "stop");
      }
    }
  }

  // What was queued for a fleet: each mission, whose it is, and what came of it.
  class MissionsPanel {
    constructor(section, body) { Object.assign(this, { section, body, shown: "" }); }

    draw(missions, robots) {
      const key = JSON.stringify([missions, robots]);
      if (key === this.shown) return;
      this.shown = key;
      this.section.hidden = !missions;
      this.body.replaceChildren(...(missions || []).map((each) => this.row(each, robots)));
    }

    row({ id, sentence, robot, outcome, message, reassigned }, robots) {
      const look = { success: "success", cancelled: "cancelled", running: "running", queued: "idle" }[outcome] || "failure";
      const row = element("tr"), whose = element("td"), state = element("td", "state", `${LOOKS[look].symbol} ${outcome}`);
      row.dataset.look = look;
      row.title = message || "";
      if (robot) {
        const swatch = element("span", "swatch");
        swatch.style.background = `var(${colourOf(robots, robot)})`;
        whose.append(swatch, " ", robot);
      }
      row.append(element("td", "t", id), element("td", "what", sentence), whose, state, element("td", "", reassigned ? `reassigned ${reassigned} x` : ""));
      return row;
    }
  }

  Object.assign(window.errand, { RobotPanel, MissionsPanel, colourOf });
})();
