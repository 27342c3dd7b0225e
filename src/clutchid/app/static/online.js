// The stage "On line": a recording played through the observer of a calibration, as a control unit would follow it.
import { all, fill, gone, h, item, lasts, named, nextStep, notice, older, one, points, repeat, select, sentences, send, summary } from "./page.js";
import { curves } from "./curves.js";
import { EDGE, UNDER, strips } from "./strips.js";
import { calibrations, startChoices } from "./load.js";
import { has, readable, ready, unchecked } from "./recording.js";

const METHODS = ["joint", "states", "paper"];
const SPEEDS = [["1", "1×"], ["10", "10×"], ["inf", "as fast as possible"]];
const chosen = { recording: "", start: "", method: "joint", force: false };
lasts("online", chosen);
let refused = "";
let open = "";
let awaited = "";   // an observation that was begun, and is not among the events yet

export function onlineStage(main, show) {
  const form = h("section", { class: "card", "aria-label": "Observe" });
  const list = h("div", { class: "list", role: "list", "aria-label": "Observed recordings" });
  const player = h("section", { "aria-label": "Player" });
  main.replaceChildren(h("div", { class: "load" }, h("div", {}, form, list), h("div", { class: "results" }, player)));
  let running = null;
  let drawn = "";
  const draw = (these) => {
    const kinds = new Set([...(these ?? ["recording"])].map((text) => text.split(" ")[0]));
    if (!["recording", "result", "observation"].some((kind) => kinds.has(kind))) return;
    if (one("observation", awaited)) awaited = "";
    if (!one("observation", open) && !awaited) open = all("observation").at(-1)?.id ?? "";
    drawForm(form, draw);
    fill(list, all("observation").map((run) => item(run.id, run.id === open, run.found ? "good" : run.status === "failed" ? "bad" : "", run.name, run.found ? run.method : run.status,
      () => { open = run.id; draw(); })));
    const run = one("observation", open);
    const now = `${open} ${run?.status} ${run?.message} ${Boolean(run?.found)}`;
    if (now === drawn) return;
    drawn = now;
    running?.end();
    running = drawPlayer(player, run, show);
  };
  draw();
  return { changed: draw, redraw() { running?.redraw(); }, end() { running?.end(); } };
}

function missing() {
  const recording = one("recording", chosen.recording);
  if (!recording) return "Choose a recording.";
  if (!recording.look || recording.look.checking) return `${recording.name} is still being read.`;
  if (unchecked(recording)) return `${recording.name}: check its channels under “Recording”, and keep the map.`;
  return chosen.start ? "" : "Choose a calibration: make one under “Load”, or open one that was saved.";
}

function drawForm(form, redraw) {
  const recordings = all("recording").filter((recording) => recording.look && readable(recording));
  if (!chosen.recording || gone.has(chosen.recording) || (one("recording", chosen.recording) && !readable(one("recording", chosen.recording)))) chosen.recording = [...recordings.filter((recording) => !has(recording, "pressure_a")), ...recordings.toReversed()].find((recording) => ready(recording) && !older.has(recording.id))?.id ?? "";
  if (!chosen.start || gone.has(chosen.start)) chosen.start = calibrations().at(-1)?.id ?? "";
  const why = missing();
  const choice = (name, label, values) => select(`observe-${name}`, label, chosen, name, values, redraw);
  fill(form, h("h2", {}, "Observe"), h("p", { class: "hint" }, "Load and pressure sample by sample, from position and duty cycles alone."),
    choice("recording", "Recording", [["", "–"], ...recordings.map((recording) => [recording.id, recording.name])]),
    choice("start", "Calibration (--start)", startChoices()),
    choice("method", "Method (--method)", METHODS.map((name) => [name, name])),
    h("p", { class: "field" }, h("label", {}, h("input", { type: "checkbox", id: "observe-force", checked: chosen.force, onchange: (event) => { chosen.force = event.target.checked; } }), " Observe even if a check is bad (--force)")),
    h("div", { class: "run" }, h("button", { type: "button", id: "run-observe", class: "strong", disabled: Boolean(why), onclick: async () => {
      try { open = awaited = (await send("POST", "/api/observations", chosen)).id; refused = ""; } catch (problem) { refused = problem.message; }
      redraw();
    } }, "Run: observe"), why && h("span", { class: "hint" }, why)), notice(refused));
}

function drawPlayer(player, run, showStage) {
  if (!run) { fill(player, h("p", { class: "hint" }, "No results yet. Run an observer first.")); return null; }
  const head = h("div", { class: "head" }, h("h2", {}, named(run.name)), h("button", { type: "button", class: "plain", onclick: () => send("DELETE", `/api/observations/${run.id}`) }, "Forget"));
  const { found } = run;
  if (!found) { fill(player, head, run.message ? notice(run.message) : h("p", { class: "hint" }, `${run.status} …`)); return null; }
  const [begin, end] = found.span;
  let time = end;
  let speed = 10;
  let timer = 0;
  let last = 0;
  let drawnStroke = -1;
  let chart = null;
  const button = h("button", { type: "button", id: "play", class: "strong", onclick: () => (timer ? pause() : play()) }, "Play");
  const slider = h("input", { type: "range", id: "time", min: String(begin), max: String(end), step: "any", value: String(end), "aria-label": "Time in s", oninput: (event) => { pause(); show(Number(event.target.value)); } });
  const shownTime = h("span", { class: "time" });
  const rates = h("select", { id: "speed", "aria-label": "Speed", onchange: (event) => { speed = event.target.value === "inf" ? Infinity : Number(event.target.value); } }, SPEEDS.map(([value, words]) => h("option", { value, selected: value === "10" }, words)));
  const step = (way) => { pause(); const times = [begin, ...found.loads.map((row) => row.time), end]; show(way > 0 ? times.find((at) => at > time + 1e-9) ?? end : times.findLast((at) => at < time - 1e-9) ?? begin); };
  const load = h("div", { class: "chart", id: "chart-online" });
  const words = h("p", { class: "hint", id: "stroke" });
  const area = h("div", {});
  const acts = { export: ["Export the observer", () => showStage("load", run.start)], correct: ["Look at the recording", () => showStage("recording", run.recording)] };
  fill(player, head, summary(found.summary), nextStep(found.next, acts[found.next.kind]), h("div", { class: "tools player" }, button, h("button", { type: "button", class: "plain", onclick: () => step(-1) }, "◀ Stroke"), h("button", { type: "button", class: "plain", id: "step", onclick: () => step(1) }, "Stroke ▶"), rates, shownTime), slider,
    load, words, area,
    h("h3", {}, "Faults in the whole recording"), found.faults.length ? h("ul", {}, found.faults.map((text) => h("li", {}, text))) : h("p", { class: "hint" }, "None."),
    sentences(found.warnings, "warning"), repeat(run));
  const line = (name, label, colour, factor, more = {}) => found.columns.includes(name) ? [{ label, colour, grid: 0, column: found.columns.indexOf(name), value: (x) => factor * x, ...more }] : [];
  const shown = strips(area, {
    span: [begin, end], read: (...rest) => points(`/api/observations/${run.id}/plot`, ...rest),
    panels: [
      { title: "position", unit: "mm", series: line("position", "position", "blue", 1e3) },
      { title: "pressure", unit: "bar", series: [...line("pressure_a", "estimated", "blue", 1e-5, UNDER), ...line("pressure_a_measured [Pa]", "measured", "ink", 1e-5),
        ...line("pressure_a low", "95 % from", "blue", 1e-5, EDGE), ...line("pressure_a high", "to", "blue", 1e-5, EDGE)] },
      { title: "innovation", unit: "mm", series: line("innovation", "measured − predicted position", "orange", 1e3) },
      { title: "usable", unit: "", series: [...line("used [1]", "position usable", "green", 1), ...line("nis_ratio [1]", "innovations relative to usual", "purple", 1)] },
    ].filter((panel) => panel.series.length),
  });
  const pause = () => { cancelAnimationFrame(timer); timer = 0; button.textContent = "Play"; };
  function play() {
    if (time >= end) time = begin;
    if (speed === Infinity) { show(end); return; }
    button.textContent = "Pause";
    last = performance.now();
    const tick = (now) => {
      const next = time + (speed * (now - last)) / 1e3;
      last = now;
      show(Math.min(next, end));
      timer = next < end ? requestAnimationFrame(tick) : 0;
      if (!timer) button.textContent = "Play";
    };
    timer = requestAnimationFrame(tick);
  }
  function show(at) {
    time = at;
    slider.value = String(at);
    shownTime.textContent = `${at.toFixed(2)} of ${end.toFixed(2)} s`;
    shown.play(at >= end ? Infinity : at);
    const row = found.loads.findLast((one) => one.time <= at) ?? found.loads[0];
    if (row.stroke !== drawnStroke) {
      drawnStroke = row.stroke;
      chart?.end();
      const curve = (label, colour, from) => ({ label, colour, position: from.position_m, force: from.force_N, low: from.low_N, high: from.high_N, reach: found.reach_m });
      chart = curves(load, "Load estimated up to this time", [curve("before the first sample", 5, found.calibrated), curve("now", 0, row.curve)]);
      words.textContent = row.stroke ? `After stroke ${row.stroke}, which ended at ${row.time.toFixed(2)} s.` : "Before the end of the first stroke.";
    }
  }
  show(end);
  return { redraw() { shown.redraw(); chart?.redraw(); }, end() { pause(); shown.end(); chart?.end(); } };
}
