"use strict";
// The slider: where in time the page looks; at its right end it follows what happens.
(() => {
  const { lookOf, byId } = window.errand;
  const PLAY = "M4 2.5l9 5.5-9 5.5z", HOLD = "M4 3h3v10H4zM9 3h3v10H9z";

  class Timeline {
    constructor(store, onMove) {
      Object.assign(this, { store, onMove, following: true, playing: null, t: 0 });
      this.slider = byId("slider");
      this.slider.addEventListener("input", () => {
        const wanted = Number(this.slider.value); // before `hold` shows the present time again
        this.hold();
        this.go(wanted);
      });
      byId("live").addEventListener("click", () => this.follow());
      byId("play").addEventListener("click", () => this.toggle());
      new ResizeObserver(() => this.drawMarks()).observe(byId("marks"));
    }

    // `live`: there is a run that may still go on.
    setLive(live) { byId("live").hidden = !live; }

    grow() {
      this.slider.max = this.store.end;
      if (this.following) this.t = this.store.end;
      this.show();
    }

    go(t) {
      this.t = Math.max(0, Math.min(t, this.store.end));
      this.following = false;
      this.show();
      this.onMove();
    }

    follow() {
      this.hold();
      this.following = true;
      this.t = this.store.end;
      this.show();
      this.onMove();
    }

    toggle() { if (this.playing) this.hold(); else this.play(); }

    play() {
      if (this.t >= this.store.end - 0.1) this.t = 0;
      let before = performance.now();
      this.following = false;
      this.playing = setInterval(() => {
        const now = performance.now(), passed = ((now - before) / 1000) * Number(byId("speed").value);
        before = now;
        if (this.t + passed >= this.store.end) this.hold();
        this.go(this.t + passed);
      }, 50);
      this.show();
    }

    hold() {
      clearInterval(this.playing);
      this.playing = null;
      this.show();
    }

    show() {
      this.slider.value = this.t;
      this.slider.setAttribute("aria-valuetext", `${this.t.toFixed(1)} seconds`);
      byId("at").textContent = `${this.t.toFixed(1)} s`;
      byId("live").setAttribute("aria-pressed", this.following);
      const play = byId("play");
      play.querySelector("path").setAttribute("d", this.playing ? HOLD : PLAY);
      play.setAttribute("aria-label", this.playing ? "Hold" : "Play");
    }

    // A mark for each leaf that ended: below the line, failures above it and larger.
    drawMarks() {
      const canvas = byId("marks"), { clientWidth: width, clientHeight: height } = canvas, ratio = window.devicePixelRatio || 1;
      if (!width) return;
      canvas.width = width * ratio;
      canvas.height = height * ratio;
      const brush = canvas.getContext("2d"), style = getComputedStyle(document.documentElement);
      brush.scale(ratio, ratio);
      for (const { topic, data, t } of this.store.messages) {
        if (topic !== "transitions" || !(this.store.known.get(data.node) || {}).leaf) continue;
        const look = lookOf({ status: data.to, cause: data.cause });
        if (look === "running" || look === "idle") continue;
        const u = 8 + (t / Math.max(this.store.end, 1e-6)) * (width - 16);
        brush.fillStyle = style.getPropertyValue(`--${look}`);
        if (look === "success") brush.fillRect(u - 0.75, height - 5, 1.5, 5);
        else brush.fillRect(u - 1.25, 0, 2.5, 7);
      }
    }
  }

  window.errand.Timeline = Timeline;
})();
