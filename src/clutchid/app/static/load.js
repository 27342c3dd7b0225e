// The stage "Load": calibrate, estimate, and a board on which results are kept, overlaid and compared.
import { about, all, badge, dropping, fill, folded, gone, h, lasts, named, nextStep, notice, older, one, plural, points, repeat, select, sentences, send, short, summary, table, trusted } from "./page.js";
import { curves } from "./curves.js";
import { boundsOf, chooseFree } from "./free.js";
import { EDGE, UNDER, strips } from "./strips.js";
import { contents, has, readable, ready, take, unchecked, worst } from "./recording.js";

const chosen = { calibrate: new Set(), estimate: new Set(), start: "" };
const verified = { calibrate: new Set(), estimate: new Set() };
const options = { calibrate: {}, estimate: {} };
const refused = { calibrate: "", estimate: "" };
const sent = new Map();       // files dropped for a fit that are not among the events yet, with their use
const known = new Set();      // recordings and results that were offered before
const parts = new Map();      // recordings that a part was cut out of to fit it, by that part
const board = new Set();      // results that are overlaid
const target = { to: "c", method: "joint" };  // of an export
let open = "";                // the result whose details are shown
let awaited = "";             // a result that was begun, and is not among the events yet
let begun = "";               // a result that was begun here, whose answer is shown once it is there
let plots = [];

export { calibrations };
lasts("load", { chosen, verified, options, known, parts, board, target, get open() { return open; }, set open(id) { open = id; } });

export function loadStage(main, show) {
  const forms = h("div", { class: "forms" });
  const chart = h("section", { class: "charts", "aria-label": "Loads" });
  const results = h("section", { "aria-label": "Results" });
  const [answer, details] = [["details answer", "Answer"], ["details", "Result"]].map(([name, label]) => h("section", { class: name, "aria-label": label }));
  main.replaceChildren(h("div", { class: "load" }, forms, h("div", { class: "results" }, results, answer, chart, details)));
  const drawResult = () => { drawAnswer(answer, show); drawDetails(details); };
  const draw = (these) => {
    offer();
    const kinds = new Set([...(these ?? ["recording", "result"])].map((text) => text.split(" ")[0]));
    if (!kinds.has("recording") && !kinds.has("result")) return;
    drawForms(forms, () => draw());
    drawResults(results, () => { drawResults(results, () => draw()); drawCharts(chart); drawResult(); });
    if (!these || kinds.has("result")) { drawCharts(chart); drawResult(); }
    if (one("result", begun)?.found || one("result", begun)?.message) { begun = ""; answer.scrollIntoView({ block: "nearest" }); }
  };
  draw();
  return { changed: draw, choose(id, whole) {
    if (whole) { fitInstead(id, whole); draw(); return; }
    open = id;
    draw();
    document.getElementById("downloads")?.scrollIntoView();
  }, redraw() { for (const plot of plots) plot?.redraw(); }, end() { for (const plot of plots) plot?.end(); plots = []; } };
}

/** Choose a part of a recording in place of the whole and of other parts of it; where neither is chosen, as a new recording. */
function fitInstead(part, whole) {
  const source = parts.get(whole) ?? whole;
  parts.set(part, source);
  known.add(part);
  const of = (verb) => [...chosen[verb]].filter((id) => (parts.get(id) ?? id) === source);
  const verbs = Object.keys(about.verbs).filter((verb) => of(verb).length);
  for (const verb of verbs.length ? verbs : [has(one("recording", whole), "pressure_a") && !calibrations().length ? "calibrate" : "estimate"]) {
    for (const id of of(verb)) chosen[verb].delete(id);
    chosen[verb].add(part);
  }
}

/** Choose what is new: recordings with pressure to calibrate, without to estimate; the newest calibration to start from. */
function offer() {
  for (const recording of all("recording")) {
    sent.get(recording.id)?.();
    if (sent.delete(recording.id)) known.add(recording.id);
    if (!ready(recording) || known.has(recording.id) || older.has(recording.id)) continue;
    known.add(recording.id);
    const calibrated = all("result").some((result) => result.verb === "calibrate" && result.recordings.includes(recording.id));
    if (has(recording, "pressure_a") && !all("result").length && !chosen.calibrate.size) chosen.calibrate.add(recording.id);
    else if (!calibrated && !chosen.estimate.size) chosen.estimate.add(recording.id);
  }
  for (const result of all("result")) {
    if (!result.found || known.has(result.id)) continue;
    known.add(result.id);
    board.add(result.id);
    open = result.id;
    if (!result.found.is_calibration) continue;
    chosen.start = result.id;
    for (const id of result.recordings) chosen.estimate.delete(id);  // its load is known
  }
  for (const set of [chosen.calibrate, chosen.estimate, verified.calibrate, verified.estimate]) for (const id of set) if (gone.has(id) || (one("recording", id) && !readable(one("recording", id)))) set.delete(id);
  for (const id of board) if (gone.has(id)) board.delete(id);
  if (one("result", awaited)) awaited = "";
  if ((!open || gone.has(open)) && !awaited) open = all("result").at(-1)?.id ?? "";
  if (gone.has(chosen.start)) chosen.start = "";
}

/** The calibrations that a verb may start from, as choices. */
export const startChoices = () => [["", calibrations().length ? "–" : "none yet"], ...calibrations().map((result) => [result.id, result.name])];
const calibrations = () => all("result").filter((result) => result.found?.is_calibration && !result.found.writing);

/** Why a verb cannot run yet; empty where it can. */
function missing(verb) {
  const these = [...chosen[verb]].map((id) => one("recording", id)).filter(Boolean);
  if (!all("recording").some(readable)) return "Open a recording first.";
  if (!these.length) return "Choose a recording.";
  const unread = these.find((recording) => !ready(recording));
  if (unread) return `${unread.name} is still being read.`;
  const unmapped = these.find(unchecked);
  if (unmapped) return `${unmapped.name}: check its channels under “Recording”, and keep the map.`;
  const blind = these.find((recording) => verb === "calibrate" && !has(recording, "pressure_a") && !(options[verb].measure ?? "").length);
  if (blind) return `${blind.name} has no pressure: a calibration needs the channel pressure_a.`;
  const bad = these.find((recording) => recording.look.checks.some((check) => check.grade === "bad"));
  if (bad && !options[verb].force) return `A check of ${bad.name} is bad: correct the recording, or allow it under “More options”.`;
  if (verb === "estimate" && !chosen.start) return "Choose a calibration: calibrate first, or open one that was saved.";
  return "";
}

function drawForms(forms, redraw) {
  fill(forms, form("calibrate", "Calibrate", "Once, from a recording with pressure: the load, the valves, friction and sensors.", redraw),
    form("estimate", "Estimate", "The load of a worn clutch from position alone, with a calibration.", redraw));
}

function form(verb, title, purpose, redraw) {
  const why = missing(verb);
  const pick = (set, recording, label) => h("input", { type: "checkbox", id: `${label}-${verb}-${recording.id}`, checked: set.has(recording.id), "aria-label": `${label} ${recording.name} (${verb})`,
    onchange: (event) => { set[event.target.checked ? "add" : "delete"](recording.id); redraw(); } });
  const rows = all("recording").filter(readable).map((recording) => h("tr", { draggable: "true", ondragstart: (event) => event.dataTransfer.setData("text/plain", recording.id) },
    h("td", {}, pick(chosen[verb], recording, "fit")), h("td", {}, pick(verified[verb], recording, "verify")),
    h("th", { scope: "row" }, h("span", { class: `dot ${worst(recording)}` }), named(recording.name)),
    h("td", { class: "hint" }, contents(recording))));
  const put = (role, id) => {  // a recording is fitted or verified
    (role === "fit" ? chosen[verb] : verified[verb]).add(id);
    if (role === "verify") chosen[verb].delete(id);
    else verified[verb].delete(id);
  };
  const slot = (role, title, set) => {
    const these = [...set].filter((id) => one("recording", id) && (role === "fit" || !chosen[verb].has(id)));
    const chip = (id) => h("li", { draggable: "true", ondragstart: (event) => event.dataTransfer.setData("text/plain", id) }, h("span", {}, named(one("recording", id).name)),
      h("button", { type: "button", class: "link", id: `${role}-${verb}-${id}-away`, "aria-label": `Take ${one("recording", id).name} from ${role} (${verb})`, onclick: () => { set.delete(id); redraw(); } }, "×"));
    return dropping(h("div", { class: "drop slot", id: `${role}-${verb}` }, h("strong", {}, title), these.length ? h("ul", {}, these.map(chip)) : h("span", { class: "hint" }, "drop recordings or files here")), (event) => {
      if (event.dataTransfer.files.length) { take([...event.dataTransfer.files], redraw, (id) => (one("recording", id) ? put(role, id) : sent.set(id, () => put(role, id)))).then((problem) => { refused[verb] = problem; redraw(); }); return; }
      const id = event.dataTransfer.getData("text/plain");
      if (one("recording", id)) put(role, id);
      redraw();
    });
  };
  const run = async () => {
    refused[verb] = "";
    try {
      const recordings = [...chosen[verb]];
      const verify = [...verified[verb]].filter((id) => !chosen[verb].has(id));
      const { id } = await send("POST", "/api/fits", { verb, recordings, verify, start: startOf(verb), options: cleaned(options[verb]) });
      open = awaited = begun = id;
    } catch (problem) { refused[verb] = problem.message; }
    redraw();
  };
  return h("section", { class: "card", id: verb, "aria-label": title }, h("h2", {}, title), h("p", { class: "hint" }, purpose),
    h("div", { class: "slots" }, slot("fit", "Fit", chosen[verb]), slot("verify", "Verify", verified[verb])),
    rows.length ? table(["fit", "verify", "recording", "has"], rows, { name: "choose" }) : null,
    verb === "estimate" && select("start", "Calibration (--start)", chosen, "start", startChoices(), redraw),
    more(verb, redraw),
    h("div", { class: "run" }, h("button", { type: "button", id: `run-${verb}`, class: "strong", disabled: Boolean(why), onclick: run }, `Run: ${title.toLowerCase()}`), why && h("span", { class: "hint" }, why)),
    notice(refused[verb]));
}

const listed = (text = "") => text.split(/\s+/).filter(Boolean);
const cleaned = (given) => ({ ...given, bounds: boundsOf(given), prior: listed(given.prior) });
const startOf = (verb) => (verb === "estimate" ? chosen.start : null);

function more(verb, redraw) {
  const given = options[verb];
  const text = (name, label, placeholder, help) => h("p", { class: "field" }, h("label", { for: `${verb}-${name}` }, `${label} (--${name})`),
    h("input", { id: `${verb}-${name}`, value: given[name] ?? "", placeholder, title: help, onchange: (event) => { given[name] = event.target.value; redraw(); } }));
  const choice = (name, label, values) => select(`${verb}-${name}`, `${label} (--${name})`, given, name, values, redraw);
  return folded(`options of ${verb}`, "More options",
    text("free", "Free parameters", about.verbs[verb]?.free ?? "", "Names with commas; load is all load weights, auto all that a recording with pressure determines"),
    h("p", { class: "field" }, h("button", { type: "button", class: "plain", id: `${verb}-choose`, onclick: () => chooseFree(verb, given, startOf(verb), () => cleaned(given), redraw) }, "Choose free parameters and bounds …"),
      boundsOf(given).length > 0 && h("span", { class: "hint" }, `Bounds (--bounds): ${boundsOf(given).join(" ")}`)),
    text("measure", "Measured columns", about.verbs[verb]?.measure ?? "", "position, or position,pressure_a"),
    choice("method", "Method", about.methods.map((name) => [name, name || "chosen automatically"])),
    text("prior", "Priors", "P_S=8.5e5±5e3", "NAME=VALUE±STD in SI units, separated by spaces"),
    text("ambient", "Ambient pressure", "1.013bar", "Of the vented chamber in a calibration, and for gauge units"),
    choice("zero", "Where the vented rest has moved", [["", "subtract its shift from the position"], ["keep", "keep the position as recorded"]]),
    h("p", { class: "field" }, h("label", {}, h("input", { type: "checkbox", id: `${verb}-force`, checked: Boolean(given.force), onchange: (event) => { given.force = event.target.checked; redraw(); } }), " Fit even if a check is bad (--force)")));
}

const WAITING = { waiting: "waiting for another fit", running: "running", failed: "failed", cancelled: "stopped" };

function drawResults(results, redraw) {
  const rows = all("result").map((result, index) => h("tr", { class: result.id === open ? "chosen" : "" },
    h("td", {}, result.found && h("input", { type: "checkbox", id: `show-${result.id}`, checked: board.has(result.id), "aria-label": `Overlay ${result.name}`,
      onchange: (event) => { board[event.target.checked ? "add" : "delete"](result.id); redraw(); } })),
    h("td", {}, h("span", { class: `swatch s${index % 6}` })),
    h("th", { scope: "row" }, h("button", { type: "button", class: "link", id: `open-${result.id}`, "aria-pressed": String(result.id === open), onclick: () => { open = result.id; redraw(); } }, named(result.name))),
    h("td", {}, result.found ? result.found.trust && trusted(result.found.trust, "trust ") : badge(WAITING[result.status] ?? result.status, result.status === "failed" ? "bad" : "undetermined")),
    h("td", {}, h("button", { type: "button", class: "plain", "aria-label": `Forget ${result.name}`, onclick: () => send("DELETE", `/api/results/${result.id}`) }, "Forget"))));
  fill(results, h("h2", {}, "Results"), rows.length ? h("div", { class: "scroll" }, h("table", { class: "board" }, h("tbody", {}, rows))) : h("p", { class: "hint" }, "No results yet. Run a calibration first."));
}

let drawn = "";

function drawCharts(chart) {
  const overlaid = all("result").map((result, index) => ({ ...result, colour: index })).filter((result) => board.has(result.id) && result.found?.load_curve);
  const loads = overlaid.map((result) => curve(result.name, result.colour, result.found.load_curve.position_m, result.found.load_curve.force_N, result.found.load_curve.low_N, result.found.load_curve.high_N, result.found.reach_m));
  const changes = overlaid.filter((result) => result.found.load_change).map((result) => curve(`${result.name} since its calibration`, result.colour, result.found.load_change.position_m,
    result.found.load_change.difference_N, result.found.load_change.low_N, result.found.load_change.high_N, result.found.reach_m));
  const now = JSON.stringify([loads, changes]);
  if (now === drawn && chart.childElementCount) return;
  drawn = now;
  for (const plot of plots.splice(0)) plot?.end();
  const [first, second] = [h("div", { class: "chart", id: "chart-load" }), h("div", { class: "chart", id: "chart-change" })];
  fill(chart, loads.length ? first : null, changes.length ? second : null);
  plots = [curves(first, "Load of the clutch", loads), curves(second, "Change since the calibration", changes, { zero: true })];
}
const curve = (label, colour, position, force, low, high, reach) => ({ label, colour, position, force, low, high, reach });

let residuals = null;

/** The answer of a result, before its plots: trust, load, what has changed, and what is next. */
function drawAnswer(answer, show) {
  const result = one("result", open);
  if (!result) { fill(answer); return; }
  const { found } = result;
  const acts = { estimate: ["Estimate a worn clutch", () => document.getElementById("estimate").scrollIntoView()], correct: ["Look at the recording", () => show("recording", result.recordings[0])] };
  fill(answer, h("div", { class: "head" }, h("h2", {}, named(result.name))),
    !found && (result.message ? notice(result.message) : h("p", { class: "hint" }, `${WAITING[result.status] ?? ""} …`)), !found && result.bad_input && h("p", { class: "hint" }, "Correct this, and run it again."),
    found?.summary && summary(found.summary), found?.next && nextStep(found.next, acts[found.next.kind]));
}

function drawDetails(details) {
  const result = one("result", open);
  residuals?.end();
  residuals = null;
  const { found } = result ?? {};
  if (!found) { fill(details); return; }
  const strip = h("div", {});
  fill(details, sentences(found.notes, "note"), sentences(found.warnings, "warning"), downloads(result), parameters(found), found.recordings.length ? h("h3", {}, "Measured and simulated") : null, strip, repeat(result));
  if (found.recordings.length) residuals = residualStrips(strip, result);
}

function parameters(found) {
  const names = Object.entries(found.parameters ?? {});
  if (!names.length) return null;
  return folded("parameters", plural(names.length, "parameter"), table(["parameter", "value", "from", "to", "unit"], names.map(([name, estimate]) => h("tr", {}, h("th", { scope: "row" }, about.parameters[name.split("@")[0]] ?? "weight of the load", h("span", { class: "hint" }, ` ${name}`)),
    [estimate.value, estimate.low, estimate.high].map((value) => h("td", { class: "number" }, short(value))), h("td", {}, estimate.unit))), { name: "stack", scroll: "Table of parameters" }));
}

const FILES = { "report.html": "Report (page)", "fit.toml": "Parameters (TOML)", "fit.mat": "MATLAB (.mat)", "result.json": "JSON", "export.zip": "Export (ZIP)" };

function downloads(result) {
  const { found } = result;
  const link = (name) => h("a", { class: "button plain", href: `/api/results/${result.id}/files/${encodeURIComponent(name)}`, ...(name === "report.html" ? { target: "_blank", rel: "noopener" } : { download: "" }) }, FILES[name] ?? name);
  const choice = (name, values) => h("select", { id: `export-${name}`, "aria-label": name === "to" ? "Export to" : "Method of the observer", onchange: (event) => { target[name] = event.target.value; } }, values.map(([value, words]) => h("option", { value, selected: target[name] === value }, words)));
  const failed = all("job").filter((job) => job.do === "Export" && job.about === result.id).at(-1);
  return h("section", { class: "downloads", id: "downloads", "aria-label": "Downloads" }, h("h3", {}, "Downloads"),
    found.writing ? h("p", { class: "hint" }, "Files are being written …") : h("div", { class: "buttons" }, Object.keys(FILES).filter((name) => (found.files ?? []).includes(name)).map(link)),
    found.failures?.length ? notice(found.failures.join("\n")) : null,
    found.is_calibration && !found.writing && h("div", { class: "tools" }, "Export for a control unit:", choice("to", [["c", "C99"], ["c,a2l", "C99 and A2L"], ["c,fmu2", "C99 and FMU, FMI 2.0"], ["c,fmu3", "C99 and FMU, FMI 3.0"], ["c,matlab", "C99 and Simulink"], ["c,dbc", "C99 and DBC"]]),
      choice("method", ["joint", "states", "paper"].map((name) => [name, name])),
      h("button", { type: "button", id: "export", onclick: () => send("POST", `/api/results/${result.id}/export`, { ...target }) }, "Export")),
    failed?.status === "failed" && notice(failed.message),
    result.exports.map((one) => h("p", {}, link(one.file), ` ${one.words}`)));
}

function residualStrips(holder, result) {
  const { recordings } = result.found;
  const which = h("select", { "aria-label": "Recording", onchange: () => draw(Number(which.value)) }, recordings.map((one, i) => h("option", { value: String(i) }, `${one.name}${one.verified ? " (verified)" : ""}`)));
  const area = h("div", {});
  holder.replaceChildren(...(recordings.length > 1 ? [which] : []), area);
  let shown = null;
  const draw = (grid) => {
    shown?.end();
    const { columns, span } = recordings[grid];
    const line = (name, label, colour, factor, more = {}) => columns.includes(name) ? [{ label, colour, grid, column: columns.indexOf(name), value: (x) => factor * x, ...more }] : [];
    const panels = [
      { title: "position", unit: "mm", series: [...line("simulated position", "simulated", "blue", 1e3, UNDER), ...line("position", "measured", "ink", 1e3)] },
      { title: "residual", unit: "mm", series: line("residual position", "measured − simulated", "orange", 1e3) },
      { title: "pressure", unit: "bar", series: [...line("simulated pressure_a", "simulated", "blue", 1e-5, UNDER), ...line("pressure_a", "measured", "ink", 1e-5),
        ...line("pressure_a low", "95 % from", "blue", 1e-5, EDGE), ...line("pressure_a high", "to", "blue", 1e-5, EDGE)] },
      { title: "residual", unit: "bar", series: line("residual pressure_a", "measured − simulated", "orange", 1e-5) },
    ].filter((panel) => panel.series.length);
    shown = strips(area, { panels, span, read: (...rest) => points(`/api/results/${result.id}/plot`, ...rest) });
  };
  draw(0);
  return { end: () => shown?.end() };
}
