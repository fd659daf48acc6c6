// A joint as a strip within its limits; opened, it is a chart.

class Strip {
  constructor(panel, motion, seek) {
    Object.assign(this, { panel, motion, seek, chart: null, share: 0, index: 0 });
    this.line = { ...panel.lines[0], values: panel.lines[0].values.data };
    const drawn = new Chart(panel, motion, seek), svg = make("svg", { viewBox: "0 0 1000 100", preserveAspectRatio: "none", "aria-hidden": "true" });
    for (const [from, to] of drawn.beyond())
      svg.append(make("rect", { class: "beyond", x: 0, width: 1000, y: Math.min(from, to), height: Math.abs(to - from) }));
    this.cursor = make("line", { class: "cursor", y1: 0, y2: 100, ...STILL });
    svg.append(make("path", { class: `curve ${this.line.role}`, d: drawn.path(this.line.values), ...STILL }), this.cursor);
    this.readout = make("output");
    const name = make("span", { class: "joint" }, [panel.title]);
    this.summary = make("summary", {}, [name, make("span", { class: "strip" }, [svg]), this.readout]);
    this.node = make("details", {}, [this.summary]);
    this.node.addEventListener("toggle", () => {
      if (this.chart) return;
      this.chart = drawn;
      this.node.append(drawn.node);
      drawn.show(this.index, this.share);
    });
  }

  // Whether the joint is as near to a limit as a hundredth of its range.
  atLimit(value) {
    const { limits } = this.panel, slack = limits ? 0.01 * (limits[1] - limits[0]) : 0;
    return Boolean(limits) && (value <= limits[0] + slack || value >= limits[1] - slack);
  }

  show(index, share) {
    Object.assign(this, { index, share });
    const value = this.line.values[index];
    this.cursor.setAttribute("x1", 1000 * share);
    this.cursor.setAttribute("x2", 1000 * share);
    this.readout.textContent = `${readable(value)} ${this.panel.unit}`;
    this.summary.classList.toggle("limit", this.atLimit(value));
    this.chart?.show(index, share);
  }
}
