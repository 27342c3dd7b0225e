// Plots with bands: loads over the position, or how they have changed.
import uPlot from "./vendor/uPlot.esm.js";
import { SERIES, axis, colour, following, h, marked, short } from "./page.js";

const ENGAGING = [5, 8];      // mm, where the clutch engages

/** A plot in `holder`: `curves` are {label, colour, position in m, force, low, high in N, reach in m}; null where there is no band; beyond the reach, if it is known, a load is dashed. */
export function curves(holder, title, several, { zero = false } = {}) {
  holder.replaceChildren();
  if (!several.length) return null;
  const within = (one) => (one.reach ? one.position.findLastIndex((x) => x <= one.reach) : one.position.length);
  const tables = several.map((one) => [one.position.map((x) => 1e3 * x), ...[(i) => i <= within(one), (i) => i >= within(one)].map((is) => one.force.map((value, i) => (is(i) ? value : null))), one.low, one.high]);
  const data = uPlot.join(tables);
  const series = [{ label: "position [mm]", value: (_, value) => short(value, 4) }];
  const bands = [];
  several.forEach((one, index) => {
    const base = 4 * index + 1;
    const shown = () => colour(SERIES[one.colour % SERIES.length]);
    const force = (value) => (value === null || value === undefined ? "–" : `${value.toFixed(0)} N`);
    series.push({ label: one.label, stroke: shown, width: 2, spanGaps: true, value: (u, value, k, i) => force(value ?? u.data[k + 1][i]), points: { show: false } });
    series.push({ label: `${one.label} beyond the recorded range`, class: "edge", stroke: shown, width: 1.4, dash: [6, 5], spanGaps: true, points: { show: false } });
    for (const edge of ["low", "high"]) series.push({ label: `${one.label} ${edge}`, class: "edge", stroke: () => "transparent", spanGaps: true, points: { show: false } });
    bands.push({ series: [base + 3, base + 2], fill: () => `${shown()}38` });
  });
  const middles = several.flatMap((one) => one.force.filter((value) => value !== null));
  const edges = several.flatMap((one) => [...one.low, ...one.high].filter((value) => value !== null));
  const [lowest, highest] = [Math.min(...middles, 0), Math.max(...middles, 0)];
  const room = Math.max(0.6 * (highest - lowest), 10);
  const low = Math.max(Math.min(...edges, lowest), lowest - room);
  const high = Math.min(Math.max(...edges, highest), highest + room);
  const plot = new uPlot({
    width: Math.max(holder.clientWidth, 200), height: 300, pxAlign: 0, title,
    legend: marked([null, ...several.flatMap((one) => Array(4).fill(SERIES[one.colour % SERIES.length]))]),
    cursor: { drag: { x: true, y: false }, points: { size: 6 } },
    scales: { x: { time: false }, y: { range: () => [low - 0.04 * (high - low), high + 0.04 * (high - low)] } },
    axes: [axis({ label: "position [mm]", labelSize: 20, size: 36 }),
      axis({ label: zero ? "change of the load [N]" : "load [N]", labelSize: 20, size: 62, values: (_, splits) => splits.map((value) => short(value, 6)) })],
    series, bands,
    hooks: { drawClear: [(u) => {
      const [left, right] = ENGAGING.map((x) => Math.min(Math.max(u.valToPos(x, "x", true), u.bbox.left), u.bbox.left + u.bbox.width));
      u.ctx.fillStyle = colour("span");
      u.ctx.fillRect(left, u.bbox.top, right - left, u.bbox.height);
    }] },
  }, data, holder);
  const observer = following(holder, 300, () => [plot]);
  holder.append(h("p", { class: "hint" }, `Bands are 95 % intervals.${several.some((one) => one.reach) ? " Lines are dashed beyond the recorded range." : ""} The clutch engages in the shaded range, 5 to 8 mm. Drag to zoom, double-click to show all.`));
  return { redraw: () => plot.redraw(true), end: () => { observer.disconnect(); plot.destroy(); } };
}

