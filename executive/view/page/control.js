"use strict";
// The buttons, the sentence box and the keys; everything goes through one guarded request.
(() => {
  const { byId, isOver } = window.errand;

  class ControlPanel {
    constructor(token) {
      this.token = token;
      this.actions = new Set();
      this.state = null;
      byId("pause").addEventListener("click", () => this.do(this.state && this.state.mode === "paused" ? "resume" : "pause"));
      byId("step").addEventListener("click", () => this.do("step"));
      byId("cancel").addEventListener("click", () => this.do("cancel"));
      byId("stop").addEventListener("click", () => this.do(this.state && this.state.mode === "stopped" ? "release" : "stop"));
      byId("say").addEventListener("submit", (event) => { event.preventDefault(); this.say("say"); });
      byId("after").addEventListener("click", () => this.say("queue"));
      byId("add").addEventListener("submit", (event) => { event.preventDefault(); this.add(); });
      document.addEventListener("keydown", (event) => this.key(event));
    }

    allow(actions) {
      this.actions = new Set(actions);
      byId("controls").hidden = !this.actions.has("stop");
      for (const id of ["pause", "step", "cancel"]) byId(id).hidden = !this.actions.has(id);
      byId("say").hidden = !this.actions.has("say");
      byId("after").hidden = !this.actions.has("queue");
      byId("add").hidden = !this.actions.has("queue") || this.actions.has("say");
    }

    // A mission for a fleet. What came of it stays in sight until the next one is typed.
    async add() {
      const input = byId("mission"), added = byId("added"), text = input.value.trim();
      if (!text || this.adding) return;
      this.adding = true;
      added.classList.remove("bad");
      added.textContent = "checking it …";
      const { said, bad } = await this.ask("queue", { text });
      added.textContent = said;
      added.classList.toggle("bad", bad);
      if (!bad) input.value = "";
      this.adding = false;
    }

    async ask(name, values) {
      try {
        const answer = await fetch(`action/${name}`, {
          method: "POST",
          headers: { "Content-Type": "application/json", "X-Errand-Token": this.token },
          body: JSON.stringify(values),
        });
        const { said, error } = await answer.json();
        return { said: answer.ok ? said : error, bad: !answer.ok };
      } catch {
        return { said: "no answer from Errand: the connection may be lost", bad: true };
      }
    }

    async do(name, values = {}) {
      const { said, bad } = await this.ask(name, values);
      this.tell(said, bad);
      return !bad;
    }

    tell(text, bad) {
      if (text) byId("announced").textContent = text;
      if (bad || this.saying) {
        byId("said").textContent = text;
        byId("said").classList.toggle("bad", bad);
        clearTimeout(this.clearing);
        this.clearing = setTimeout(() => { byId("said").textContent = ""; }, bad ? 12000 : 6000);
      }
    }

    // What the robot says stays in sight for as long as people need to read it.
    hear(robot, text) {
      byId("announced").textContent = `${robot} says: ${text}`;
      byId("said").textContent = `${robot}: ${text}`;
      byId("said").classList.remove("bad");
      clearTimeout(this.clearing);
      this.clearing = setTimeout(() => { byId("said").textContent = ""; }, 6000 + 60 * text.length);
    }

    // The robots of the run: with several, a sentence is for one of them or says itself whom it is for.
    meet(robots) {
      const choice = byId("whom");
      choice.hidden = robots.length < 2;
      if (choice.hidden || choice.children.length === robots.length + 1) return;
      choice.replaceChildren(...["", ...robots].map((name) => Object.assign(document.createElement("option"), { value: name, textContent: name || "as said" })));
      for (const [id, title] of [["pause", "Pause all robots, or let them go on (p or space)"], ["cancel", "End all missions (c)"], ["stop", "Stop all robots at once (x)"]]) byId(id).title = title;
    }

    async answer(text, robot) {
      this.saying = true;
      if (await this.do("say", robot ? { text, robot } : { text })) byId("sentence").value = "";
      this.saying = false;
    }

    async say(action) {
      const input = byId("sentence"), text = input.value.trim();
      if (!text) return;
      this.saying = true;
      this.tell("…", false);
      const robot = byId("whom").value;
      if (await this.do(action, robot ? { text, robot } : { text })) input.value = "";
      this.saying = false;
    }

    drawButtons(names) {
      const key = JSON.stringify(names);
      if (key === this.shown) return;
      this.shown = key;
      byId("buttons").replaceChildren(...names.map((name) => {
        const button = document.createElement("button");
        button.type = "button";
        button.textContent = name;
        button.title = `The mission waits for this button, or decides by it`;
        button.addEventListener("click", () => this.do("press", { name }));
        return button;
      }));
    }

    draw(state, ended) {
      this.state = state;
      this.drawButtons(state ? state.buttons || [] : []);
      const mode = state ? state.mode : "ready", over = ended || isOver(state);
      const paused = mode === "paused", stopped = mode === "stopped";
      byId("pause").querySelector("span").textContent = paused ? "Go on" : "Pause";
      byId("pause").querySelector("path").setAttribute("d", paused ? "M4 2.5l9 5.5-9 5.5z" : "M4 3h3v10H4zM9 3h3v10H9z");
      byId("pause").setAttribute("aria-pressed", paused);
      byId("stop").querySelector("span").textContent = stopped ? "Release" : "Stop";
      byId("stop").setAttribute("aria-pressed", stopped);
      for (const id of ["pause", "step", "cancel", "stop"]) byId(id).disabled = over;
      for (const button of byId("buttons").children) button.disabled = over;
      byId("say").querySelector("[type=submit]").disabled = over;
      const more = byId("add").querySelector("button");
      more.disabled = byId("mission").hidden = over;
      more.textContent = over ? "The fleet has ended" : "Add mission";
    }

    key(event) {
      const typing = event.target.closest("input[type=text], select, textarea");
      if (typing || event.ctrlKey || event.metaKey || event.altKey || byId("controls").hidden) return;
      const button = { p: "pause", s: "step", c: "cancel", x: "stop", " ": event.target === document.body && "pause" }[event.key];
      if (button && !byId(button).disabled) {
        byId(button).click();
        event.preventDefault();
      }
    }
  }

  window.errand.ControlPanel = ControlPanel;
})();
