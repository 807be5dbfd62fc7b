"use strict";
// Puts the page together: messages come from the server while a run is under way, or stand in the page itself.
(() => {
  const { Store, TreePanel, MapPanel, Header, StatePanel, StepsPanel, decisive, CameraPanel, ScenePanel, QuestionPanel, EventPanel, Timeline, ControlPanel, TeleopPanel, drawsSlowly, byId } = window.errand;
  const recorded = byId("recorded") ? JSON.parse(byId("recorded").textContent) : null;
  const token = new URLSearchParams(location.search).get("token") || "";
  const store = new Store();

  function addressOf(picture) {
    if (recorded) return recorded.pictures[picture];
    return `picture/${picture}?token=${encodeURIComponent(token)}`;
  }

  const control = new ControlPanel(token);
  const teleop = new TeleopPanel(control);
  const header = new Header();
  const tree = new TreePanel(byId("tree"), {
    follow: byId("follow"),
    onBreakpoint: (node, wanted) => control.do(wanted ? "break" : "unbreak", { node }),
  });
  const state = new StatePanel(byId("state"));
  const steps = new StepsPanel(byId("steps"), (node) => tree.goTo(node));
  const map = new MapPanel(byId("map"), byId("where"));
  const camera = new CameraPanel(byId("camera"), byId("seen"), addressOf);
  const scene = new ScenePanel(byId("scene"), byId("beside"));
  const questions = new QuestionPanel(byId("questions"), (id, text) => (id === null ? control.answer(text) : control.do("answer", { id, text })));
  const timeline = new Timeline(store, () => schedule());
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

  // The tree follows at once; what costs more is drawn a few times a second.
  function draw() {
    const replaying = !timeline.following;
    const view = replaying ? store.at(timeline.t) : store.now;
    const told = store.live.control || null;
    tree.progress = replaying ? null : store.live.progress;
    tree.breakpoints = told && told.mode !== "ended" && control.actions.has("break") ? new Set(told.breakpoints) : null;
    tree.at = told ? told.at : null;
    tree.decisive = decisive(store, view);
    steps.draw(store, view, replaying ? view.t : store.end);
    state.draw(view);
    header.draw(store, view, replaying);
    tree.draw(view); // it scrolls, so all else has its place before
    teleop.draw(store.live.teleop, store.live.teleop_keys);
    control.draw(told, store.now.outcomes.length > 0);
    questions.draw(told ? [...told.questions, ...askedBack(told)] : [], store.end);
    measure();
    slowly(view);
  }

  // What the robot asks of a sentence, as long as it waits for the answer.
  function askedBack(state) {
    const asked = (store.live.asked || {}).question;
    const waits = asked && state.mode !== "ended" && control.actions.has("say") && asked.until_s > store.end;
    return waits ? [{ ...asked, id: null, default: null, options: asked.options.length ? [...asked.options, "never mind"] : [] }] : [];
  }

  function seekScene() {
    const [robot] = latest ? latest.robots.values() : [];
    scene.seek(timeline.t, robot && robot.pose);
  }

  byId("beside").addEventListener("change", () => {
    if (control.actions.has("follow")) control.do("follow", { wanted: byId("beside").checked });
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
      map.draw(latest);
      camera.draw(latest);
      events.draw(timeline.t, timeline.following);
      timeline.drawMarks();
      seekScene();
    }, Math.max(20, SLOW_MS - (performance.now() - drawn)));
  }

  function take(messages) {
    for (const message of messages) {
      store.add(message);
      if (greeted && message.topic === "transitions") fresh.push(message.sent_ms);
      if (greeted && message.topic === "speech") control.hear(message.data.robot, message.data.text);
      if (message.topic === "map") map.setMap(message.data, addressOf(message.data.picture)).catch(() => {});
      if (message.live === "hello") greet(message.data);
      if (message.live === "recording" && message.data.address) {
        byId("camera-follows").hidden = false;
        scene.show(`${message.data.address}?token=${encodeURIComponent(token)}`, true);
      }
      if (message.live === "progress") store.end = Math.max(store.end, message.data.now_s);
    }
    timeline.grow();
    schedule();
  }

  function greet({ actions, scene: address, recording }) {
    control.allow(actions);
    timeline.setLive(actions.length > 0);
    if (recording) scene.show(`${recording}?token=${encodeURIComponent(token)}`, true);
    else scene.show(address, false);
    byId("camera-follows").hidden = !(address || recording);
    if (control.actions.has("follow")) control.do("follow", { wanted: byId("beside").checked });
    if (control.actions.has("ease") && drawsSlowly()) control.do("ease");
  }

  function connect() {
    const socket = new WebSocket(`ws://${location.host}/feed?token=${encodeURIComponent(token)}`);
    let batches = 0;
    socket.addEventListener("message", (event) => {
      take(JSON.parse(event.data));
      batches += 1;
      greeted = batches > 1; // the first ones tell what was before the page was opened
    });
    socket.addEventListener("close", () => {
      store.live.control = store.live.control ? { ...store.live.control, mode: "ended", questions: [] } : null;
      byId("announced").textContent = "errand has ended; the page shows what happened.";
      schedule();
    });
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
  window.errand.page = { store, timeline, delays };
})();
