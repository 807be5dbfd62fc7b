"use strict";
// The list of what happened; an entry leads the slider to its time.
(() => {
  const { LOOKS, lookOf, element } = window.errand;
  const MOST = 600, QUESTION = /^(question|answer)/; // whose message begins with the question's id

  const TEXTS = {
    run: (data) => ["run", `world ${data.world}, seed ${data.seed}: ${(data.commands || []).join(" · ")}`],
    object_to_detect: (data) => ["look for", data.class_name.join(", ")],
    object_destination: (data) => ["found", data.class_name],
    missions: (data) => ["missions", data.missions.map((each) => `${each.id} ${each.robot || "no robot"}: ${each.outcome}`).join(", ")],
    speech: (data) => [`${data.robot} ${data.silent ? "shows" : "says"}`, `“${data.text}”`],
    errors: (data) => ["defect", (data.traceback || "").trim().split("\n").pop()],
    control: (data) => [`${data.what || "control"}${QUESTION.test(data.what) ? ":" : ""}`, QUESTION.test(data.what) ? (data.message || "").replace(/^\S+: /, "") : data.message || ""],
    question: (data) => ["question", data.text || data.message || ""],
  };

  class EventPanel {
    constructor(list, choice, store, onChoose) {
      Object.assign(this, { list, choice, store, onChoose, taken: 0, rows: [], reported: new Map() });
      choice.addEventListener("change", () => this.rebuild());
    }

    rebuild() {
      this.taken = 0;
      this.rows = [];
      this.reported.clear();
      this.wasFollowing = false;
      this.list.replaceChildren();
      this.draw(this.t, this.following);
    }

    entry({ topic, data, t }) {
      if (topic === "transitions") return this.change(data, t);
      if (topic === "activity") return this.change({ ...data, to: "RUNNING", cause: null }, t);
      if (topic === "outcome") {
        const look = data.outcome === "success" ? "success" : data.outcome === "cancelled" ? "cancelled" : "failure";
        return { t, look, what: `${data.robot}: ${data.outcome}`, why: [data.cause, data.message].filter(Boolean).join(": ") };
      }
      if (topic === "state") return this.faults(data, t);
      if (!TEXTS[topic] || this.choice.value === "failures") return null;
      const [what, why] = TEXTS[topic](data);
      return { t, look: topic === "errors" ? "failure" : "idle", symbol: "·", what: topic === "speech" ? what : this.whose(data) + what, why: this.store.titled(why) };
    }

    // A robot's own faults, when they have changed.
    faults(data, t) {
      const now = (data.faults || []).join(", "), before = this.reported.get(data.robot) || "";
      this.reported.set(data.robot, now);
      if (now === before) return null;
      return { t, look: now ? "failure" : "idle", symbol: now ? "!" : "·", what: `${data.robot} reports`, why: now || "no more faults" };
    }

    change(data, t) {
      const look = lookOf({ status: data.to, cause: data.cause }), known = this.store.known.get(data.node) || {};
      const failed = look === "failure" || look === "cancelled";
      if (this.choice.value === "failures" ? !failed : this.choice.value === "leaves" && !known.leaf) return null;
      if (look === "idle") return null;
      return { t, look, what: this.whose(data) + (known.name || data.node), why: [data.cause, data.message].filter(Boolean).join(": ") };
    }

    // Whose it is, where there are several robots.
    whose(data) { return this.store.robots.length > 1 && data.robot ? `${data.robot}: ` : ""; }

    draw(t, following) {
      this.t = t;
      this.following = following;
      for (; this.taken < this.store.messages.length; this.taken += 1) {
        const entry = this.entry(this.store.messages[this.taken]);
        if (entry) this.append(entry);
      }
      if (following && this.wasFollowing) return this.scroll(this.list.lastElementChild);
      this.wasFollowing = following;
      let now = null;
      for (const row of this.rows) {
        row.li.classList.toggle("later", row.t > t + 1e-6);
        row.li.classList.remove("now");
        if (row.t <= t + 1e-6) now = row.li;
      }
      if (!following && now) now.classList.add("now");
      this.scroll(following ? this.list.lastElementChild : now);
    }

    scroll(target) {
      if (target && target !== this.scrolled && !this.list.contains(document.activeElement)) {
        this.scrolled = target;
        this.list.scrollTop = target.offsetTop - this.list.offsetTop - this.list.clientHeight + target.clientHeight + 6;
      }
    }

    append({ t, look, symbol, what, why }) {
      const li = element("li"), button = element("button"), text = element("span", "what", what);
      li.dataset.look = look;
      button.type = "button";
      const mark = element("span", "symbol", symbol || LOOKS[look].symbol);
      mark.setAttribute("aria-label", symbol ? "" : LOOKS[look].word);
      if (why) text.append(" ", element("span", "why", why));
      button.append(element("span", "t", t.toFixed(1)), mark, text);
      button.addEventListener("click", () => this.onChoose(t));
      li.append(button);
      this.list.append(li);
      this.rows.push({ t, li });
      if (this.rows.length > MOST) this.rows.shift().li.remove();
    }
  }

  window.errand.EventPanel = EventPanel;
})();
