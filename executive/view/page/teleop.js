"use strict";
// Driving by hand: held keys, held buttons and a gamepad, asked for again and again; the robot stops when that ends.
(() => {
  const { byId } = window.errand;
  const PERIOD_MS = 60, DEAD_ZONE = 0.12;
  const BUTTONS = [
    ["Body", [["w", "ahead"], ["s", "back"], ["a", "turn left"], ["d", "turn right"], ["q", "left"], ["e", "right"], ["+", "up"], ["-", "down"], [">", "look down"], ["<", "look up"]]],
    ["Hand", [["i", "ahead"], ["k", "back"], ["j", "left"], ["l", "right"], ["u", "up"], ["o", "down"], ["v", "open"], ["c", "close"]]],
    ["Hand turns", [["r", "roll +"], ["f", "roll −"], ["t", "pitch +"], ["g", "pitch −"], ["y", "yaw +"], ["h", "yaw −"]]],
    ["Joints", [..."123456"].flatMap((key, n) => [[key, `${key} +`], ["QWERTY"[n], `${key} −`]])],
  ];

  function stick(value) { return Math.abs(value) < DEAD_ZONE ? 0 : value; }

  class TeleopPanel {
    constructor(control) {
      this.control = control;
      this.held = new Map(); // what holds it (a key's code, a button's id) -> key
      this.keys = new Set();
      this.busy = this.asking = false;
      for (const [title, buttons] of BUTTONS) byId("teleop-keys").append(this.group(title, buttons));
      byId("teleop-save").addEventListener("submit", (event) => { event.preventDefault(); this.save(); });
      document.addEventListener("keydown", (event) => this.down(event));
      document.addEventListener("keyup", (event) => this.held.delete(event.code));
      for (const gone of ["blur", "pagehide"]) window.addEventListener(gone, () => this.held.clear());
      setInterval(() => this.ask(), PERIOD_MS);
    }

    group(title, buttons) {
      const group = document.createElement("fieldset"), legend = document.createElement("legend");
      legend.textContent = title;
      group.append(legend);
      for (const [key, text] of buttons) {
        const button = document.createElement("button"), mark = document.createElement("kbd");
        mark.textContent = key;
        button.type = "button";
        button.append(mark, ` ${text}`);
        button.addEventListener("pointerdown", (event) => { button.setPointerCapture(event.pointerId); this.held.set(`button ${key}`, key); });
        for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) button.addEventListener(end, () => this.held.delete(`button ${key}`));
        group.append(button);
      }
      return group;
    }

    draw(told, keys) {
      byId("teleop-panel").hidden = !this.allowed();
      document.querySelector("main").classList.toggle("by-hand", this.allowed());
      byId("tree-panel").hidden = this.allowed(); // nothing is run where the robot is driven by hand
      if (!told) return;
      this.keys = new Set(Object.keys(keys || {}));
      const [x, y, yaw] = told.base, joints = told.joints_rad.map((angle) => angle.toFixed(2)).join(" ");
      byId("teleop-told").textContent = told.note || `x ${x.toFixed(2)} y ${y.toFixed(2)} yaw ${yaw.toFixed(2)} · arm ${joints} · gripper ${told.opening.toFixed(2)}`;
      byId("teleop-told").classList.toggle("bad", Boolean(told.note));
    }

    // The latest picture of each camera, side by side.
    drawCameras(live, box, seen) {
      const order = ([about]) => (about === "camera/hand" ? "" : about); // the hand's picture comes first, and is the largest
      const found = Object.entries(live).filter(([about]) => about.startsWith("camera/")).sort((one, other) => order(one).localeCompare(order(other))), names = found.map(([about]) => about.split("/")[1]);
      if (names.join() !== box.dataset.names) {
        box.dataset.names = names.join();
        box.classList.add("several-cameras");
        box.replaceChildren(...names.map((name) => Object.assign(new Image(), { alt: `Camera ${name}`, title: name })));
        seen.textContent = names.join(", ");
      }
      found.forEach(([, { data, format }], n) => { const address = `data:image/${format};base64,${data}`; if (box.children[n].src !== address) box.children[n].src = address; });
    }

    allowed() { return this.control.actions.has("teleop"); }

    down(event) {
      const typing = event.target.closest("input, select, textarea");
      if (!this.allowed() || typing || event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
      if (event.key === " ") this.held.clear();
      else if (this.keys.has(event.key)) this.held.set(event.code, event.key);
      else return;
      event.preventDefault();
    }

    // Left stick: body; right stick and bumpers: hand; triggers: gripper. Standard mapping of the Gamepad API.
    axes() {
      const pad = [...(navigator.getGamepads ? navigator.getGamepads() : [])].find((each) => each && each.connected);
      if (!pad) return {};
      const pressed = (n) => (pad.buttons[n] ? pad.buttons[n].value : 0), [x = 0, y = 0, u = 0, v = 0] = pad.axes.map(stick);
      const all = { forward: -y, turn: -x, hand_x: -v, hand_y: -u, hand_z: pressed(5) - pressed(4), open: pressed(7) - pressed(6) };
      return Object.fromEntries(Object.entries(all).filter(([, value]) => value));
    }

    // One request at a time: where the server is gone or slow, the robot hears nothing and stops.
    async ask() {
      if (!this.allowed() || this.busy) return;
      const keys = [...new Set(this.held.values())], axes = this.axes();
      const wanted = keys.length > 0 || Object.keys(axes).length > 0;
      if (!wanted && !this.asking) return;
      this.asking = wanted;
      this.busy = true;
      await this.control.do("teleop", { keys, axes });
      this.busy = false;
    }

    async save() {
      if (await this.control.do("save_pose", { name: byId("teleop-name").value.trim() })) byId("teleop-name").value = "";
      byId("teleop-saved").textContent = byId("announced").textContent;
    }
  }

  window.errand.TeleopPanel = TeleopPanel;
})();
