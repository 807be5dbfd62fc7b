"use strict";
// What is known of the run: all messages in order, and what they amount to at any time.
(() => {
  const LOOKS = {
    idle: { symbol: "○", word: "not run" },
    running: { symbol: "▶", word: "running" },
    success: { symbol: "✓", word: "success" },
    skipped: { symbol: "⊘", word: "skipped" },
    failure: { symbol: "✗", word: "failure" },
    expected: { symbol: "–", word: "found nothing" },
    cancelled: { symbol: "⊘", word: "cancelled" },
  };
  const CHARGE_NOISE = 0.02, CHARGE_SHARE = 0.1; // a battery's reading wavers, its charge does not
  const BY_STATUS = { RUNNING: "running", SUCCESS: "success", FAILURE: "failure" };

  function lookOf(state) {
    if (!state) return "idle";
    return BY_STATUS[state.status] || (state.cause === "CANCELLED" ? "cancelled" : "idle");
  }

  function emptyView() {
    return { t: 0, trees: [], spans: new Map(), states: new Map(), failures: new Map(), robots: new Map(), outcomes: [], late: 0, detections: null, destinations: [], missions: null };
  }

  const LEFT = /, [\d.]+ m to go$/; // logged once, and soon wrong
  const lasting = (message) => (message || "").replace(LEFT, "");

  function robotOf(view, name) {
    if (!view.robots.has(name)) view.robots.set(name, { pose: null, trail: [], path: null, state: null, held: null, particles: [], seen: [], people: [], doors: [], reserved: null, detections: null });
    return view.robots.get(name);
  }

  const APPLY = {
    tree(view, data) {
      view.trees = view.trees.filter((tree) => tree.root.id !== data.root.id).concat([data]);
      view.outcomes = view.outcomes.filter((outcome) => outcome.robot !== data.robot); // it has something to do again
      const forget = (node) => { view.states.delete(node.id); view.failures.delete(node.id); node.children.forEach(forget); };
      forget(data.root);
    },
    transitions(view, data, t) {
      const state = { status: data.to, cause: data.cause, message: lasting(data.message), t };
      view.states.set(data.node, state);
      if (data.to === "FAILURE") view.failures.set(data.node, state); // it stays when a retry resets the node
      if (data.to === "SUCCESS") view.failures.delete(data.node);
      const span = view.spans.get(data.node);
      if (span && !span.over) Object.assign(span, { to: t, over: data.to !== "RUNNING" });
      else view.spans.set(data.node, { from: span ? span.from : t, to: t, over: data.to !== "RUNNING" });
    },
    activity(view, data) {
      const state = view.states.get(data.node);
      if (state && state.status === "RUNNING") view.states.set(data.node, { ...state, message: lasting(data.message) });
    },
    pose(view, data) {
      const robot = robotOf(view, data.robot), { position, orientation } = data.pose;
      robot.pose = { x: position.x, y: position.y, yaw: 2 * Math.atan2(orientation.z, orientation.w) };
      robot.trail.push([position.x, position.y]);
    },
    // What is held is what was found last; it is no longer where it was found.
    state(view, data) {
      const robot = robotOf(view, data.robot), own = view.destinations.filter((each) => !each.robot || each.robot === data.robot);
      const found = own[own.length - 1];
      if (!data.holding) robot.held = null;
      else if (!robot.held) robot.held = found ? found.name : "something";
      if (robot.held) view.destinations = view.destinations.filter((each) => each.name !== robot.held);
      const before = robot.state ? robot.state.charge : data.charge, smooth = Math.abs(data.charge - before) < CHARGE_NOISE ? before + CHARGE_SHARE * (data.charge - before) : data.charge;
      robot.state = { ...data, charge: smooth };
    },
    people(view, data) { robotOf(view, data.robot).people = data.people.map((each) => each.position_W); },
    path(view, data) {
      robotOf(view, data.robot).path = data.poses.map((pose) => [pose.position.x, pose.position.y]);
    },
    // What a robot has reserved; a turn says that it has the right of way against all who came later.
    reserved_path(view, data) { robotOf(view, data.robot).reserved = data.turn === null ? null : data.x.map((x, n) => [x, data.y[n]]); },
    missions(view, data) { view.missions = data.missions; },
    detections(view, data, t) {
      view.detections = { ...data, t };
      if (data.robot) robotOf(view, data.robot).detections = view.detections;
    },
    // A picture that a skill took: it has a caption, and no detections.
    pictures(view, data, t) { APPLY.detections(view, { ...data, detections: [] }, t); },
    object_destination(view, data) { view.destinations.push({ robot: data.robot, name: data.class_name, x: data.goal_x, y: data.goal_y }); },
    navigation(view, data) {
      const pairs = (xs, ys) => xs.map((x, n) => [x, ys[n]]);
      Object.assign(robotOf(view, data.robot), { particles: pairs(data.particle_x, data.particle_y), seen: pairs(data.seen_x, data.seen_y) });
    },
    doors(view, data) { robotOf(view, data.robot).doors = data.doors; },
    outcome(view, data) { view.outcomes.push(data); },
    wall(view, data) { view.late = data.overruns; },
  };

  class Store {
    constructor() {
      this.messages = [];
      this.end = 0;
      this.run = null;
      this.map = null;
      this.live = {};
      this.now = emptyView();
      this.known = new Map();
      this.robots = []; // their names, in order
    }

    // Take a message in: one of the log, or the newest word on something that is not logged.
    add(message) {
      if (message.live === "control") for (const mode of [message.data, ...Object.values(message.data.robots)]) mode.reason = this.titled(mode.reason);
      if (message.live) { this.live[message.live] = message.data; return; }
      this.messages.push(message);
      this.end = Math.max(this.end, message.t);
      if (message.topic === "run") this.meet(Object.keys((this.run = message.data).robots || {}));
      if (message.topic === "tree" || message.topic === "pose") this.meet([message.data.robot]);
      if (message.topic === "map") this.map = message.data;
      if (message.topic === "tree") this.learn(message.data.root, 0, null);
      if (message.topic === "transitions") this.leaveToChild(message);
      this.apply(this.now, message);
    }

    meet(names) {
      if (names.some((name) => !this.robots.includes(name))) this.robots = [...new Set([...this.robots, ...names])].sort();
    }

    learn(node, depth, parent) {
      this.known.set(node.id, { name: node.title || node.name, kind: node.type, leaf: node.children.length === 0, depth, parent, began: null });
      node.children.forEach((child) => this.learn(child, depth + 1, node.id));
    }

    // A node that begins repeats the sentence with which its child begins: it stands at the child alone, which goes on.
    leaveToChild({ data, t }) {
      const known = this.known.get(data.node);
      if (!known || data.to !== "RUNNING") return;
      known.began = { data, t };
      for (let up = this.known.get(known.parent); up; up = this.known.get(up.parent)) {
        if (!up.began || up.began.t !== t || up.began.data.message !== data.message) return;
        const state = this.now.states.get(up.began.data.node);
        up.began.data.message = "";
        if (state && state.t === t) state.message = "";
      }
    }

    // Nodes by their titles, where a text names them by their path ids.
    titled(text) { return text.replace(/[^\s:'"(]+\/[^\s:'",;)]+/g, (id) => (this.known.has(id) ? `“${this.known.get(id).name}”` : id)); }

    apply(view, message) {
      const apply = APPLY[message.topic];
      if (apply) apply(view, message.data, message.t);
      view.t = message.t;
    }

    // The view at a time; what was logged at that time is in it.
    at(t) {
      const view = emptyView();
      for (const message of this.messages) {
        if (message.t > t + 1e-6) break;
        this.apply(view, message);
      }
      view.t = t;
      return view;
    }
  }

  window.errand = { LOOKS, lookOf, Store };
})();
