// What a chart shows, as a file: SVG with its own colours, CSV with a column for each line.

function save(name, type, text) {
  const link = make("a", { href: URL.createObjectURL(new Blob([text], { type })), download: name.replace(/[^\w.]+/g, "_") });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

const shownLines = (chart) => chart.lines.filter((_, k) => !chart.hidden.has(k));

function asCSV(chart) {
  const { time, start } = chart.motion, lines = shownLines(chart), unit = chart.panel.unit ? ` [${chart.panel.unit}]` : "";
  const cell = (text) => `"${text.replaceAll('"', '""')}"`;
  const rows = [["time [s]", ...lines.map((line) => `${line.name || chart.panel.title}${unit}`)].map(cell)];
  time.forEach((t, k) => rows.push([(start + t).toFixed(4), ...lines.map((line) => (Number.isFinite(line.values[k]) ? line.values[k] : ""))]));
  return `${rows.map((row) => row.join(",")).join("\n")}\n`;
}

function asSVG(chart) {
  const [left, top, width, height] = [60, 34, 620, 240], text = (x, y, words, more = "") => `<text x="${x}" y="${y}" ${more}>${escaped(words)}</text>`;
  const unit = chart.panel.unit ? ` [${chart.panel.unit}]` : "", parts = [text(left, 20, chart.panel.title + unit, 'font-weight="bold"')];
  for (const [y, words] of chart.ticks()) {
    const down = top + (y / 100) * height;
    parts.push(`<path d="M${left} ${down}h${width}" stroke="#ddd"/>`, text(left - 6, down + 4, words, 'text-anchor="end"'));
  }
  for (const [x, words] of chart.times()) parts.push(text(left + (x / 100) * width, top + height + 16, words, 'text-anchor="middle"'));
  const lines = shownLines(chart), scaled = `transform="translate(${left} ${top}) scale(${width / 1000} ${height / 100})"`;
  const dashes = ["", "6 3", "1.5 2.5"];
  for (const line of [...lines.filter((one) => one.wide), ...lines.filter((one) => !one.wide)])
    parts.push(`<path ${scaled} d="${chart.path(line.values)}" fill="none" stroke="${colors.css(line.role)}" stroke-width="${line.wide ? 5 : 1.4}" opacity="${line.wide ? 0.35 : 1}" stroke-dasharray="${dashes[line.style]}" vector-effect="non-scaling-stroke"/>`);
  lines.forEach((line, k) => line.name && parts.push(text(left + k * 150, top + height + 36, line.name, `fill="${colors.css(line.role)}"`)));
  return `<svg xmlns="${SVG}" viewBox="0 0 700 ${top + height + 46}" font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="${colors.css("paper")}"/><g fill="${colors.css("text")}">${parts.join("")}</g></svg>\n`;
}

const escaped = (words) => words.replace(/[&<>]/g, (letter) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;" })[letter]);
