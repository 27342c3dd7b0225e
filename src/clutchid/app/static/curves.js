// Plots with bands: loads over the position, or how they have changed; and the trend of a vehicle over its life.
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

const PANELS = { wear: ["wear [mm]", 1e3], shift: ["shift [mm]", 1e3], load: ["load [%]", 100] };
const COUNTED = ["used", "jump"];
const HEIGHT = 220;
const ENOUGH = 6;             // a forecast that is longer than so many spans of the recordings is shown on demand only
let keys = 0;

/** Plots in `holder`; `state.forecast` says whether what is left is shown. */
export function trends(holder, trend, recordings, state) {
  const key = `trends-${keys++}`;
  const { along, alarms, limit } = trend;
  const [first, last] = [along[0], along.at(-1)];
  const left = trend.left?.map((value) => (value === "inf" ? Infinity : value)) ?? null;
  const reached = left && Number.isFinite(left[1]);
  state.forecast ??= Boolean(reached && Number.isFinite(left[0]) && left[0] <= ENOUGH * (last - first));
  const names = Object.keys(PANELS).filter((name) => name in trend.bands);
  const area = h("div", { class: "strips" });
  const tick = h("label", {}, h("input", { type: "checkbox", id: "forecast", checked: state.forecast, onchange: (event) => { state.forecast = event.target.checked; draw(); } }), " Forecast to the limit");
  const words = h("p", { class: "hint" });
  holder.replaceChildren(h("div", { class: "tools" }, reached && tick, h("span", { class: "hint" }, "Drag to zoom, double-click to show all.")), area, words);
  let plots = [];
  const observer = following(area, HEIGHT, () => plots);

  /** The last place that is shown: the median of the forecast, or its lower end where there is none, with a margin. */
  function end() {
    if (!state.forecast) return last;
    const wanted = Number.isFinite(left[2]) ? left[2] : Number.isFinite(left[0]) ? 1.15 * left[0] : 1.3 * left[1];
    return last + Math.min(wanted, Math.max(1.6 * left[0] || Infinity, 1.3 * left[1]));
  }

  function draw() {
    for (const plot of plots) plot.destroy();
    const span = [first, end()];
    if (!(span[1] > span[0])) { span[0] -= 0.5; span[1] += 0.5; }
    const edge = 0.02 * (span[1] - span[0]);
    words.textContent = `Dots are readings; the line is the trend through all of them, with its 95 % band.${alarms.length ? " Red dashed lines are alarms." : ""}${state.forecast ? " The orange dashed line is the limit. The bar on it is the 90 % interval in which the trend reaches it, the dot the median." : ""}`;
    plots = names.map((name, k) => panel(name, [span[0] - edge, span[1] + edge], k === 0, k === names.length - 1));
  }

  function panel(name, span, named, lowest) {
    const [title, factor] = PANELS[name];
    const scaled = (values) => values.map((value) => (typeof value === "number" ? factor * value : null));
    const [value, low, high] = trend.bands[name].map(scaled);
    const line = { x: [], value: [], low: [], high: [] };
    along.forEach((at, i) => {
      if (recordings[i].outcome === "jump" && i) for (const part of ["x", "value", "low", "high"]) line[part].push(part === "x" ? (along[i - 1] + at) / 2 : null);  // another clutch is another line
      for (const [part, from] of [["x", along], ["value", value], ["low", low], ["high", high]]) line[part].push(from[i]);
    });
    const measured = recordings.map((row) => ({ shift: row.shift, load: row.change })[name] ?? null).map((one) => (one === null ? null : factor * one));
    const points = (counts) => {
      const these = along.map((at, i) => [at, measured[i]]).filter(([, y], i) => y !== null && COUNTED.includes(recordings[i].outcome) === counts);
      return [these.map(([x]) => x), these.map(([, y]) => y)];
    };
    const limited = limit?.of === name && state.forecast;
    const tables = [[line.x, line.value, line.low, line.high], points(true), points(false)].filter(([x]) => x.length);
    const ink = (which) => () => colour(which);
    const dots = (label, which, fill) => ({ label, which, stroke: ink(which), paths: () => null, points: { show: true, size: 8, width: 1.5, stroke: ink(which), fill: ink(fill) } });
    const shown = (_, y) => short(y, 4);
    const edges = (label) => ({ label, class: "edge", stroke: () => "transparent", points: { show: false } });
    const ends = [...line.low, ...line.high, ...measured, ...(limited ? [factor * limit.value] : [])].filter((y) => y !== null && y !== undefined);
    const [bottom, top] = [Math.min(...ends), Math.max(...ends)];
    const room = 0.08 * (top - bottom || Math.abs(top) || 1);
    const series = [{ label: trend.axis, value: (_, x) => (x === null || x === undefined ? "–" : Math.round(x).toLocaleString("en")) },
      { label: "trend", which: "blue", stroke: ink("blue"), width: 2, value: shown, points: { show: line.x.length === 1 } }, edges("low"), edges("high"),
      ...[[true, "reading", "ink", "ink"], [false, "left out", "red", "paper"]].filter(([counts]) => points(counts)[0].length).map(([, ...rest]) => ({ ...dots(...rest), value: shown }))];
    const all = uPlot.join(tables);
    return new uPlot({
      width: Math.max(area.clientWidth, 200), height: HEIGHT, pxAlign: 0,
      legend: marked(series.map((one) => one.which)),
      cursor: { sync: { key }, drag: { x: true, y: false }, points: { size: 6 } },
      scales: { x: { time: false, range: (_, from, to) => (from === all[0][0] && to === all[0].at(-1) ? span : [from, to]) }, y: { range: () => [bottom - room, top + room] } },
      axes: [axis({ size: lowest ? 36 : 30, label: lowest ? trend.axis : undefined, labelSize: 18, space: 80, values: (_, splits) => splits.map((x) => x.toLocaleString("en")) }),
        axis({ size: 62, label: title, labelSize: 18, values: (_, splits) => splits.map((y) => short(y, 4)) })],
      series, bands: [{ series: [3, 2], fill: () => `${colour("blue")}30` }],
      hooks: { draw: [(u) => { if (limited) drawLimit(u, factor * limit.value, value.findLast((y) => y !== null)); drawAlarms(u, named); }] },
    }, all, area);
  }

  function drawAlarms(u, named) {
    const { ctx } = u;
    for (const { index, kind } of alarms) {
      const x = u.valToPos(along[index], "x", true);
      if (x < u.bbox.left - 1 || x > u.bbox.left + u.bbox.width + 1) continue;
      ctx.save();
      ctx.strokeStyle = ctx.fillStyle = colour("red");
      ctx.lineWidth = 1.5 * devicePixelRatio;
      ctx.setLineDash([6 * devicePixelRatio, 4 * devicePixelRatio]);
      stroke(ctx, [x, u.bbox.top], [x, u.bbox.top + u.bbox.height]);
      if (named) {
        const roomy = x - u.bbox.left > 20 * devicePixelRatio;
        ctx.translate(x + (roomy ? -7 : 16) * devicePixelRatio, u.bbox.top + (limit && state.forecast ? 26 : 4) * devicePixelRatio);
        ctx.rotate(-Math.PI / 2);
        ctx.font = `bold ${12 * devicePixelRatio}px sans-serif`;
        ctx.textAlign = "right";
        ctx.fillText(kind, 0, 0);
      }
      ctx.restore();
    }
  }

  /** The limit, the way of the median to it, and on it a bar from the lower to the upper end of the forecast. */
  function drawLimit(u, at, from) {
    const { ctx } = u;
    const [y, right] = [u.valToPos(at, "y", true), u.bbox.left + u.bbox.width];
    const place = (value) => (Number.isFinite(value) ? u.valToPos(last + value, "x", true) : Infinity);
    ctx.save();
    ctx.beginPath();
    ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
    ctx.clip();
    ctx.strokeStyle = ctx.fillStyle = colour("orange");
    ctx.lineWidth = 1.5 * devicePixelRatio;
    ctx.setLineDash([5 * devicePixelRatio, 4 * devicePixelRatio]);
    stroke(ctx, [u.bbox.left, y], [right, y]);
    if (left) {
      const [median, low, high] = left.map(place);
      ctx.setLineDash([]);
      ctx.globalAlpha = 0.5;
      ctx.fillRect(low, y - 4 * devicePixelRatio, Math.min(high, right) - low, 8 * devicePixelRatio);
      ctx.globalAlpha = 1;
      if (Number.isFinite(median)) {
        ctx.setLineDash([2 * devicePixelRatio, 4 * devicePixelRatio]);
        stroke(ctx, [u.valToPos(last, "x", true), u.valToPos(from, "y", true)], [median, y]);
        ctx.beginPath();
        ctx.arc(median, y, 5 * devicePixelRatio, 0, 2 * Math.PI);
        ctx.fill();
      }
    }
    ctx.restore();
  }

  draw();
  return { redraw: draw, end() { observer.disconnect(); for (const plot of plots) plot.destroy(); plots = []; } };
}

function stroke(ctx, from, to) {
  ctx.beginPath();
  ctx.moveTo(...from);
  ctx.lineTo(...to);
  ctx.stroke();
}
