// A motion with its clock: stages and curves follow one slider.

const SPEEDS = [0.25, 0.5, 1, 2, 4];
const NARROW = "(max-width: 40rem)"; // as in the style sheet
const TRAIL = 2; // so many seconds of the path behind the hand are drawn strongly

const FORMS = { f32: Float32Array, u16: Uint16Array, u32: Uint32Array };

function decoded(value) {
  if (Array.isArray(value)) return value.map(decoded);
  if (value === null || typeof value !== "object") return value;
  for (const [form, Numbers] of Object.entries(FORMS))
    if (typeof value[form] === "string") {
      const bytes = Uint8Array.from(atob(value[form]), (letter) => letter.charCodeAt(0));
      return { shape: value.shape, data: new Numbers(bytes.buffer) };
    }
  return Object.fromEntries(Object.entries(value).map(([key, entry]) => [key, decoded(entry)]));
}

// Colours are the style sheet's, so that light and dark need no second list.
const colors = {
  known: new Map(), // asking the style sheet at every frame would be slow
  css: (name) => {
    if (!colors.known.has(name))
      colors.known.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
    return colors.known.get(name);
  },
  rgb: (name) => [1, 3, 5].map((k) => parseInt(colors.css(name).slice(k, k + 2), 16) / 255),
};

class Player {
  constructor(host, data) {
    const motion = decoded(data);
    motion.time = motion.time.data;
    motion.duration = motion.time.at(-1);
    Object.assign(this, { host, motion, now: 0, playing: false, speed: 1, hidden: new Set(), stages: [], charts: [] });
    this.camera = new Camera(() => this.request());
    this.build();
    const redraw = () => this.request();
    new ResizeObserver(redraw).observe(host);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { colors.known.clear(); redraw(); });
    this.seek(0);
  }

  build() {
    const { host, motion } = this, seek = (time) => this.seek(time);
    const stages = make("div", { class: "stages" }), note = [...host.childNodes]; // below its subject
    const several = motion.stages.some(({ bodies }) => bodies.length > 1);
    host.append(this.controls());
    if (this.strip) host.append(this.strip.key());
    this.stages = motion.stages.map((view) => this.stage(view, stages));
    if (this.stages.length) host.append(stages, make("div", { class: "beneath" }, [this.legend(), this.views()]));
    host.append(...note);
    this.placeNumbers(host.lastElementChild);
    Object.entries(motion.panels).forEach(([group, panels], k) => {
      const charts = panels.map((panel) => panel.strip ? new Strip(panel, motion, seek) : new Chart(panel, motion, seek));
      this.charts.push(...charts);
      const strips = `charts${panels.every((panel) => panel.strip) ? " strips" : ""}${several ? " sided" : ""}`;
      this.group(k, group, [make("div", { class: strips }, charts.map((chart) => chart.node))]);
    });
  }

  // On narrow screens the views follow the status at once, and the numbers of the summary come after them.
  placeNumbers(last) {
    const numbers = document.querySelector(".numbers"), home = numbers?.parentElement, narrow = matchMedia(NARROW);
    if (!numbers || !this.stages.length) return;
    const place = () => { if (narrow.matches) last.after(numbers); else home.append(numbers); };
    narrow.addEventListener("change", place);
    place();
  }

  // A titled group of charts; the first two are open.
  group(k, title, nodes) {
    const id = `motion-${k}`, heading = make("h3", k < 2 ? { id } : {}, [title]);
    if (k < 2) this.host.append(heading, ...nodes);
    else this.host.append(make("details", { class: "folded", id }, [make("summary", {}, [heading]), ...nodes]));
  }

  stage(view, parent) {
    const canvas = make("canvas", { role: "img", "aria-label": `${view.name}, moving, with its ellipsoids` });
    const axes = [..."xyz"].map((letter) => make("span", { class: "letter" }, [letter]));
    const arrows = new Arrows(view, this.motion.arrows), frame = make("div", { class: "view" }, [canvas, ...axes, arrows.node]);
    const note = view.note ? [make("p", { class: "meaning" }, [view.note])] : [];
    parent.append(make("figure", { class: "stage" }, [make("figcaption", {}, [view.name]), frame, ...note]));
    const { low, high } = this.bounds(view, arrows), middle = times(add(low, high), 0.5);
    const stage = new Stage(canvas, this.camera, middle, 1, low[2], view.rotation);
    stage.reach = Math.hypot(...minus(high, low)) / 2;
    if (!stage.gl) frame.replaceChildren(make("p", {}, ["3D view unavailable (WebGL 2 required). Curves and metrics are below."]));
    this.camera.follow(canvas);
    return { stage, view, axes, arrows };
  }

  bounds(view, arrows) {
    const boxes = view.bodies.map((body) => this.box(body, arrows));
    for (const rod of view.torso || []) {
      const ends = [rod.slice(0, 3), rod.slice(3, 6)];
      for (const end of ends) boxes.push({ low: end.map((x) => x - rod[6]), high: end.map((x) => x + rod[6]) });
    }
    const most = (end, best) => [0, 1, 2].map((k) => best(...boxes.map((box) => box[end][k])));
    return { low: most("low", Math.min), high: most("high", Math.max) };
  }

  box(body, arrows) {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const [frames, corners] = body.skeleton.shape, points = body.skeleton.data;
    const take = (x, k, half = 0) => { low[k] = Math.min(low[k], x - half); high[k] = Math.max(high[k], x + half); };
    points.forEach((x, k) => take(x, k % 3));
    for (const part of body.parts) sweep(part, (x, k) => take(x, k));
    arrows.sweep(body, take);
    for (const { data } of Object.values(body.ellipsoids))
      for (let i = 0; i < frames; i++)
        [0, 3, 5].forEach((place, k) => take(points[3 * (corners * (i + 1) - 1) + k], k, this.motion.size * Math.sqrt(Math.max(data[6 * i + place], 0))));
    return { low, high };
  }

  controls() {
    const { motion } = this;
    this.button = make("button", { class: "play", type: "button", title: "Play or pause (space)" });
    this.slider = make("input", { type: "range", min: 0, max: motion.duration, step: "any", value: 0, "aria-label": "Time" });
    this.clock = make("output", { class: "clock" });
    const speed = make("select", { "aria-label": "Speed" }, SPEEDS.map((x) => make("option", { value: x }, [`${x} ×`])));
    speed.value = "1";
    speed.addEventListener("change", () => { this.speed = Number(speed.value); });
    this.button.addEventListener("click", () => this.play(!this.playing));
    this.slider.addEventListener("input", () => this.seek(Number(this.slider.value)));
    if (!motion.duration) for (const control of [this.button, this.slider, speed]) control.disabled = true;
    this.play(false);
    this.strip = motion.states && motion.duration ? new StateStrip(motion, (time) => this.seek(time), () => this.now) : null;
    const track = make("div", { class: "track" }, [this.slider, ...(this.strip ? [this.strip.node] : [])]);
    return make("div", { class: "controls" }, [this.button, track, speed, this.clock]);
  }

  views() {
    const button = (name, does) => {
      const made = make("button", { type: "button" }, [name]);
      made.addEventListener("click", does);
      return made;
    };
    const { camera } = this;
    return make("div", { class: "views", role: "group", "aria-label": "View" }, [
      button("Oblique", () => camera.turn(-0.9, 0.32)), button("Front", () => camera.turn(0, 0)),
      button("Side", () => camera.turn(-Math.PI / 2, 0)), button("Top", () => camera.turn(-Math.PI / 2, 1.5)),
      button("−", () => camera.nearer(0.8)), button("+", () => camera.nearer(1.25)),
    ]);
  }

  legend() {
    const solid = this.motion.stages.filter(({ bodies }) => bodies.some((body) => body.parts.length)).map((view) => view.name).join(" and ");
    const entries = { ...this.motion.legend, ...(solid && { surface: `surface of ${solid}` }) };
    const items = Object.entries(entries).map(([role, words]) => this.choice(role, make("i", { class: `swatch ${role}` }), words));
    const arrows = Object.entries(this.motion.arrows).map(([kind, { title }]) => this.choice(kind, this.sample(`arrow-${kind}`), title));
    const dashed = this.motion.stages.some(({ bodies }) => bodies.some((body) => body.arrows.some((arrow) => arrow.dashed)));
    if (dashed) arrows.push(this.choice("dashed", this.sample("arrow-dashed reference"), "positions only"));
    return make("ul", { class: "key wide" }, [...arrows, ...items]);
  }

  // What is drawn, to be switched off and on.
  choice(name, sample, words) {
    const box = make("input", { type: "checkbox" });
    box.checked = true;
    box.addEventListener("change", () => { this.hide(name, !box.checked); });
    return make("li", {}, [make("label", {}, [box, sample, words])]);
  }

  // An arrow of the legend.
  sample(look) {
    const heads = make("path", { class: "heads", d: look.includes("force") ? "M9 2L1 6L9 10ZM17 2L25 6L17 10Z" : "M8 2L1 6L8 10M18 2L25 6L18 10" });
    const svg = make("svg", { viewBox: "0 0 26 12", "aria-hidden": "true", class: `arrow ${look}` });
    svg.append(make("path", { class: "shaft", d: "M2 6H24" }), heads);
    return svg;
  }

  // Ellipsoids and curves of a role come and go together.
  hide(role, hidden) {
    this.hidden[hidden ? "add" : "delete"](role);
    this.host.classList.toggle(`without-${role}`, hidden);
    this.request();
  }

  play(on) {
    this.playing = on && this.motion.duration > 0;
    this.button.textContent = this.playing ? "❚❚" : "▶";
    this.button.setAttribute("aria-label", this.playing ? "Pause" : "Play");
    this.before = undefined;
    if (this.playing && this.now >= this.motion.duration) this.now = 0;
    if (this.playing) this.request();
  }

  // One stored frame on or back.
  step(frames) {
    this.play(false);
    const { time } = this.motion, index = this.at(this.now)[0];
    this.seek(time[Math.max(0, Math.min(time.length - 1, index + frames))]);
  }

  // A time of the report: the stored frame that it rounds to, else the time itself.
  open(time) {
    const stored = this.motion.time[nearestIndex(this.motion.time, time)];
    this.seek(Math.abs(stored - time) < 1e-3 ? stored : time);
  }

  seek(time) {
    this.now = Math.max(0, Math.min(this.motion.duration, time));
    this.request();
  }

  request() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame((stamp) => {
      this.waiting = false;
      if (this.playing) {
        if (this.before !== undefined) this.now += (Math.min(stamp - this.before, 200) / 1000) * this.speed;
        this.before = stamp;
        if (this.now >= this.motion.duration) { this.now = this.motion.duration; this.play(false); }
      }
      this.show();
      if (this.playing) this.request();
    });
  }

  // The stored frame at or before a time, and how far it is to the next; over a gap the last one stays.
  at(now) {
    const { time, gaps } = this.motion;
    let low = 0, high = time.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (time[middle] <= now + 1e-5) low = middle; else high = middle - 1;
    }
    if (low === time.length - 1 || gaps.includes(low)) return [low, 0];
    return [low, Math.max(0, Math.min(1, (now - time[low]) / (time[low + 1] - time[low])))];
  }

  show() {
    const { motion, now } = this, [index, weight] = this.at(now), nearest = weight > 0.5 ? index + 1 : index;
    this.slider.value = now;
    const others = Object.entries(motion.clocks).map(([name, { data }]) => ` · ${name} ${(data[index] + (weight ? weight * (data[index + 1] - data[index]) : 0)).toFixed(1)} s`).join("");
    this.clock.textContent = `${(motion.start + now).toFixed(2)} s of ${(motion.start + motion.duration).toFixed(1)} s${others}`;
    this.slider.setAttribute("aria-valuetext", this.clock.textContent);
    this.host.dataset.time = now.toFixed(3);
    this.strip?.show(motion.duration ? now / motion.duration : 0);
    for (const stage of this.stages) this.draw(stage, index, weight);
    for (const chart of this.charts) chart.show(nearest, motion.duration ? now / motion.duration : 0);
  }

  draw({ stage, view, axes, arrows }, index, weight) {
    stage.radius = Math.max(...this.stages.map((one) => one.stage.reach));
    if (!stage.begin()) return;
    stage.draw(stage.grid, colors.rgb("grid"), 0.7, 1);
    for (const rod of view.torso || []) {
      const [from, to] = [rod.slice(0, 3), rod.slice(3, 6)];
      stage.bone(from, to, colors.rgb("figure"), rod[6]);
      for (const end of [from, to]) stage.knob(end, colors.rgb("figure"), rod[6]);
    }
    // lines and shells hide nothing, so they come after what is solid
    const after = view.bodies.map((arm, place) => this.drawArm(stage, arm, place, index, weight));
    view.bodies.forEach((arm, place) => this.drawPath(stage, arm, place, index));
    this.drawAxes(stage, axes);
    for (const draw of after.flat()) draw();
    arrows.show(stage, index, weight, this.hidden);
  }

  // An arm and its ellipsoids; gives what draws its shells.
  drawArm(stage, arm, place, index, weight) {
    const points = between(arm.skeleton, index, weight), shells = [];
    if (arm.parts.length && !this.hidden.has("surface"))
      arm.parts.forEach((part, k) => stage.part(`part${place}-${k}`, part, index, weight, colors.rgb("body")));
    else this.drawSkeleton(stage, points);
    for (const [role, matrices] of Object.entries(arm.ellipsoids)) {
      if (this.hidden.has(role)) continue;
      const shell = role === "target";
      const draw = () => stage.ellipsoid([...points.subarray(-3)], between(matrices, index, weight), this.motion.size, colors.rgb(role), shell);
      if (shell) shells.push(draw); else draw();
    }
    return shells;
  }

  drawPath(stage, arm, place, index) {
    if (!arm.path) return;
    const path = stage.kept(`path${place}`, () => arm.path.data);
    stage.draw(path, colors.rgb("target"), 0.25, 1.2, true);
    const first = this.at(this.now - TRAIL)[0];
    stage.draw(path, colors.rgb("target"), 0.9, 2, true, first, index);
  }

  drawSkeleton(stage, points) {
    const ink = colors.rgb("bone"), corners = [];
    for (let k = 0; k < points.length; k += 3) corners.push([...points.subarray(k, k + 3)]);
    corners.forEach((corner, k) => {
      if (k) stage.bone(corners[k - 1], corner, ink);
      if (k < corners.length - 1) stage.knob(corner, ink);
    });
  }

  // The base frame, visible through the robot.
  drawAxes(stage, letters) {
    const { gl } = stage, length = 0.22 * stage.radius;
    gl.disable(gl.DEPTH_TEST);
    [[length, 0, 0], [0, length, 0], [0, 0, length]].forEach((end, k) => {
      stage.draw(stage.kept(`axis${k}`, () => new Float32Array([0, 0, 0, ...end])), colors.rgb(`axis-${"xyz"[k]}`), 0.9, 2);
      const [x, y] = stage.onCanvas(times(end, 1.15));
      letters[k].style.transform = `translate(${x}px, ${y}px) translate(-50%, -50%)`;
    });
    gl.enable(gl.DEPTH_TEST);
  }
}
