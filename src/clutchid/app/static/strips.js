// Strips: one plot a unit, one below the other, with one time axis and one cursor; A and B are set by click and Shift+click.
import uPlot from "./vendor/uPlot.esm.js";
import { axis, colour, following, h, marked, notice, short } from "./page.js";

const HEIGHT = 170;
/** Lines of the ends of a band, which may be wide where nothing is known yet, and of what is computed, under what was measured. */
export const [EDGE, UNDER] = [{ dash: [4, 4], width: 0.75, edge: true }, { width: 5 }];
let keys = 0;

/**
 * Strips in `holder`. `panels` are {title, unit, series: [{label, colour, grid, column, value, delay, width, dash}]}, where `value`
 * turns a number as written into the one shown; `ranged` are buttons [text, label, act([from, to])] for a part that is shown; `read(grid, columns, begin, end, width)` gives points; `span` is [begin, end] in s.
 */
export function strips(holder, { panels, read, span, ranged = [], marks = [] }) {
  const key = `strips-${keys++}`;
  const plots = [];
  let [begin, end] = span;
  let asked = 0;
  const cursors = { a: null, b: null };
  let highlighted = marks;
  let until = Infinity;         // what comes later is not shown: a recording that is played
  const readout = h("table", { class: "readout", hidden: true });
  const error = h("div", {});
  const area = h("div", { class: "strips", id: key, tabindex: "0", role: "group",
    "aria-label": "Plots over time. Plus and minus zoom, arrow keys move, 0 shows all, a and b set the cursors in the middle." });
  const button = (text, label, act) => h("button", { type: "button", class: "plain", "aria-label": label, title: label, onclick: act }, text);
  const parted = ranged.map(([text, label, act], k) => h("button", { type: "button", class: k ? "plain" : "", hidden: true, "aria-label": label, title: label, onclick: () => act([begin, end]) }, text));
  const tools = h("div", { class: "tools" },
    button("All", "All: show the whole recording", () => show(...span)), button("+", "Zoom in", () => zoom(0.5)),
    button("−", "Zoom out", () => zoom(2)), button("◀", "Earlier", () => move(-0.5)), button("▶", "Later", () => move(0.5)),
    button("A", "A: set this cursor in the middle", () => set("a", (begin + end) / 2)),
    button("B", "B: set this cursor in the middle", () => set("b", (begin + end) / 2)),
    parted,
    h("span", { class: "hint" }, "Drag to zoom, double-click to show all. Click sets cursor A, Shift+click cursor B."));
  holder.replaceChildren(tools, area, readout, error);

  const middle = () => (begin + end) / 2;
  function zoom(factor, at = middle()) {
    const shortest = 1e-5;
    if ((end - begin) * factor < shortest) return;
    show(at - (at - begin) * factor, at + (end - at) * factor);
  }
  const move = (share) => show(begin + share * (end - begin), end + share * (end - begin));
  function show(from, to) {
    const length = Math.min(to - from, span[1] - span[0]);
    begin = Math.max(span[0], Math.min(from, span[1] - length));
    end = begin + length;
    for (const part of parted) part.hidden = length === span[1] - span[0];
    return load();
  }

  for (const panel of panels) {
    const options = {
      width: Math.max(area.clientWidth, 200), height: HEIGHT, pxAlign: 0,
      legend: marked([null, ...panel.series.map((one) => one.colour)]),
      cursor: { sync: { key }, drag: { x: true, y: false, setScale: false, dist: 5 }, points: { size: 6 },
        bind: { dblclick: () => () => { show(...span); return null; } } },
      scales: { x: { time: false, range: (_, low, high) => [low, high] } },
      axes: [axis({ values: (_, splits) => splits.map((value) => short(value, 7)), size: 34 }),
        axis({ size: 62, label: `${panel.title}${panel.unit ? ` [${panel.unit}]` : ""}`, labelSize: 18, values: (_, splits) => splits.map((value) => short(value, 4)) })],
      series: [{ label: "time [s]", value: (_, value) => short(value, 8) }, ...panel.series.map((one) => ({
        label: one.label, stroke: () => colour(one.colour), width: one.width ?? 1.25, dash: one.dash, points: { show: one.points },
        value: (_, value) => short(value, 6), spanGaps: false,
      }))],
      hooks: {
        setSelect: [(u) => {
          if (u.select.width < 5) return;
          const [from, to] = [u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")];
          u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
          show(from, to);
        }],
        drawClear: [(u) => drawMarks(u)],
        draw: [(u) => drawCursors(u)],
      },
    };
    const plot = new uPlot(options, [[], ...panel.series.map(() => [])], area);
    plot.over.addEventListener("click", (event) => {
      const box = plot.over.getBoundingClientRect();
      if (Math.abs(event.clientX - pressed) < 5) set(event.shiftKey ? "b" : "a", plot.posToVal(event.clientX - box.left, "x"));
    });
    let pressed = 0;
    plot.over.addEventListener("mousedown", (event) => { pressed = event.clientX; });
    plot.over.addEventListener("wheel", (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      const box = plot.over.getBoundingClientRect();
      zoom(event.deltaY > 0 ? 1.25 : 0.8, plot.posToVal(event.clientX - box.left, "x"));
    }, { passive: false });
    plots.push({ plot, panel });
  }

  area.addEventListener("keydown", (event) => {
    const acts = { "+": () => zoom(0.5), "=": () => zoom(0.5), "-": () => zoom(2), 0: () => show(...span), ArrowLeft: () => move(-0.25),
      ArrowRight: () => move(0.25), a: () => set("a", middle()), b: () => set("b", middle()) };
    if (event.ctrlKey || event.metaKey || !(event.key in acts)) return;
    event.preventDefault();
    acts[event.key]();
  });

  function drawMarks(u) {
    for (const [from, to] of highlighted) {
      const left = u.valToPos(Math.max(from, begin), "x", true);
      const right = u.valToPos(Math.min(to, end), "x", true);
      if (right < left) continue;
      u.ctx.fillStyle = colour("span");
      u.ctx.fillRect(left, u.bbox.top, Math.max(right - left, 2), u.bbox.height);
    }
  }

  function drawCursors(u) {
    for (const [name, time] of Object.entries(cursors)) {
      if (time === null || time < begin || time > end) continue;
      const left = u.valToPos(time, "x", true);
      u.ctx.save();
      u.ctx.strokeStyle = colour(name === "a" ? "green" : "red");
      u.ctx.fillStyle = u.ctx.strokeStyle;
      u.ctx.lineWidth = 1.5;
      u.ctx.beginPath();
      u.ctx.moveTo(left, u.bbox.top);
      u.ctx.lineTo(left, u.bbox.top + u.bbox.height);
      u.ctx.stroke();
      u.ctx.font = `bold ${12 * devicePixelRatio}px sans-serif`;
      u.ctx.fillText(name.toUpperCase(), left + 4, u.bbox.top + 13 * devicePixelRatio);
      u.ctx.restore();
    }
  }

  function set(name, time) {
    cursors[name] = time;
    for (const { plot } of plots) plot.redraw(false);
    write();
  }

  /** The values at the cursors and their differences. */
  function write() {
    const { a, b } = cursors;
    readout.hidden = a === null && b === null;
    if (readout.hidden) return;
    const rows = [row("time [s]", a, b, 8)];
    for (const { plot, panel } of plots) {
      panel.series.forEach((one, index) => {
        rows.push(row(`${one.label}${panel.unit ? ` [${panel.unit}]` : ""}`, at(plot, index + 1, a), at(plot, index + 1, b), 6));
      });
    }
    readout.replaceChildren(h("thead", {}, h("tr", {}, ["signal", "A", "B", "B − A"].map((text) => h("th", { scope: "col" }, text)))), h("tbody", {}, rows));
  }
  const row = (label, a, b, digits) => h("tr", {}, h("th", { scope: "row" }, label), h("td", {}, short(a, digits)), h("td", {}, short(b, digits)),
    h("td", {}, a === null || b === null ? "–" : short(b - a, digits)));

  async function load() {
    const number = ++asked;
    const width = Math.max(200, Math.round(area.clientWidth - 80));
    const wanted = new Map();
    const margin = 0.5;  // of the longest delay of a channel
    for (const { panel } of plots) for (const one of panel.series) {
      if (!wanted.has(one.grid)) wanted.set(one.grid, new Set());
      wanted.get(one.grid).add(one.column);
    }
    const late = panels.some((panel) => panel.series.some((one) => one.delay));
    try {
      const tables = new Map(await Promise.all([...wanted].map(async ([grid, columns]) => {
        const list = [...columns];
        const found = await read(grid, list, begin - (late ? margin : 0), end + (late ? margin : 0), width);
        return [grid, { time: found[0], by: new Map(list.map((column, i) => [column, found[i + 1]])) }];
      })));
      if (number !== asked) return;
      error.replaceChildren();
      for (const { plot, panel } of plots) {
        const parts = panel.series.map((one) => {
          const { time, by } = tables.get(one.grid);
          const times = one.delay ? time.map((t) => t - one.delay) : time;
          return [times, by.get(one.column).map((value) => (value === null ? null : one.value(value)))];
        });
        const shared = panel.series.every((one) => one.grid === panel.series[0].grid && (one.delay || 0) === (panel.series[0].delay || 0));
        const data = shared ? [parts[0][0], ...parts.map((part) => part[1])] : uPlot.join(parts);
        full.set(plot, data);
        plot.setData(played(data), false);
        plot.setScale("x", { min: begin, max: end });
        rescale(plot, panel);
      }
      area.dataset.shown = `${begin} ${end}`;
      write();
    } catch (problem) {
      error.replaceChildren(notice(problem.message));
    }
  }

  const full = new Map();
  const played = (data) => (until === Infinity ? data : data.map((values, i) => (i === 0 ? values : values.map((value, k) => (data[0][k] <= until ? value : null)))));

  /** The range of what is shown, with a margin; the ends of a band add half of it at most. */
  function rescale(plot, { series }) {
    let [low, high] = [Infinity, -Infinity];
    const [time, ...columns] = full.get(plot);
    const inside = (value, i) => value !== null && value !== undefined && time[i] >= begin && time[i] <= end;
    for (const band of [false, true]) {
      const [least, most] = band ? [low - 0.5 * (high - low), high + 0.5 * (high - low)] : [-Infinity, Infinity];
      columns.filter((_, k) => Boolean(series[k].edge) === band).forEach((values) => values.forEach((value, i) => {
        if (!inside(value, i)) return;
        low = Math.max(Math.min(low, value), least);
        high = Math.min(Math.max(high, value), most);
      }));
    }
    if (low > high) return;
    const edge = 0.06 * (high - low || Math.abs(high) || 1);
    plot.setScale("y", { min: low - edge, max: high + edge });
  }

  const observer = following(area, HEIGHT, () => plots.map(({ plot }) => plot));
  load();
  return {
    show,
    mark(from, to) { highlighted = [[from, to]]; const edge = Math.max(0.2 * (to - from), 0.05); show(from - edge, to + edge); },
    play(time) {
      until = time;
      for (const { plot } of plots) if (full.has(plot)) { plot.setData(played(full.get(plot)), false); plot.redraw(false); }
    },
    redraw() { for (const { plot } of plots) plot.redraw(true); },
    end() { observer.disconnect(); for (const { plot } of plots) plot.destroy(); },
  };
}

function at(plot, series, time) {
  if (time === null) return null;
  const [times, values] = [plot.data[0], plot.data[series]];
  const nearest = times.reduce((best, t, i) => (Number.isFinite(values[i]) && (best < 0 || Math.abs(t - time) < Math.abs(times[best] - time)) ? i : best), -1);
  return nearest < 0 ? null : values[nearest];
}
