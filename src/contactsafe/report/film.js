"use strict";
// Plays recorded runs side by side: the arm from its joint positions, what lies before it, the obstacle, the force.

(() => {
  const decode = (text, Kind) => new Kind(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const apply = (R, v) => [dot(R.slice(0, 3), v), dot(R.slice(3, 6), v), dot(R.slice(6, 9), v)];
  const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
  const times = (A, B) => {
    const C = new Array(9);
    for (let i = 0; i < 3; i++)
      for (let j = 0; j < 3; j++) C[3 * i + j] = A[3 * i] * B[j] + A[3 * i + 1] * B[3 + j] + A[3 * i + 2] * B[6 + j];
    return C;
  };
  const variable = (controller) => `--c-${controller.replace(/[^A-Za-z0-9]/g, "-")}`;
  const element = (tag, className, parent, text) => {
    const node = document.createElement(tag);
    node.className = className;
    if (text !== undefined) node.textContent = text;
    if (parent) parent.append(node);
    return node;
  };

  // Frames of base, links and mount in world axes.
  function kinematics(arm, q) {
    const out = [{ p: [0, 0, 0], R: [1, 0, 0, 0, 1, 0, 0, 0, 1] }];
    arm.frames.forEach((frame, i) => {
      const last = out[i];
      let R = times(last.R, frame.rotation);
      if (i < q.length) {
        const c = Math.cos(q[i]), s = Math.sin(q[i]);
        R = times(R, [c, -s, 0, s, c, 0, 0, 0, 1]);
      }
      out.push({ p: add(last.p, apply(last.R, frame.position)), R });
    });
    return out;
  }

  // One run: its channels by frame, the pictures of its surface by time.
  class Run {
    constructor(film, run) {
      Object.assign(this, run);
      this.film = film;
      this.values = decode(run.channels, Int16Array);
      this.width = this.values.length / run.frames;
      this.joints = this.width - film.channels.length;
      // Where each channel is in a frame, by its name; joint positions come first.
      this.place = Object.fromEntries(film.channels.map((name, k) => [name, this.joints + k]));
      this.canvas = document.createElement("canvas");
      [this.canvas.height, this.canvas.width] = run.cells;
      this.codes = new Uint16Array(run.cells[0] * run.cells[1]);
      this.runs = run.pictures ? decode(run.pictures, Uint16Array) : [];
      this.starts = [];
      for (let i = 0, at = 0; i < this.runs.length; at += this.runs[i + 1], i += 2)
        if (at % this.codes.length === 0) this.starts.push(i);
      this.shown = -1;
    }
    at(time) {
      const f = Math.max(0, Math.min(this.frames - 1, Math.round(time * this.film.hz)));
      const v = this.values.subarray(f * this.width, (f + 1) * this.width), n = this.joints, at = this.place, u = this.film.units;
      return {
        q: Array.from(v.subarray(0, n), (x) => x * u.q),
        obstacle: [v[at.x], v[at.y], v[at.z]].map((x) => x * u.position),
        force: v[at.force] * u.force, mode: v[at.mode], link: v[at.link],
      };
    }
    force(frame) {
      return this.values[frame * this.width + this.place.force] * this.film.units.force;
    }
    // Pictures follow each other: a code of 0 leaves a cell as it was, another is its value + 1.
    change(index) {
      const N = this.codes.length;
      for (let i = this.starts[index], at = 0; at < N; at += this.runs[i + 1], i += 2)
        if (this.runs[i]) this.codes.fill(this.runs[i], at, at + this.runs[i + 1]);
    }
    picture(time) {
      const index = Math.min(Math.floor(time * this.pictureHz + 1e-6), this.starts.length - 1);
      if (index === this.shown) return this.canvas;
      for (let k = index < this.shown ? 0 : this.shown + 1; k <= index; k++) this.change(k);
      this.shown = index;
      const context = this.canvas.getContext("2d"), image = context.createImageData(this.canvas.width, this.canvas.height);
      const colours = this.film.surface.colours;
      this.codes.forEach((code, i) => colours[code - 1] && image.data.set([...colours[code - 1], 255], 4 * i));
      context.putImageData(image, 0, 0);
      return this.canvas;
    }
  }

  class Picture {
    constructor(film, parent, run, scene) {
      this.film = film;
      this.scene = scene;
      this.run = new Run(film, run);
      const box = element("div", "run", parent);
      box.style.setProperty("--c", `var(${variable(run.controller)})`);
      const head = element("div", "run-head", box);
      element("strong", "", head, run.controller);
      this.state = element("span", "state", head);
      this.canvas = element("canvas", "scene", box);
      this.canvas.setAttribute("role", "img");
      this.canvas.setAttribute("aria-label", `${run.controller}, ${scene.name}: the arm; drag to turn`);
      const meter = element("div", "meter", box);
      this.bar = element("div", "bar", element("div", "track", meter));
      this.value = element("span", "value", meter);
      this.spark = element("canvas", "spark", box);
      this.peak = 0;
      for (let f = 0; f < run.frames; f++) this.peak = Math.max(this.peak, this.run.force(f));
    }

    prepare(canvas) {
      const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
      if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
        canvas.width = Math.round(width * ratio);
        canvas.height = Math.round(height * ratio);
      }
      const context = canvas.getContext("2d");
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      context.clearRect(0, 0, width, height);
      context.lineCap = context.lineJoin = "round";
      return { context, width, height, ratio };
    }

    draw(time, view, style) {
      if (!this.canvas.clientWidth) return; // not shown, as in print
      const now = this.run.at(time);
      this.drawScene(time, now, view, style);
      this.drawSpark(time, style);
      this.bar.style.width = `${Math.min(100, (100 * now.force) / this.scene.limit)}%`;
      this.value.textContent = `${now.force.toFixed(now.force < 9.95 ? 1 : 0)} N`;
      const does = this.film.modes[now.mode];
      this.state.textContent = does ? `${does} contact, link ${now.link || "–"}` : "free-space law";
      this.state.classList.toggle("on", Boolean(does));
    }

    drawScene(time, now, view, style) {
      const { context: c, width, height, ratio } = this.prepare(this.canvas);
      const scale = Math.min(width / this.scene.span[0], height / this.scene.span[1]);
      const [ca, sa, ce, se] = [Math.cos(view.azimuth), Math.sin(view.azimuth), Math.cos(view.elevation), Math.sin(view.elevation)];
      const right = [-sa, ca, 0], up = [-se * ca, -se * sa, ce], near = [ce * ca, ce * sa, se];
      const project = (p) => {
        const d = [p[0] - this.scene.target[0], p[1] - this.scene.target[1], p[2] - this.scene.target[2]];
        return [width / 2 + scale * dot(d, right), height / 2 - scale * dot(d, up), dot(d, near)];
      };
      const outline = (points, fill) => {
        c.beginPath();
        points.forEach((p, i) => (i ? c.lineTo(p[0], p[1]) : c.moveTo(p[0], p[1])));
        c.closePath();
        c.fillStyle = fill;
        c.fill();
        c.stroke();
      };
      const line = (a, b, w, colour) => {
        c.lineWidth = w;
        c.strokeStyle = colour;
        c.beginPath();
        c.moveTo(a[0], a[1]);
        c.lineTo(b[0] + 0.01, b[1]);
        c.stroke();
      };

      // The surface and what lies on it: columns of the image run along y, rows along x.
      const corners = this.film.surface.corners.map(project), lying = this.run.picture(time);
      c.lineWidth = 1;
      c.strokeStyle = style.edge;
      outline(corners, style.surface);
      c.save();
      c.setTransform(
        ratio * (corners[3][0] - corners[0][0]) / lying.width, ratio * (corners[3][1] - corners[0][1]) / lying.width,
        ratio * (corners[1][0] - corners[0][0]) / lying.height, ratio * (corners[1][1] - corners[0][1]) / lying.height,
        ratio * corners[0][0], ratio * corners[0][1],
      );
      c.drawImage(lying, 0, 0);
      c.restore();

      const frames = kinematics(this.film.arm, now.q), floor = this.film.surface.corners[0][2];
      const place = (frame, p) => add(frames[frame].p, apply(frames[frame].R, p));
      const capsules = this.film.arm.capsules.map((capsule) => ({
        a: place(capsule.frame, capsule.start), b: place(capsule.frame, capsule.end), r: capsule.radius * scale, frame: capsule.frame,
      }));

      // Shadow: drawn opaque on a sheet of its own, so that overlaps do not darken.
      const sheet = (this.sheet ??= document.createElement("canvas"));
      sheet.width = this.canvas.width;
      sheet.height = this.canvas.height;
      const s = sheet.getContext("2d");
      s.setTransform(ratio, 0, 0, ratio, 0, 0);
      s.lineCap = "round";
      for (const { a, b, r } of capsules) {
        const [p, q] = [project([a[0], a[1], floor]), project([b[0], b[1], floor])];
        s.lineWidth = 2 * r;
        s.beginPath();
        s.moveTo(p[0], p[1]);
        s.lineTo(q[0] + 0.01, q[1]);
        s.stroke();
      }
      c.save();
      c.setTransform(1, 0, 0, 1, 0, 0);
      c.globalAlpha = 0.13;
      c.drawImage(sheet, 0, 0);
      c.restore();

      const things = capsules.map(({ a, b, r, frame }) => {
        const [p, q] = [project(a), project(b)];
        const felt = this.film.modes[now.mode] && frame === now.link;
        return [(p[2] + q[2]) / 2, () => {
          line(p, q, 2 * r + 1.6, felt ? style.controller[this.run.controller] : style.edge);
          line(p, q, 2 * r - (felt ? 2 : 0), style.arm);
          line([p[0], p[1] - 0.28 * r], [q[0], q[1] - 0.28 * r], r, style.shine);
        }];
      });
      if (this.film.arm.tip) {
        const tip = this.film.arm.tip.map((ring) => ring.map((corner) => project(place(frames.length - 1, corner))));
        things.push([depth(tip.flat()), () => {
          c.lineWidth = 1;
          c.strokeStyle = style.edge;
          visibleFaces(tip).forEach((face) => outline(face, style.block));
        }]);
      }
      if (this.run.obstacle) {
        const rest = this.run.at(0).obstacle, moved = Math.hypot(...rest.map((x, i) => now.obstacle[i] - x));
        const [from, to] = [project(rest), project(now.obstacle)];
        things.push([to[2] - 1e-3, () => this.drawObstacle(c, from, scale, view, style, true)]);
        things.push([to[2], () => this.drawObstacle(c, to, scale, view, style, false)]);
        things.push([9, () => {
          if (moved < 5e-4) return;
          const top = this.run.obstacle[1] * scale * ce + this.run.obstacle[0] * scale + 6;
          c.fillStyle = style.text;
          c.font = `600 12px ${style.font}`;
          c.textAlign = "center";
          c.fillText(`${(1000 * moved).toFixed(moved < 0.00995 ? 1 : 0)} mm`, to[0], to[1] - top);
        }]);
      }
      things.sort((a, b) => a[0] - b[0]).forEach((thing) => thing[1]());
    }

    // A sphere, or a standing cylinder: at rest a dashed outline, now solid.
    drawObstacle(c, [x, y], scale, view, style, rest) {
      const r = this.run.obstacle[0] * scale, half = this.run.obstacle[1] * scale * Math.cos(view.elevation);
      const flat = half ? r * Math.sin(view.elevation) : r;
      c.lineWidth = 1.2;
      c.strokeStyle = rest ? style.text : style.edge;
      c.setLineDash(rest ? [3, 3] : []);
      c.fillStyle = style.obstacle;
      c.beginPath();
      c.ellipse(x, y + half, r, flat, 0, 0, Math.PI);
      c.ellipse(x, y - half, r, flat, 0, Math.PI, 2 * Math.PI);
      c.closePath();
      if (!rest) c.fill();
      c.stroke();
      if (half) {
        c.beginPath();
        c.ellipse(x, y - half, r, flat, 0, 0, 2 * Math.PI);
        if (!rest) c.fill();
        c.stroke();
      }
      c.setLineDash([]);
    }

    drawSpark(time, style) {
      const { context: c, width, height } = this.prepare(this.spark);
      const x = (f) => 1 + ((width - 2) * f) / Math.max(1, this.scene.frames - 1);
      const y = (force) => height - 2 - ((height - 6) * force) / this.scene.limit;
      c.strokeStyle = style.controller[this.run.controller];
      c.lineWidth = 1.4;
      c.beginPath();
      for (let f = 0; f < this.run.frames; f++) c.lineTo(x(f), y(this.run.force(f)));
      c.stroke();
      const f = Math.min(this.run.frames - 1, time * this.film.hz);
      c.strokeStyle = style.text;
      c.lineWidth = 1;
      c.beginPath();
      c.moveTo(x(f), 0);
      c.lineTo(x(f), height);
      c.stroke();
    }
  }

  const depth = (points) => points.reduce((sum, p) => sum + p[2], 0) / points.length;
  const area = (points) => points.reduce((sum, [x, y], i) => {
    const [u, v] = points[(i + 1) % points.length];
    return sum + y * u - x * v; // y goes down: positive where the outline runs counter-clockwise
  }, 0);

  // The faces of a tip that are seen, its corners given about the face at the TCP and the opposite one, in one order;
  // where it is round all its sides together are one.
  function visibleFaces([front, back]) {
    const n = front.length, next = (k) => (k + 1) % n;
    const sides = front.map((_, k) => [back[k], back[next(k)], front[next(k)], front[k]]);
    const ends = [front, [...back].reverse()].filter((face) => area(face) > 0);
    const seen = sides.map((side) => area(side) > 0), first = seen.findIndex((is, k) => is && !seen[(k + n - 1) % n]);
    if (n === 4 || first < 0) return [...sides.filter((_, k) => seen[k]), ...ends];
    const run = Array.from({ length: seen.filter(Boolean).length + 1 }, (_, k) => (first + k) % n);
    return [[...run.map((k) => back[k]), ...run.reverse().map((k) => front[k])], ...ends];
  }

  function readStyle(film, names) {
    const css = getComputedStyle(film);
    const read = (name) => css.getPropertyValue(name).trim();
    const style = { font: css.fontFamily, controller: {} };
    for (const name of ["edge", "arm", "shine", "surface", "block", "obstacle", "text"]) style[name] = read(`--${name}`);
    for (const name of names) style.controller[name] = read(variable(name)) || style.text;
    return style;
  }

  class Film {
    constructor(box) {
      this.box = box;
      this.film = JSON.parse(document.getElementById(box.dataset.film).textContent);
      this.film.scenes.forEach((scene) => (scene.frames = Math.max(...scene.runs.map((run) => run.frames))));
      this.speed = 1;
      this.playing = false;

      const controls = element("div", "controls", box);
      this.button = element("button", "play", controls, "Play");
      this.button.type = "button";
      this.button.addEventListener("click", () => this.play(!this.playing));
      this.slider = element("input", "scrub", controls);
      Object.assign(this.slider, { type: "range", min: 0, step: 1 / this.film.hz });
      this.slider.setAttribute("aria-label", "time in seconds");
      this.slider.addEventListener("input", () => {
        this.play(false);
        this.seek(Number(this.slider.value));
      });
      this.clock = element("span", "clock", controls);
      this.choice(controls, "speed", ["1×", "¼×"], 0, (i) => (this.speed = i ? 0.25 : 1));
      this.picker = this.film.scenes.length > 1
        ? this.choice(controls, "scene", this.film.scenes.map((scene) => scene.name), 0, (i) => this.show(i)) : null;
      this.stage = element("div", "stage", box);
      this.note = element("p", "note", box);
      this.stage.addEventListener("pointerdown", (event) => this.turn(event));
      this.show(0);
      this.fromAddress();
      window.addEventListener("hashchange", () => this.fromAddress());
      window.addEventListener("resize", () => this.draw());
      matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.restyle());
    }

    choice(parent, name, labels, chosen, act) {
      const group = element("span", "choice", parent);
      group.setAttribute("role", "group");
      group.setAttribute("aria-label", name);
      const buttons = labels.map((label, i) => {
        const button = element("button", "", group, label);
        button.type = "button";
        button.setAttribute("aria-pressed", i === chosen);
        button.addEventListener("click", () => {
          buttons.forEach((other) => other.setAttribute("aria-pressed", other === button));
          act(i);
        });
        return button;
      });
      return buttons;
    }

    // #scene=bottle&t=3.2 opens the film at that moment.
    fromAddress() {
      const wanted = new URLSearchParams(location.hash.slice(1));
      const index = this.film.scenes.findIndex((scene) => scene.name === wanted.get("scene"));
      if (index >= 0) this.picker ? this.picker[index].click() : this.show(index);
      if (wanted.has("t") && (index >= 0 || !wanted.has("scene"))) this.seek(Number(wanted.get("t")) || 0);
    }

    show(index) {
      const scene = (this.scene = this.film.scenes[index]);
      this.view = { azimuth: scene.azimuth, elevation: scene.elevation };
      this.stage.replaceChildren();
      this.pictures = scene.runs.map((run) => new Picture(this.film, this.stage, run, scene));
      this.duration = (scene.frames - 1) / this.film.hz;
      this.slider.max = this.duration;
      this.note.textContent = `Bar and curve: ${scene.force}, 0 to ${scene.limit.toFixed(0)} N on one scale for all. Drag a picture to turn it.`;
      this.restyle();
      this.seek(scene.start);
    }

    restyle() {
      this.style = readStyle(this.box, this.scene.runs.map((run) => run.controller));
      this.draw();
    }

    seek(time) {
      this.time = Math.max(0, Math.min(this.duration, time));
      this.slider.value = this.time;
      this.clock.textContent = `${this.time.toFixed(2)} s`;
      this.draw();
    }

    draw() {
      if (this.time === undefined) return;
      this.pictures.forEach((picture) => picture.draw(this.time, this.view, this.style));
    }

    play(on) {
      this.playing = on;
      this.button.textContent = on ? "Pause" : "Play";
      if (!on) return;
      if (this.time >= this.duration) this.seek(0);
      let last = performance.now();
      const step = (now) => {
        if (!this.playing) return;
        this.seek(this.time + (this.speed * (now - last)) / 1000);
        last = now;
        if (this.time >= this.duration) this.play(false);
        else requestAnimationFrame(step);
      };
      requestAnimationFrame(step);
    }

    turn(event) {
      if (!event.target.classList.contains("scene")) return;
      const start = { x: event.clientX, y: event.clientY, ...this.view };
      event.target.setPointerCapture(event.pointerId);
      const move = (e) => {
        this.view.azimuth = start.azimuth - 0.008 * (e.clientX - start.x);
        this.view.elevation = Math.max(0.1, Math.min(1.5, start.elevation + 0.008 * (e.clientY - start.y)));
        this.draw();
      };
      const stop = () => {
        event.target.removeEventListener("pointermove", move);
        event.target.removeEventListener("pointerup", stop);
        event.target.removeEventListener("pointercancel", stop);
      };
      event.target.addEventListener("pointermove", move);
      event.target.addEventListener("pointerup", stop);
      event.target.addEventListener("pointercancel", stop);
    }
  }

  document.querySelectorAll("[data-film]").forEach((box) => new Film(box));
})();
