"use strict";
// The map with the robots, the ways they walked and plan to walk, where they may be, what blocks the way, and the things seen.
(() => {
  const LENGTH_M = 1.1, WIDTH_M = 0.5; // a standing Spot
  const SEEN_M = 0.05; // a cell
  const PERSON_M = 0.45; // cells so near to a person are the person
  const DASHES = [[5, 4], [2, 3], [9, 4], [9, 3, 2, 3], [1, 4], [14, 4]]; // one for each colour of a robot
  const RESERVED_PX = 9, POSE_PX = 9, FOOT_PX = 30; // the scale stands below the map
  const LENGTHS_M = [0.5, 1, 2, 5, 10, 20, 50];
  const DOORS = { closed: ["--closed", 5, []], open: ["--open", 3, [2, 3]], unknown: ["--dim", 3, [1, 4]] };
  const OCCUPIED_BELOW = 100, FREE_ABOVE = 230;

  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  // Names on the map: each near its point, where it covers no other name and no mark. The name of a room, or of a place
  // in one, stays in the room: it moves, wraps,
  // shrinks, stands upright, and is shortened last.
  const NAME_PX = [11, 9], MOST_LINES = 3, BESIDE = [0, -0.6, 0.6, -1.1, 1.1], ROWS = [0, -1, 1, -2, 2, -3, 3, -4, 4, -5, 5], ACROSS = 12;

  const insideOf = (outline, [u, v]) => outline.reduce((is, [u1, v1], n) => {
    const [u2, v2] = outline[(n || outline.length) - 1];
    return (v1 > v) !== (v2 > v) && u < ((u2 - u1) * (v - v1)) / (v2 - v1) + u1 ? !is : is;
  }, false);
  const overlap = ([l, t, r, b], [l2, t2, r2, b2]) => Math.max(0, Math.min(r, r2) - Math.max(l, l2)) * Math.max(0, Math.min(b, b2) - Math.max(t, t2));
  const boundsOf = (points) => { const us = points.map((p) => p[0]), vs = points.map((p) => p[1]); return [Math.min(...us), Math.min(...vs), Math.max(...us), Math.max(...vs)]; };

  // A name on one line, and on two and three lines of about the same length.
  function wrapped(text) {
    const words = text.split(" "), forms = [[text]];
    for (let count = 2; count <= Math.min(MOST_LINES, words.length); count += 1) {
      const lines = [""];
      for (const word of words) {
        const last = lines[lines.length - 1], joined = last ? `${last} ${word}` : word;
        if (last && lines.length < count && joined.length > text.length / count + 1) lines.push(word);
        else lines[lines.length - 1] = joined;
      }
      forms.push(lines);
    }
    return forms;
  }

  class Names {
    // `inside` is the rectangle of the map, which names do not leave; `layout` keeps the places of names in rooms.
    constructor(brush, inside, layout) { Object.assign(this, { brush, inside, layout, family: css("--font"), taken: [], fixed: [], later: [], placed: [] }); }

    // Keeps a mark clear of names; the places of names in rooms are chosen beside marks that stay.
    keepClear(u, v, radius, stays = false) {
      const box = [u - radius, v - radius, u + radius, v + radius];
      this.taken.push(box);
      if (stays) this.fixed.push(box);
    }

    // With `room`, an outline, the name stays in it.
    add(text, u, v, colour, { bold = false, room = null } = {}) { this.later.push({ text, u, v, colour, bold, room }); }

    draw(halo) {
      const { brush } = this;
      brush.textAlign = "center";
      for (const name of this.later) {
        const { box, lines, size, upright } = name.room ? this.keptInRoom(name) : this.anywhere(name);
        this.placed.push({ text: name.text, shown: (lines || []).join(" "), box, room: name.room });
        if (!box) continue;
        this.taken.push(box);
        if (name.room) this.fixed.push(box);
        brush.font = this.font(name, size);
        brush.lineWidth = 3;
        brush.strokeStyle = halo;
        brush.fillStyle = name.colour;
        brush.save();
        brush.translate((box[0] + box[2]) / 2, (box[1] + box[3]) / 2);
        if (upright) brush.rotate(-Math.PI / 2);
        for (const draw of ["strokeText", "fillText"]) lines.forEach((line, n) => brush[draw](line, 0, (n + 0.8 - lines.length / 2) * (size + 1)));
        brush.restore();
      }
      brush.textAlign = "left";
    }

    font({ bold }, size) { return `${bold ? "600 " : ""}${size}px ${this.family}`; }

    sizeOf(name, lines, size) {
      this.brush.font = this.font(name, size);
      return [Math.max(...lines.map((line) => this.brush.measureText(line).width)) + 4, lines.length * (size + 1) + 1];
    }

    // The box of a size about a point, kept in a rectangle.
    boxAt(u, v, [wide, high], [west, north, east, south]) {
      const keep = (x, least, most) => Math.max(least, Math.min(x, most)), left = keep(u - wide / 2, west, east - wide), top = keep(v - high / 2, north, south - high);
      return [left, top, left + wide, top + high];
    }

    covered(box, taken = this.taken) { return taken.reduce((sum, other) => sum + overlap(box, other), 0); }

    // The box at the least cost: near the point, and above all on nothing else.
    best(boxes, { u, v }) {
      const cost = (box) => Math.hypot((box[0] + box[2]) / 2 - u, (box[1] + box[3]) / 2 - v) + 100 * this.covered(box);
      return boxes.map((box) => [cost(box), box]).reduce((one, other) => (other[0] < one[0] ? other : one))[1];
    }

    anywhere(name) {
      const lines = [name.text], size = NAME_PX[0], [wide, high] = this.sizeOf(name, lines, size);
      const boxes = ROWS.flatMap((dv) => BESIDE.map((du) => this.boxAt(name.u + du * wide, name.v + dv * high, [wide, high], this.inside)));
      return { box: this.best(boxes, name), lines, size };
    }

    // The first place of a name is chosen beside what stays; where something covers it, the name has a second one.
    keptInRoom(name) {
      const kept = this.layout.get(name.text) || [this.inRoom(name, this.fixed)];
      let found = kept.find(({ box }) => !box || this.covered(box) === 0);
      if (!found) kept[1] = found = this.inRoom(name, this.taken);
      this.layout.set(name.text, kept);
      return found;
    }

    // The most legible form of a name for which its room has a place, upright in a narrow one; none where no letter fits.
    inRoom(name, taken) {
      const bounds = boundsOf(name.room).map((side, n) => (n < 2 ? Math.max : Math.min)(side, this.inside[n])), [west, north, east, south] = bounds, { text } = name;
      const short = Array.from({ length: text.length - 1 }, (_, n) => [`${text.slice(0, text.length - 1 - n).trimEnd()}…`]);
      const least = NAME_PX[NAME_PX.length - 1], lying = NAME_PX.flatMap((size) => wrapped(text).map((lines) => [lines, size, false]));
      const forms = [...lying, [[text], least, true], ...short.map((lines) => [lines, least, false])];
      for (const [lines, size, upright] of forms) {
        const measured = this.sizeOf(name, lines, size), [wide, high] = upright ? measured.reverse() : measured, at = (n, from, to) => from + (n / ACROSS) * (to - from);
        if (wide > east - west + 2 || high > south - north + 2) continue;
        const grid = Array.from({ length: (ACROSS + 1) ** 2 }, (_, n) => [at(n % (ACROSS + 1), west, east), at(Math.floor(n / (ACROSS + 1)), north, south)]);
        const boxes = [[name.u, name.v], ...grid].map(([u, v]) => this.boxAt(u, v, [wide, high], bounds)).filter((box) => this.isIn(box, name.room) && this.covered(box, taken) === 0);
        if (boxes.length) return { box: this.best(boxes, name), lines, size, upright };
      }
      return { box: null };
    }

    isIn([l, t, r, b], outline) {
      const corners = [[l + 1, t + 1], [r - 1, t + 1], [r - 1, b - 1], [l + 1, b - 1]];
      return corners.every((corner) => insideOf(outline, corner)) && !outline.some(([u, v]) => u > l + 1 && u < r - 1 && v > t + 1 && v < b - 1);
    }

    // The full name where one is shortened, or left out of its room.
    fullAt(point) {
      const found = this.placed.find(({ text, shown, room }) => shown !== text && room && insideOf(room, point));
      return found ? found.text : "";
    }
  }

  class MapPanel {
    constructor(canvas, where, legend) {
      this.canvas = canvas;
      this.where = where;
      this.legend = legend;
      this.image = null;
      this.robots = [];
      new ResizeObserver(() => this.redraw()).observe(canvas);
      canvas.addEventListener("pointermove", ({ offsetX, offsetY }) => { canvas.title = this.names ? this.names.fullAt([offsetX, offsetY]) : ""; });
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
      const room = height - FOOT_PX, scale = Math.min(width / size.x, room / size.y) * 0.97;
      const left = (width - size.x * scale) / 2, bottom = (room + size.y * scale) / 2;
      const inside = [Math.max(0, left), Math.max(0, bottom - size.y * scale), Math.min(width, left + size.x * scale), Math.min(room, bottom)];
      return { scale, left, bottom, size, inside, at: (x, y) => [left + (x - origin.x) * scale, bottom - (y - origin.y) * scale] };
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
      const frame = this.frame(width, height), drawn = [width, height, ratio].join();
      if (this.drawn !== drawn || this.laidOut !== this.map) Object.assign(this, { drawn, laidOut: this.map, layout: new Map() });
      const names = (this.names = new Names(brush, frame.inside, this.layout));
      this.outlines = [];
      this.drawGrid(brush, frame);
      for (const zone of this.zones()) this.drawZone(brush, frame, zone);
      for (const [name, robot] of this.view.robots) {
        const style = this.styleOf(name);
        if (robot.reserved) this.drawReserved(brush, frame, robot.reserved, style);
        this.drawSeen(brush, frame, robot.seen.filter(([x, y]) => this.people().every(([u, v]) => Math.hypot(x - u, y - v) > PERSON_M)));
        this.drawParticles(brush, frame, robot.particles);
        this.line(brush, frame, robot.trail, style.trail, []);
        if (robot.path) this.line(brush, frame, robot.path, style.path, style.dashes);
      }
      for (const { ends, state } of this.doors()) this.line(brush, frame, ends, css(DOORS[state][0]), DOORS[state][2], DOORS[state][1]);
      this.drawThings(brush, frame);
      for (const place of this.people()) this.drawPerson(brush, frame, place);
      const said = [];
      for (const [name, robot] of this.view.robots) if (robot.pose) said.push(this.drawRobot(brush, frame, name, robot));
      this.drawPlaces(brush, frame);
      names.draw(css("--floor"));
      this.drawScale(brush, frame, height);
      this.explain();
      this.where.textContent = said.join("; ");
      said.push(...this.people().map(([x, y]) => `person at x ${x.toFixed(2)} m, y ${y.toFixed(2)} m`));
      this.canvas.setAttribute("aria-label", `Map. ${said.join("; ")}`);
    }

    drawGrid(brush, { left, bottom, scale, size, at }) {
      if (!this.coloured || !this.map) return;
      brush.imageSmoothingQuality = "high";
      brush.drawImage(this.coloured, left, bottom - size.y * scale, size.x * scale, size.y * scale);
    }

    // The dock, and the names of dock and places, which give way to those of robots and objects.
    drawPlaces(brush, { at }) {
      if (!this.map) return;
      if (this.map.dock) {
        const [u, v] = at(this.map.dock.x, this.map.dock.y);
        brush.fillStyle = css("--dock");
        brush.strokeStyle = css("--text");
        brush.lineWidth = 1;
        brush.fillRect(u - 5, v - 5, 10, 10);
        brush.strokeRect(u - 5, v - 5, 10, 10);
        this.names.keepClear(u, v, 8, true);
        this.names.add("dock", u, v, css("--text"), { room: this.roomAt(at, [u, v]) });
      }
      for (const { x, y, yaw_rad: yaw } of this.map.places) if (yaw !== undefined) this.drawPose(brush, at(x, y), yaw);
      for (const { name, x, y } of this.map.places) this.names.add(name, ...at(x, y), css("--dim"), { room: this.roomAt(at, at(x, y), name) });
    }

    // A named pose: a dot, and a line in the direction in which the robot looks there.
    drawPose(brush, [u, v], yaw) {
      brush.strokeStyle = brush.fillStyle = css("--dim");
      brush.lineWidth = 2;
      brush.beginPath();
      brush.moveTo(u, v); brush.lineTo(u + POSE_PX * Math.cos(yaw), v - POSE_PX * Math.sin(yaw));
      brush.stroke();
      brush.beginPath();
      brush.arc(u, v, 3, 0, 2 * Math.PI);
      brush.fill();
      this.names.keepClear(u, v, POSE_PX, true);
    }

    // The outline of the room of a name, else of the room at a point; null in logs that have no outlines.
    roomAt(at, point, name) {
      const rooms = this.map.places.filter((place) => place.outline), own = rooms.find((place) => place.name === name);
      const outlines = (own ? [own] : rooms).map((place) => place.outline.map(([x, y]) => at(x, y)));
      return own ? outlines[0] : outlines.find((outline) => insideOf(outline, point)) || null;
    }

    drawScale(brush, { scale }, height) {
      const length = [...LENGTHS_M].reverse().find((each) => each * scale < 160) || LENGTHS_M[0], y = height - 10;
      brush.strokeStyle = brush.fillStyle = css("--text");
      brush.lineWidth = 1.5;
      brush.beginPath();
      brush.moveTo(10, y - 4); brush.lineTo(10, y + 4); brush.moveTo(10, y); brush.lineTo(10 + length * scale, y);
      brush.moveTo(10 + length * scale, y - 4); brush.lineTo(10 + length * scale, y + 4);
      brush.stroke();
      brush.font = `11px ${css("--font")}`;
      brush.fillText(`${length} m`, 18 + length * scale, y + 4);
    }

    // The legend: what there is on the map now.
    explain() {
      const robots = [...this.view.robots], any = (has) => robots.some(([, robot]) => has(robot)), one = robots.length < 2;
      const driven = one ? [["--success", "path driven"]] : robots.map(([name]) => [window.errand.colourOf(this.robots, name), `path of ${name}`]);
      const rows = [
        ...(any((each) => each.trail.length > 1) ? driven : []),
        ...(any((each) => each.path) && one ? [["--accent", "path planned"]] : []),
        ...(any((each) => each.particles.length) ? [["--cancelled", "where it may be"]] : []),
        ...(any((each) => each.seen.length) ? [["--failure", "obstacle that the map lacks"]] : []),
        ...(this.view.destinations.length || any((each) => each.held) ? [["--object", "object found"]] : []),
        ...(this.people().length ? [["--person", "person"]] : []),
        ...(this.map && this.map.dock ? [["--dock", "dock"]] : []),
        ...this.explainDoors(),
        ...this.zones().map(({ kind, rule }) => [`--zone-${kind}`, rule]),
      ];
      const key = JSON.stringify(rows);
      if (key === this.explained) return;
      this.explained = key;
      this.legend.replaceChildren(...rows.map(([colour, text]) => {
        const item = window.errand.element("li", "", text), swatch = window.errand.element("span", "swatch");
        swatch.style.background = `var(${colour})`;
        item.prepend(swatch);
        return item;
      }));
    }

    // The closed doors by name with their age, then the other states that there are.
    explainDoors() {
      const doors = this.doors(), age = (s) => (s < 90 ? "just now" : `${Math.round(s / 60)} min ago`);
      const closed = doors.filter((door) => door.state === "closed");
      const others = [["open", "open door"], ["unknown", "door not seen"]].filter(([state]) => doors.some((door) => door.state === state));
      return [
        ...closed.map(({ between, seen_s }) => [DOORS.closed[0], `closed: door between ${between.join(" and ")}, seen ${age(this.view.t - seen_s)}`]),
        ...others.map(([state, text]) => [DOORS[state][0], text]),
      ];
    }

    // The doors of all robots, each as it was seen last.
    doors() {
      const latest = new Map();
      for (const [, robot] of this.view.robots) for (const door of robot.doors) {
        const key = String(door.ends), known = latest.get(key);
        if (!known || (door.seen_s ?? -1) > (known.seen_s ?? -1)) latest.set(key, door);
      }
      return [...latest.values()];
    }

    // The zones of the newest mission of each robot, each once.
    zones() {
      const newest = new Map(this.view.trees.map((tree) => [tree.robot, tree.zones || []]));
      return [...new Map([...newest.values()].flat().map((zone) => [zone.rule, zone])).values()];
    }

    // A zone is tinted; a keep-out zone is hatched, and a one-way zone has an arrow.
    drawZone(brush, { at }, { name, kind, rule, outlines, direction_rad: ahead }) {
      const shape = new Path2D(), colour = css(`--zone-${kind}`), points = outlines.flat().map(([x, y]) => at(x, y));
      for (const outline of outlines) {
        outline.forEach(([x, y], n) => shape[n ? "lineTo" : "moveTo"](...at(x, y)));
        shape.closePath();
      }
      this.outlines.push([rule, shape]);
      const [west, north, east, south] = boundsOf(points), low = [west, north], high = [east, south];
      const [u, v] = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2], size = Math.max(high[0] - low[0], high[1] - low[1]);
      const stroke = (...lines) => {
        brush.beginPath();
        for (const [from, ...to] of lines) { brush.moveTo(...from); for (const point of to) brush.lineTo(...point); }
        brush.stroke();
      };
      brush.save();
      brush.fillStyle = brush.strokeStyle = colour;
      brush.lineWidth = 1.5;
      brush.stroke(shape);
      brush.globalAlpha = 0.2;
      brush.fill(shape, "evenodd");
      brush.clip(shape, "evenodd");
      brush.globalAlpha = 0.7;
      if (kind === "keep_out") for (let d = 0; d < 2 * size; d += 9) stroke([[low[0] + d, low[1]], [low[0] + d - size, low[1] + size]]);
      brush.restore();
      if (ahead !== undefined) {
        const dir = (turn, length) => [length * Math.cos(ahead + turn), -length * Math.sin(ahead + turn)], [x, y] = dir(0, 0.2 * size);
        const head = [2.6, -2.6].map((turn) => { const [dx, dy] = dir(turn, 9); return [u + x + dx, v + y + dy]; });
        brush.strokeStyle = colour;
        brush.lineWidth = 2.5;
        stroke([[u - x, v - y], [u + x, v + y]], [head[0], [u + x, v + y], head[1]]);
      }
      if (!this.map || !this.map.places.some((place) => place.name === name)) this.names.add(name, u, v, css("--text"));
    }

    line(brush, { at }, points, colour, dashes, thick = 2) {
      brush.beginPath();
      points.forEach(([x, y], n) => brush[n ? "lineTo" : "moveTo"](...at(x, y)));
      brush.strokeStyle = colour;
      brush.lineWidth = thick;
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

    // The people that the robots see now.
    people() { return [...this.view.robots.values()].flatMap((robot) => robot.people); }

    // A person from above: shoulders and head.
    drawPerson(brush, { at, scale }, [x, y]) {
      const [u, v] = at(x, y), wide = Math.max(0.28 * scale, 7);
      brush.strokeStyle = css("--floor");
      brush.lineWidth = 1;
      for (const [fill, du, dv] of [["--person", wide, 0.55 * wide], ["--text", 0.42 * wide, 0.42 * wide]]) {
        brush.beginPath();
        brush.ellipse(u, v, du, dv, 0, 0, 2 * Math.PI);
        brush.fillStyle = css(fill);
        brush.fill(); brush.stroke();
      }
      this.names.keepClear(u, v, wide);
    }

    drawThings(brush, { at }) {
      const latest = new Map(this.view.destinations.map((each) => [each.name, each]));
      for (const { name, x, y } of latest.values()) {
        const [u, v] = at(x, y);
        this.mark(brush, u, v);
        this.names.keepClear(u, v, 7);
        this.names.add(name, u, v, css("--text"), { bold: true });
      }
    }

    // An object.
    mark(brush, u, v) {
      brush.beginPath();
      brush.moveTo(u, v - 6); brush.lineTo(u + 6, v); brush.lineTo(u, v + 6); brush.lineTo(u - 6, v); brush.closePath();
      brush.fillStyle = css("--object");
      brush.strokeStyle = css("--text");
      brush.lineWidth = 1;
      brush.fill(); brush.stroke();
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
      this.names.keepClear(u, v, 0.6 * length);
      this.names.add(held ? `${name}, holding ${held}` : name, u, v, css("--text"), { bold: true });
      if (held) this.mark(brush, ...at(x + (LENGTH_M / 2) * Math.cos(yaw), y + (LENGTH_M / 2) * Math.sin(yaw)));
      const degrees = Math.round((yaw * 180) / Math.PI), ratio = window.devicePixelRatio || 1;
      const rules = this.outlines.filter(([, shape]) => brush.isPointInPath(shape, u * ratio, v * ratio, "evenodd")).map(([rule]) => `, ${rule}`).join("");
      return `${name} at x ${x.toFixed(2)} m, y ${y.toFixed(2)} m, ${degrees}°${rules}${held ? `, holding ${held}` : ""}${reserved ? `, its way to x ${reserved[reserved.length - 1][0].toFixed(2)} m, y ${reserved[reserved.length - 1][1].toFixed(2)} m reserved` : ""}`;
    }
  }

  window.errand.MapPanel = MapPanel;
})();
