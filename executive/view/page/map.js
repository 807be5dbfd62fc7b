"use strict";
// The map with the robots, the ways they walked and plan to walk, where they may be, what blocks the way, and the things seen.
(() => {
  const LENGTH_M = 1.1, WIDTH_M = 0.5; // a standing Spot
  const SEEN_M = 0.05; // a cell
  const DASHES = [[5, 4], [2, 3], [9, 4], [9, 3, 2, 3], [1, 4], [14, 4]]; // one for each colour of a robot
  const RESERVED_PX = 9;
  const OCCUPIED_BELOW = 100, FREE_ABOVE = 230;

  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  class MapPanel {
    constructor(canvas, where) {
      this.canvas = canvas;
      this.where = where;
      this.image = null;
      this.robots = [];
      new ResizeObserver(() => this.redraw()).observe(canvas);
    }

    async setMap(map, address) {
      this.map = map;
      const image = new Image();
      image.src = address;
      await image.decode();
      this.image = image;
      this.recolour();
      this.redraw();
    }

    // The grid in the colours of the theme.
    recolour() {
      if (!this.image) return;
      const canvas = document.createElement("canvas"), { width, height } = this.image;
      Object.assign(canvas, { width, height });
      const brush = canvas.getContext("2d", { willReadFrequently: true });
      brush.drawImage(this.image, 0, 0);
      const pixels = brush.getImageData(0, 0, width, height), probe = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
      const rgb = (name) => { probe.fillStyle = css(name); probe.fillRect(0, 0, 1, 1); return probe.getImageData(0, 0, 1, 1).data; };
      const [wall, unknown, floor] = ["--wall", "--unknown", "--floor"].map(rgb);
      for (let n = 0; n < pixels.data.length; n += 4) {
        const grey = pixels.data[n];
        pixels.data.set(grey < OCCUPIED_BELOW ? wall : grey > FREE_ABOVE ? floor : unknown, n);
      }
      brush.putImageData(pixels, 0, 0);
      this.coloured = canvas;
    }

    // `robots` are the names of all.
    draw(view, robots) { Object.assign(this, { view, robots }); this.redraw(); }

    // Among several robots each has a colour and dashes of its own.
    styleOf(name) {
      if (this.robots.length < 2) return { body: css("--accent"), trail: css("--success"), path: css("--accent"), dashes: DASHES[0] };
      const colour = css(window.errand.colourOf(this.robots, name));
      return { body: colour, trail: colour, path: colour, dashes: DASHES[Math.max(0, this.robots.indexOf(name)) % DASHES.length] };
    }

    // World metres to canvas points.
    frame(width, height) {
      const { origin_m: origin, size_m: size } = this.map || this.around();
      const scale = Math.min(width / size.x, height / size.y) * 0.97;
      const left = (width - size.x * scale) / 2, bottom = (height + size.y * scale) / 2;
      return { scale, left, bottom, size, at: (x, y) => [left + (x - origin.x) * scale, bottom - (y - origin.y) * scale] };
    }

    around() {
      const points = [...this.view.robots.values()].flatMap((robot) => robot.trail);
      const xs = points.map((p) => p[0]), ys = points.map((p) => p[1]);
      const low = { x: Math.min(0, ...xs) - 2, y: Math.min(0, ...ys) - 2 };
      return { origin_m: low, size_m: { x: Math.max(0, ...xs) + 2 - low.x, y: Math.max(0, ...ys) + 2 - low.y } };
    }

    redraw() {
      const { clientWidth: width, clientHeight: height } = this.canvas, ratio = window.devicePixelRatio || 1;
      if (!this.view || !width || !height) return;
      this.canvas.width = width * ratio;
      this.canvas.height = height * ratio;
      const brush = this.canvas.getContext("2d");
      brush.setTransform(ratio, 0, 0, ratio, 0, 0);
      brush.fillStyle = css("--unknown");
      brush.fillRect(0, 0, width, height);
      const frame = this.frame(width, height);
      this.drawGrid(brush, frame);
      for (const [name, robot] of this.view.robots) {
        const style = this.styleOf(name);
        if (robot.reserved) this.drawReserved(brush, frame, robot.reserved, style);
        this.drawSeen(brush, frame, robot.seen);
        this.drawParticles(brush, frame, robot.particles);
        this.line(brush, frame, robot.trail, style.trail, []);
        if (robot.path) this.line(brush, frame, robot.path, style.path, style.dashes);
      }
      this.drawThings(brush, frame);
      const said = [];
      for (const [name, robot] of this.view.robots) if (robot.pose) said.push(this.drawRobot(brush, frame, name, robot));
      this.where.textContent = said.join("; ");
      this.canvas.setAttribute("aria-label", `Map. ${said.join("; ")}`);
    }

    drawGrid(brush, { left, bottom, scale, size, at }) {
      if (!this.coloured || !this.map) return;
      brush.imageSmoothingQuality = "high";
      brush.drawImage(this.coloured, left, bottom - size.y * scale, size.x * scale, size.y * scale);
      brush.font = `11px ${css("--font")}`;
      brush.textAlign = "center";
      brush.fillStyle = css("--dim");
      for (const place of this.map.places) {
        const [u, v] = at(place.x, place.y);
        brush.lineWidth = 3;
        brush.strokeStyle = css("--floor");
        brush.strokeText(place.name, u, v + 4);
        brush.fillText(place.name, u, v + 4);
      }
    }

    line(brush, { at }, points, colour, dashes) {
      brush.beginPath();
      points.forEach(([x, y], n) => brush[n ? "lineTo" : "moveTo"](...at(x, y)));
      brush.strokeStyle = colour;
      brush.lineWidth = 2;
      brush.setLineDash(dashes);
      brush.stroke();
      brush.setLineDash([]);
    }

    // What is reserved: a broad band below the path, to a dot where it ends.
    drawReserved(brush, frame, path, { body }) {
      brush.save();
      brush.globalAlpha = 0.3;
      brush.lineCap = "round";
      brush.beginPath();
      path.forEach(([x, y], n) => brush[n ? "lineTo" : "moveTo"](...frame.at(x, y)));
      brush.strokeStyle = body;
      brush.lineWidth = RESERVED_PX;
      brush.stroke();
      brush.globalAlpha = 1;
      brush.beginPath();
      brush.arc(...frame.at(...path[path.length - 1]), 4, 0, 2 * Math.PI);
      brush.fillStyle = body;
      brush.fill();
      brush.restore();
    }

    // Where the robot may be.
    drawParticles(brush, { at }, particles) {
      brush.fillStyle = css("--cancelled");
      for (const [x, y] of particles) brush.fillRect(...at(x, y), 2, 2);
    }

    // Cells of the costmap that are blocked by something that the map does not have.
    drawSeen(brush, { at, scale }, cells) {
      const side = Math.max(2, SEEN_M * scale);
      brush.fillStyle = css("--failure");
      for (const [x, y] of cells) { const [u, v] = at(x, y); brush.fillRect(u - side / 2, v - side / 2, side, side); }
    }

    drawThings(brush, { at }) {
      brush.font = `600 11px ${css("--font")}`;
      brush.textAlign = "left";
      const latest = new Map(this.view.destinations.map((each) => [each.name, each]));
      for (const { name, x, y } of latest.values()) {
        const [u, v] = at(x, y);
        this.mark(brush, u, v);
        this.halo(brush, name, u + 9, v + 4);
      }
    }

    // An object.
    mark(brush, u, v) {
      brush.beginPath();
      brush.moveTo(u, v - 6); brush.lineTo(u + 6, v); brush.lineTo(u, v + 6); brush.lineTo(u - 6, v); brush.closePath();
      brush.fillStyle = "#e69f00";
      brush.strokeStyle = css("--text");
      brush.lineWidth = 1;
      brush.fill(); brush.stroke();
    }

    halo(brush, text, u, v) {
      brush.lineWidth = 3;
      brush.strokeStyle = css("--floor");
      brush.strokeText(text, u, v);
      brush.fillStyle = css("--text");
      brush.fillText(text, u, v);
    }

    drawRobot(brush, { at, scale }, name, { pose: { x, y, yaw }, held, reserved }) {
      const [u, v] = at(x, y), length = Math.max(LENGTH_M * scale, 16), width = Math.max(WIDTH_M * scale, 8);
      brush.save();
      brush.translate(u, v);
      brush.rotate(-yaw);
      brush.beginPath();
      brush.moveTo(length / 2, 0); brush.lineTo(length / 4, width / 2); brush.lineTo(-length / 2, width / 2);
      brush.lineTo(-length / 2, -width / 2); brush.lineTo(length / 4, -width / 2); brush.closePath();
      brush.fillStyle = this.styleOf(name).body;
      brush.strokeStyle = css("--floor");
      brush.lineWidth = 1.5;
      brush.fill(); brush.stroke();
      brush.restore();
      brush.font = `600 11px ${css("--font")}`;
      brush.textAlign = "left";
      this.halo(brush, held ? `${name}, holding ${held}` : name, u + 12, v - 10);
      if (held) this.mark(brush, ...at(x + (LENGTH_M / 2) * Math.cos(yaw), y + (LENGTH_M / 2) * Math.sin(yaw)));
      const degrees = Math.round((yaw * 180) / Math.PI);
      return `${name} at x ${x.toFixed(2)} m, y ${y.toFixed(2)} m, ${degrees}°${held ? `, holding ${held}` : ""}${reserved ? `, its way to x ${reserved[reserved.length - 1][0].toFixed(2)} m, y ${reserved[reserved.length - 1][1].toFixed(2)} m reserved` : ""}`;
    }
  }

  window.errand.MapPanel = MapPanel;
})();
