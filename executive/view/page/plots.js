"use strict";
// Values of the run over time: a small plot for each, with a line for each robot, up to the time of the slider.
(() => {
  const { colourOf, element, byId } = window.errand;
  const MOST_POINTS = 800; // of a line; old points are thinned to half of them
  const PLOTS = [ // `least` is the least end of the axis, so that noise about 0 fills no plot
    { key: "speed_m_s", title: "Speed", unit: "m/s", factor: 1, least: 0.5, digits: 2 },
    { key: "charge", title: "Battery", unit: "%", factor: 100, least: 100, digits: 0 },
    { key: "grip_n", title: "Force of the gripper", unit: "N", factor: 1, least: 10, digits: 0 },
    { key: "position_sigma_m", title: "Own estimate of the position (1σ)", unit: "cm", factor: 100, least: 5, digits: 1, error: "Position error (dashed: own estimate, 1σ)" },
    { key: "pace", title: "Real-time factor", unit: "", factor: 1, least: 2, digits: 1 },
  ];
  const DASHES = [3, 3], GUTTER_PX = 30, FOOT_PX = 14, HEAD_PX = 5;
  const WIDE_PX = 900, TALL_PX = 920; // a lower window of a desk begins with the plots folded

  // Half of the points: the larger value of each pair, and the latest one.
  function thinned(points) {
    const kept = [];
    for (let n = 0; n + 2 < points.length; n += 2) kept.push(points[n + 1][1] > points[n][1] ? points[n + 1] : points[n]);
    kept.push(points[points.length - 1]);
    return kept;
  }

  // Smallest of 1, 2 and 5 times a power of ten that is not less.
  function roundUp(value) {
    const power = 10 ** Math.floor(Math.log10(value));
    return [1, 2, 5, 10].map((factor) => factor * power).find((each) => each >= value * (1 - 1e-9));
  }

  // The lines of all plots, by plot and robot: points of time (s) and value.
  class Curves {
    constructor() { Object.assign(this, { lines: new Map([...PLOTS.map(({ key }) => key), "error_m"].map((key) => [key, new Map()])), before: null }); }

    take({ topic, data, t }) {
      if (topic === "truth") this.add("error_m", data.robot, t, 100 * data.error_m); // of a simulated run alone
      if (topic === "state") for (const { key, factor } of PLOTS) if (Number.isFinite(data[key])) this.add(key, data.robot, t, factor * data[key]);
      if (topic === "wall" && Number.isFinite(data.lasted_s)) this.takePace(t, data.lasted_s);
    }

    takePace(t, lasted) {
      const before = this.before;
      this.before = [t, lasted];
      if (before && lasted > before[1]) this.add("pace", "", t, (t - before[0]) / (lasted - before[1]));
    }

    add(key, robot, t, value) {
      const lines = this.lines.get(key), points = lines.get(robot) || [];
      points.push([t, value]);
      lines.set(robot, points.length > MOST_POINTS ? thinned(points) : points);
    }
  }

  // One plot: its title, the values at a time, and the lines.
  class Plot {
    constructor(kind) {
      this.kind = kind;
      this.box = element("figure", "plot");
      this.values = element("output", "values");
      this.canvas = Object.assign(element("canvas"), { role: "img", ariaLabel: kind.title });
      const head = element("figcaption");
      head.append((this.title = element("span")), this.values);
      this.box.append(head, this.canvas);
    }

    // Draws the lines, or the errors where they are known, with the lines dashed below.
    draw(curves, robots, t, end) {
      const style = getComputedStyle(document.documentElement), css = (name) => style.getPropertyValue(name).trim();
      const { kind } = this, own = curves.lines.get(kind.key), errors = kind.error && curves.lines.get("error_m"), known = errors && errors.size > 0;
      const styled = (lines, dashes) => [...lines].sort(([one], [other]) => (one < other ? -1 : 1)).map(([name, points]) => ({ name, points, dashes, colour: css(name ? colourOf(robots, name) : "--text") }));
      const solid = styled(known ? errors : own, []), drawn = [...(known ? styled(own, DASHES) : []), ...solid];
      this.write(known ? kind.error : kind.title, solid, t);
      const { clientWidth: width, clientHeight: height } = this.canvas, ratio = window.devicePixelRatio || 1;
      if (!width) return;
      this.canvas.width = width * ratio;
      this.canvas.height = height * ratio;
      const brush = this.canvas.getContext("2d"), most = roundUp(Math.max(kind.least, ...drawn.flatMap(({ points }) => points.map((point) => point[1]))));
      const bottom = height - FOOT_PX, u = (when) => GUTTER_PX + (when / Math.max(end, 1e-6)) * (width - GUTTER_PX - 4), v = (value) => bottom - (value / most) * (bottom - HEAD_PX);
      brush.scale(ratio, ratio);
      this.drawAxes(brush, { css, width, height, most, end, v });
      for (const { points, colour, dashes } of drawn) {
        const ahead = points.findIndex(([when]) => when > t + 1e-6), now = ahead < 0 ? points.length : ahead;
        const line = (some, alpha) => this.line(brush, some.map(([when, value]) => [u(when), v(value)]), colour, alpha, dashes);
        line(points.slice(0, now), 1);
        line(points.slice(Math.max(0, now - 1)), 0.3); // what comes after the time of the slider
      }
      if (t < end - 1e-6) this.line(brush, [[u(t), HEAD_PX], [u(t), bottom]], css("--dim"));
    }

    drawAxes(brush, { css, width, height, most, end, v }) {
      brush.font = `10px ${css("--font")}`;
      brush.fillStyle = css("--dim");
      brush.textBaseline = "middle";
      for (const value of [0, most / 2, most]) {
        this.line(brush, [[GUTTER_PX, v(value)], [width - 4, v(value)]], css("--edge"));
        brush.textAlign = "right";
        if (value !== most / 2) brush.fillText(String(Number(value.toPrecision(3))), GUTTER_PX - 5, v(value));
      }
      brush.fillText(`${end.toFixed(0)} s`, width - 4, height - 5);
      brush.textAlign = "left";
      brush.fillText("0 s", GUTTER_PX, height - 5);
    }

    line(brush, points, colour, alpha = 1, dashes = null) {
      brush.beginPath();
      brush.setLineDash(dashes || []);
      for (const [n, point] of points.entries()) brush[n ? "lineTo" : "moveTo"](...point);
      Object.assign(brush, { strokeStyle: colour, globalAlpha: alpha, lineWidth: dashes ? 1.5 : 1, lineJoin: "round" });
      brush.stroke();
      brush.globalAlpha = 1;
    }

    // The value of each robot at the time, in the robot's colour.
    write(title, lines, t) {
      const texts = lines.map(({ name, points, colour }) => {
        const last = points.findLast(([when]) => when <= t + 1e-6), text = last ? last[1].toFixed(this.kind.digits) : "–";
        const value = Object.assign(element("span", "", text), { title: name });
        value.style.color = lines.length > 1 ? colour : "";
        return [name, text, value];
      });
      const head = this.kind.unit ? `${title}, ${this.kind.unit}` : title;
      this.title.textContent = this.title.title = head;
      const words = texts.map(([name, text]) => (name ? `${name} ${text}` : text)).join(", ");
      this.values.replaceChildren(...(texts.length ? texts.map(([, , value]) => value) : ["–"]));
      this.canvas.ariaLabel = `${head}: ${words || "no value yet"}`;
    }
  }

  class PlotsPanel {
    constructor(section, onUnfold) {
      Object.assign(this, { section, fold: byId("plots-fold"), body: byId("plots"), whose: byId("plots-whose"), curves: new Curves(), met: "" });
      this.plots = PLOTS.map((kind) => new Plot(kind));
      this.body.replaceChildren(...this.plots.map((plot) => plot.box));
      let open = null;
      try { open = localStorage.getItem("errand-plots"); } catch { /* not kept, then */ }
      this.show(open ? open === "open" : innerWidth <= WIDE_PX || innerHeight >= TALL_PX);
      this.fold.addEventListener("click", () => {
        this.show(this.body.hidden);
        try { localStorage.setItem("errand-plots", this.body.hidden ? "folded" : "open"); } catch { /* not kept, then */ }
        onUnfold();
      });
      new ResizeObserver(onUnfold).observe(this.body);
    }

    show(open) {
      this.body.hidden = !open;
      this.fold.setAttribute("aria-expanded", open);
    }

    take(message) { this.curves.take(message); }

    draw(robots, t, end) {
      if (this.body.hidden) return;
      this.meet(robots);
      for (const plot of this.plots) plot.draw(this.curves, robots, t, end);
    }

    // Whose colour is whose, where there are several robots.
    meet(robots) {
      if (this.met === robots.join()) return;
      this.met = robots.join();
      this.body.classList.toggle("of-several", robots.length > 1);
      this.whose.replaceChildren(...(robots.length < 2 ? [] : robots).map((name) => {
        const item = element("li"), swatch = element("span", "swatch");
        swatch.style.background = `var(${colourOf(robots, name)})`;
        item.append(swatch, name);
        return item;
      }));
    }
  }

  window.errand.PlotsPanel = PlotsPanel;
})();
