"use strict";
// Puts the page together: messages come from the server while a run is under way, or stand in the page itself.
(() => {
  const { Store, MapPanel, Header, ModePanel, VerdictPanel, isOver, modeOfAll, ScenePanel, EventPanel, Timeline, ControlPanel, TeleopPanel, RobotPanel, MissionsPanel, PlotsPanel, byId } = window.errand;
  const recorded = byId("recorded") ? JSON.parse(byId("recorded").textContent) : null;
  const token = new URLSearchParams(location.search).get("token") || "";
  const feedAddress = `ws://${location.host}/feed?token=${encodeURIComponent(token)}`, GOING_AWAY = 1001, AGAIN_MS = 2000;
  const store = new Store();

  function addressOf(picture) {
    if (recorded) return recorded.pictures[picture];
    return `picture/${picture}?token=${encodeURIComponent(token)}`;
  }

  const fileOf = (name) => `file/${encodeURIComponent(token)}/${name}`; // a path, so that a file's links find the others

  const control = new ControlPanel(token);
  const teleop = new TeleopPanel(control), verdicts = new VerdictPanel(byId("verdicts"));
  const header = new Header();
  const parts = Object.fromEntries(["tree", "follow", "nodes", "mode", "why", "state", "camera", "seen", "questions", "doing"].map((id) => [id, byId(id)]));
  const one = new RobotPanel(parts, null, control, addressOf), all = new ModePanel(parts.mode, parts.why);
  const panels = new Map(); // of each robot, where there are several
  const missions = new MissionsPanel(byId("missions-panel"), byId("missions"));
  const map = new MapPanel(byId("map"), byId("where"), byId("legend"));
  const scene = new ScenePanel(byId("scene"), byId("beside"));
  const timeline = new Timeline(store, () => schedule());
  const plots = new PlotsPanel(byId("plots-panel"), () => schedule());
  const events = new EventPanel(byId("events"), byId("events-shown"), store, (t) => { timeline.hold(); timeline.go(t); });

  const delays = []; // ms from a change of a node to its pixels, the latest ones
  let fresh = [], greeted = false;
  function measure() {
    const shown = fresh;
    fresh = [];
    if (shown.length) requestAnimationFrame(() => setTimeout(() => {
      delays.push(...shown.map((sent) => Date.now() - sent));
      delays.splice(0, delays.length - 500);
    }));
  }

  let planned = false;
  function schedule() {
    if (planned) return;
    planned = true;
    requestAnimationFrame(() => { planned = false; draw(); });
  }

  // A panel for each robot as soon as there are several.
  function meet(robots) {
    if (robots.length < 2 || robots.length === panels.size) return;
    panels.clear();
    for (const name of robots) panels.set(name, RobotPanel.made(name, robots, control, addressOf));
    byId("robots").replaceChildren(...[...panels.values()].map((panel) => panel.section));
    document.querySelector("main").classList.add("several");
    for (const id of ["tree-panel", "camera-panel", "state", "questions"]) byId(id).classList.add("of-one");
    byId("camera-follows").lastChild.textContent = ` follow ${robots[0]}`;
  }

  // The tree follows at once; what costs more is drawn a few times a second.
  function draw() {
    const replaying = !timeline.following, view = replaying ? store.at(timeline.t) : store.now, controlState = store.live.control || null;
    meet(store.robots);
    control.meet(store.robots);
    header.draw(store, view, replaying, map.map);
    teleop.draw(store.live.teleop, store.live.teleop_keys);
    control.draw(controlState, !panels.size && store.now.outcomes.length > 0);
    verdicts.draw(replaying ? null : store.live.verdict, fileOf);
    if (panels.size) all.draw(modeOfAll(replaying ? null : controlState, view, store.robots), true);
    for (const panel of shown()) panel.draw(store, view, replaying);
    measure();
    slowly(view);
  }

  function shown() { return panels.size ? panels.values() : [one]; }

  function seekScene() {
    const [robot] = latest ? latest.robots.values() : [];
    scene.seek(timeline.t, robot && robot.pose);
  }

  byId("beside").addEventListener("change", () => {
    scene.post();
    seekScene();
  });

  const SLOW_MS = 150;
  let drawn = 0, due = null, latest = null;
  function slowly(view) {
    latest = view;
    if (due !== null) return;
    due = setTimeout(() => {
      due = null;
      drawn = performance.now();
      map.draw(latest, store.robots);
      missions.draw(latest.missions, store.robots);
      if (teleop.allowed()) teleop.drawCameras(store.live, parts.camera, parts.seen);
      else for (const panel of shown()) panel.camera.draw(panel.view);
      events.draw(timeline.t, timeline.following);
      timeline.drawMarks();
      plots.draw(store.robots, timeline.t, store.end);
      seekScene();
    }, Math.max(20, SLOW_MS - (performance.now() - drawn)));
  }

  function take(messages) {
    for (const message of messages) {
      store.add(message);
      plots.take(message);
      if (greeted && message.topic === "transitions") fresh.push(message.sent_ms);
      if (greeted && message.topic === "speech") control.hear(message.data.robot, message.data.text);
      if (message.topic === "map") map.setMap(message.data, addressOf(message.data.picture)).catch(() => {});
      if (message.live === "scene") scene.move(message.data);
      if (message.live === "hello") greet(message.data);
      if (message.live === "recording" && message.data.address) {
        byId("camera-follows").hidden = false;
        scene.show(fileOf(message.data.address), true);
      }
      if (message.live === "progress" || message.live === "teleop") store.end = Math.max(store.end, message.data.now_s);
    }
    timeline.grow();
    schedule();
  }

  function greet({ actions, scene: shown, recording }) {
    control.allow(actions);
    timeline.setLive(actions.length > 0);
    if (recording) scene.show(fileOf(recording), true);
    else if (shown) scene.show(`scene?token=${encodeURIComponent(token)}`, false);
    byId("camera-follows").hidden = !(shown || recording);
  }

  function connect() {
    const socket = new WebSocket(feedAddress);
    let batches = 0;
    socket.addEventListener("message", (event) => {
      take(JSON.parse(event.data));
      batches += 1;
      greeted = batches > 1; // the first ones tell what was before the page was opened
    });
    socket.addEventListener("close", ({ code }) => leave(code === GOING_AWAY));
  }

  // The server says when it ends. Where it says nothing, nobody knows what the robot does, and the page asks again.
  function leave(ended) {
    const mode = ended ? "ended" : "lost", seen = `what is shown is as of ${store.end.toFixed(1)} s`, control = store.live.control;
    const over = !control || isOver(control) || (store.robots.length > 0 && store.robots.every((name) => store.now.outcomes.some((each) => each.robot === name)));
    scene.leave();
    if (store.live.control && !isOver(store.live.control)) store.live.control = { ...store.live.control, mode, reason: "", robots: {}, questions: [], breakpoints: [] };
    byId("connection").hidden = false;
    byId("connection").dataset.look = ended ? "idle" : "failure";
    byId("connection").textContent = ended ? "Errand has ended; the page shows what happened." : `The connection to Errand is lost: ${seen}. ${over ? "" : "The robot may still move. "}Trying again …`;
    if (!ended) setTimeout(reach, AGAIN_MS);
    schedule();
  }

  // All is loaded anew as soon as the server answers.
  function reach() {
    const socket = new WebSocket(feedAddress);
    socket.addEventListener("open", () => location.reload());
    socket.addEventListener("error", () => setTimeout(reach, AGAIN_MS));
  }

  function setTheme(theme) {
    document.documentElement.dataset.theme = theme;
    map.recolour();
    schedule();
  }

  const dark = matchMedia("(prefers-color-scheme: dark)");
  let chosen = null;
  try { chosen = localStorage.getItem("errand-theme"); } catch { /* not kept, then */ }
  setTheme(chosen || (dark.matches ? "dark" : "light"));
  dark.addEventListener("change", () => { if (!chosen) setTheme(dark.matches ? "dark" : "light"); });
  byId("theme").addEventListener("click", () => {
    chosen = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    try { localStorage.setItem("errand-theme", chosen); } catch { /* not kept, then */ }
    setTheme(chosen);
  });
  document.addEventListener("keydown", (event) => {
    if (event.key === " " && event.target === document.body && !event.defaultPrevented) { timeline.toggle(); event.preventDefault(); }
  });

  if (recorded) {
    take(recorded.messages);
    byId("camera-follows").hidden = !recorded.scene;
    if (recorded.scene) scene.showText(recorded.scene);
    timeline.go(timeline.store.end);
  } else {
    connect();
  }
  // A recording that loads when all else is drawn follows, too, and shows textures that come still later.
  setInterval(seekScene, 500);
  window.errand.page = { store, timeline, delays, map, plots, scene };
})();
