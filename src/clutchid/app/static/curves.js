// Curves over the position with their bands: loads of several results, or how they have changed.
import uPlot from "./vendor/uPlot.esm.js";
import { SERIES, colour, h, short } from "./page.js";

/** A plot in `holder`: `curves` are {label, colour, position in m, force, low, high in N}; null where there is no band. */
export function curves(holder, title, several, { zero = false } = {}) {
  holder.replaceChildren();
  if (!several.length) return null;
  const tables = several.map((one) => [one.position.map((x) => 1e3 * x), one.force, one.low, one.high]);
  const data = uPlot.join(tables);
  const axis = { stroke: () => colour("ink"), grid: { stroke: () => colour("grid"), width: 1 }, ticks: { stroke: () => colour("grid") },
    font: "12px sans-serif", labelFont: "13px sans-serif" };
  const series = [{ label: "position [mm]", value: (_, value) => short(value, 4) }];
  const bands = [];
  several.forEach((one, index) => {
    const base = 3 * index + 1;
    const shown = () => colour(SERIES[one.colour % SERIES.length]);
    series.push({ label: one.label, stroke: shown, width: 2, spanGaps: true, value: (_, value) => (value === null || value === undefined ? "–" : `${value.toFixed(0)} N`), points: { show: false } });
    for (const edge of ["low", "high"]) series.push({ label: `${one.label} ${edge}`, class: "edge", stroke: () => "transparent", spanGaps: true, points: { show: false } });
    bands.push({ series: [base + 2, base + 1], fill: () => `${shown()}38` });
  });
  const middles = several.flatMap((one) => one.force.filter((value) => value !== null));
  const edges = several.flatMap((one) => [...one.low, ...one.high].filter((value) => value !== null));
  const [lowest, highest] = [Math.min(...middles, 0), Math.max(...middles, 0)];
  const room = Math.max(0.6 * (highest - lowest), 10);
  const low = Math.max(Math.min(...edges, lowest), lowest - room);
  const high = Math.min(Math.max(...edges, highest), highest + room);
  const plot = new uPlot({
    width: Math.max(holder.clientWidth, 200), height: 300, pxAlign: 0, title,
    cursor: { drag: { x: true, y: false }, points: { size: 6 } },
    scales: { x: { time: false }, y: { range: () => [low - 0.04 * (high - low), high + 0.04 * (high - low)] } },
    axes: [{ ...axis, label: "position [mm]", labelSize: 20, size: 36 },
      { ...axis, label: zero ? "change of the load [N]" : "load [N]", labelSize: 20, size: 62, values: (_, splits) => splits.map((value) => short(value, 6)) }],
    series, bands,
  }, data, holder);
  const observer = new ResizeObserver(() => {
    const width = Math.max(holder.clientWidth, 200);
    if (plot.width !== width) plot.setSize({ width, height: 300 });
  });
  observer.observe(holder);
  holder.append(h("p", { class: "hint" }, "Shaded: 95 % interval. Drag to zoom, double-click for all."));
  return { redraw: () => plot.redraw(true), end: () => { observer.disconnect(); plot.destroy(); } };
}
