// Status of the waypoints over time: a strip below the slider, and its legend.

class StateStrip {
  constructor(motion, seek, now) {
    Object.assign(this, { motion, seek, now, values: motion.states.values.data });
    const { time, duration } = motion, x = (t) => ((1000 * t) / duration).toFixed(2);
    const svg = make("svg", { viewBox: "0 0 1000 10", preserveAspectRatio: "none", "shape-rendering": "crispEdges", role: "img", "aria-label": `Status over time: ${this.inWords()}` });
    for (let from = 0; from < this.values.length; ) { // the state at a time is that since the time before
      let to = from;
      while (to + 1 < this.values.length && this.values[to + 1] === this.values[from]) to++;
      const start = time[Math.max(from - 1, 0)];
      svg.append(make("rect", { class: `state${this.values[from]}`, x: x(start), width: x(Math.max(time[to] - start, duration / 500)), height: 10 }));
      from = to + 1;
    }
    this.cursor = make("line", { class: "cursor", y1: 0, y2: 10, "vector-effect": "non-scaling-stroke" });
    svg.append(this.cursor);
    this.node = make("div", { class: "states" }, [svg]);
    const go = (event) => {
      const box = svg.getBoundingClientRect();
      seek(((event.clientX - box.left) / box.width) * duration);
    };
    svg.addEventListener("pointerdown", (event) => { svg.setPointerCapture(event.pointerId); go(event); });
    svg.addEventListener("pointermove", (event) => { if (event.buttons) go(event); });
  }

  counts() {
    const counts = this.motion.states.names.map((name, k) => [name, k, this.values.reduce((sum, value) => sum + (value === k), 0)]);
    return counts.filter(([, , count]) => count);
  }

  inWords() { return this.counts().map(([name, , count]) => `${name} at ${count} of ${this.values.length} times`).join(", "); }

  // How many waypoints are reached and why others are missed, in the words of the summary; a press on a state goes to
  // where it comes next.
  key() {
    const { reached } = this.motion.states, good = ([name]) => reached.includes(name), counts = this.counts();
    const groups = [["reached", counts.filter(good)], ["missed", counts.filter((one) => !good(one))]];
    const lists = groups.filter(([, states]) => states.length).map(([word, states]) => {
      const total = states.reduce((sum, [, , count]) => sum + count, 0);
      return make("li", {}, [`${total} ${word}:`, ...states.map((one) => this.button(one))]);
    });
    return make("ul", { class: "key states-key", "aria-label": "Waypoints" }, lists);
  }

  button([name, state, count]) {
    const words = `${name.replace(" missed", "")} ${count}`;
    const button = make("button", { type: "button", title: "Go to the next such time" }, [make("i", { class: `swatch state${state}` }), words]);
    button.addEventListener("click", () => this.next(state));
    return button;
  }

  next(state) {
    const { time } = this.motion, starts = [...this.values.keys()].filter((k) => this.values[k] === state && this.values[k - 1] !== state);
    this.seek(time[starts.find((k) => time[k] > this.now() + 1e-3) ?? starts[0]]);
  }

  show(share) {
    this.cursor.setAttribute("x1", 1000 * share);
    this.cursor.setAttribute("x2", 1000 * share);
  }
}
