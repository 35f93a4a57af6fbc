// Charts of Observable Plot, each an SVG in its element.

const TERM_COLOURS = {
  total: "#1f2733",
  photometric: "#2f6fb2",
  silhouette: "#d1495b",
  "inverse depth": "#3a8f5c",
  style: "#8a5cc2",
  motion: "#c98a14",
  focal: "#7a8797",
};
const ACCENT = "#2f6fb2";
const CHOSEN = "#d1495b";

function chart(id, options) {
  const element = document.getElementById(id);
  const width = Math.max(280, Math.floor(element.clientWidth));
  element.replaceChildren(viewer.plot({ width, style: { fontSize: "12px", background: "none" }, ...options }));
}

/** Every term over the iterations; what is 0 has no place on a logarithmic scale. */
function drawObjective({ terms, stages }) {
  const rows = terms.flatMap(([term, values]) =>
    values.map((value, iteration) => ({ term, iteration, value: value > 0 ? value : NaN })),
  );
  const names = terms.map(([term]) => term);
  const last = terms[0][1].length - 1;
  // What starts late has no room for its name on the right; names lie on three rows, since stages can be short.
  const starts = stages.map(([stage, iteration], k) => ({ stage, iteration, row: k % 3, isLate: iteration > 0.75 * last }));
  const stageNames = starts.map((start) =>
    viewer.text([start], {
      x: "iteration",
      text: "stage",
      frameAnchor: "top",
      textAnchor: start.isLate ? "end" : "start",
      dx: start.isLate ? -4 : 4,
      dy: -10 - 13 * start.row,
      fill: "#5d6878",
    }),
  );
  chart("objective", {
    height: 340,
    marginLeft: 52,
    marginTop: 62,
    x: { label: "iteration" },
    y: { type: "log", label: "objective", grid: true, tickFormat: (value) => (value >= 1000 ? `${value / 1000}k` : `${value}`) },
    color: { legend: true, domain: names, range: names.map((name) => TERM_COLOURS[name]) },
    marks: [
      viewer.ruleX(starts.slice(1), { x: "iteration", stroke: "#aab3bf", strokeDasharray: "3,3" }),
      ...stageNames,
      viewer.lineY(rows, {
        x: "iteration",
        y: "value",
        stroke: "term",
        strokeWidth: (row) => (row.term === "total" ? 2.2 : 1.5),
        z: "term",
      }),
      viewer.tip(rows, viewer.pointerX({ x: "iteration", y: "value", stroke: "term" })),
    ],
  });
}

/** The style's entries against the bands that hold 68 and 95 of 100 under the prior. */
function drawStyle({ entries, length, free_form_length: freeForm }) {
  const words = [`Entries in standard deviations of the prior; its length is ${length.toFixed(2)} times the usual.`];
  if (freeForm !== null) words.push(`The free form's is ${freeForm.toFixed(2)} times.`);
  words.push("Shaded: 68 and 95 of 100 known objects.");
  document.getElementById("style-words").textContent = words.join(" ");
  const rows = entries.map((value, entry) => ({ entry, value }));
  const reach = Math.max(3, ...entries.map(Math.abs));
  const last = Math.max(entries.length - 1, 0);
  const band = (deviations, fill) =>
    viewer.rectY([0], { x1: -0.6, x2: last + 0.6, y1: -deviations, y2: deviations, fill });
  chart("style", {
    height: 320,
    marginLeft: 40,
    x: { label: "principal component", domain: [-0.6, last + 0.6], ticks: Math.min(entries.length, 10) },
    y: { label: "standard deviations", domain: [-reach, reach], grid: true },
    marks: [
      band(2, "#eef3f9"),
      band(1, "#dce7f3"),
      viewer.ruleY([0], { stroke: "#7a8797" }),
      viewer.ruleX(rows, { x: "entry", y1: 0, y2: "value", stroke: ACCENT, strokeOpacity: 0.5 }),
      viewer.dot(rows, {
        x: "entry",
        y: "value",
        r: 4,
        fill: (row) => (Math.abs(row.value) > 2 ? CHOSEN : ACCENT),
        tip: true,
      }),
    ],
  });
}

/** Bars over the frames, the one that is looked at in another colour. */
function drawFrames(id, title, frames, chosen, of, domain) {
  const rows = frames.map((frame, index) => ({ frame: index, value: of(frame), name: frame.name }));
  const values = rows.map((row) => row.value).filter((value) => value !== null);
  chart(id, {
    height: 200,
    marginLeft: 44,
    marginTop: 24,
    x: { label: "frame", ticks: Math.min(rows.length, 10), tickFormat: "d", type: "linear" },
    y: { label: title, grid: true, domain: domain(values), zero: false },
    marks: [
      viewer.ruleX([chosen], { stroke: CHOSEN, strokeOpacity: 0.35 }),
      viewer.lineY(rows, { x: "frame", y: "value", stroke: ACCENT, strokeWidth: 1.2, strokeOpacity: 0.5 }),
      viewer.dot(rows, {
        x: "frame",
        y: "value",
        r: (row) => (row.frame === chosen ? 5.5 : 3.5),
        fill: (row) => (row.frame === chosen ? CHOSEN : ACCENT),
        title: (row) => `${row.name}: ${row.value === null ? "–" : row.value.toFixed(3)}`,
        tip: true,
      }),
    ],
  });
}

/** From a share below the lowest value to 1. */
function shares(values) {
  return [Math.max(0, Math.floor(10 * (Math.min(...values, 1) - 0.02)) / 10), 1];
}

function fromZero(values) {
  return [0, 1.1 * Math.max(...values, 0.1)];
}

function drawCharts(data, chosen) {
  drawObjective(data.objective);
  drawStyle(data.style);
  drawFrameCharts(data.frames, chosen);
}

function drawFrameCharts(frames, chosen) {
  drawFrames("agreement", "silhouette IoU", frames, chosen, (frame) => frame.silhouette_iou, shares);
  drawFrames("density", "density", frames, chosen, (frame) => frame.density, shares);
  drawFrames("motion", "turn since the frame before, degrees", frames, chosen, (frame) => frame.turn_deg, fromZero);
}
