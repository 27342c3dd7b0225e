// The stage "Recording": open files, look at them, give channels a meaning, see what the checks say, cut out a range.
import { about, all, badge, bytes, drawBox, fill, folded, gone, h, item, lasts, named, notice, one, plural, points, send, sending, short, SERIES, table } from "./page.js";
import { strips } from "./strips.js";

/** Units in which SI is shown, with factor and offset. */
const SHOWN = { m: ["mm", 1e3], Pa: ["bar", 1e-5], "1": ["", 1], s: ["s", 1], N: ["N", 1], K: ["°C", 1, -273.15], "m/s": ["mm/s", 1e3] };
const TITLES = { m: "position", Pa: "pressure", "1": "duty cycle", K: "temperature", N: "force", "m/s": "velocity", s: "time" };
const MOST_CHANNELS = 200;
const MOST_CANDIDATES = 4;    // that are drawn of a duty cycle

const drafts = new Map();     // by recording the map as it is edited, the one last given, and the one shown by the server then
const plotted = new Map();    // by recording, what was ticked or unticked in the table of channels
const messages = new Map();   // sentences of refused maps and cuts, by recording
const searches = new Map();
const box = { id: "", of: "recordings", title: "Drop recordings here", accepts: "CSV, Parquet, MDF, MATLAB, BLF or ASC; or a calibration (TOML)", take, none: "No recordings here.",
  open: async (path) => { chosen = (await send("POST", "/api/recordings", { path })).id; } };
let chosen = "";
lasts("recording", { drafts, plotted, searches, get chosen() { return chosen; }, set chosen(id) { chosen = id; } });
let shown = null;             // the strips of the recording that is shown, where they are, and of what
let holderOfShown = null;
let keyOfShown = "";
let lead = null;              // leads to another stage

export function recordingStage(main, show) {
  lead = show;
  const add = h("section", { class: "add", "aria-label": "Open recordings" });
  const list = h("div", { class: "list", role: "list", "aria-label": "Recordings" });
  const details = h("div", { class: "details" });
  main.replaceChildren(h("div", { class: "columns" }, h("aside", {}, add, list), details));
  drawAdd(add, () => drawList(list, details));
  drawList(list, details);
  drawDetails(details);
  return {
    changed(these) {
      if ([...these].some((text) => text.startsWith("recording"))) {
        if (!chosen || gone.has(chosen)) chosen = all("recording").at(-1)?.id ?? "";
        drawList(list, details);
      }
      if (these.has(`recording ${chosen}`) || (chosen && details.dataset.of !== chosen)) drawDetails(details);
    },
    redraw() { shown?.redraw(); },
    end() { endStrips(); },
    choose(id) { chosen = id; drawList(list, details); drawDetails(details); },
    redrawAdd() { drawAdd(add, () => drawList(list, details)); },
  };
}

/** Send files that were dropped or chosen: calibrations by their suffix, all others as recordings, whose ids `sent` gets; what was refused. */
export async function take(files, redraw, sent = () => {}) {
  return sending(box, files, redraw, async (file, upload) => {
    const kind = file.name.toLowerCase().endsWith(".toml") ? "calibrations" : "recordings";
    const { id } = await upload(`/api/${kind}?name=${encodeURIComponent(file.name)}`);
    if (kind === "recordings") { chosen = id; sent(id); }
  });
}

const drawAdd = (add) => drawBox(add, box);

const STATES = { reading: "reading", failed: "not read", ready: "", cancelled: "stopped" };

/** Whether a fit needs the channel map of a recording, and nobody has kept one yet. */
export const unchecked = (recording) => recording.look.needs_map && !recording.look.complete && !recording.map;

/** Whether a recording is read, or may still be: one that cannot be is offered nowhere. */
export const readable = ({ status, look }) => status !== "failed" && look?.status !== "bad_input";

/** Whether a recording can be fitted, as far as its channels say. */
export const ready = (recording) => recording.look && !recording.look.checking && readable(recording);

/** Whether a recording has the channel of a quantity: a map may name a channel that only other recordings have. */
export const has = ({ look }, quantity) => look.channels.some((channel) => channel.heading === look.map[quantity]?.channel);

/** What a recording holds, in two words. */
export function contents(recording) {
  if (!recording.look) return "reading";
  return has(recording, "pressure_a") ? "with pressure" : "position only";
}

/** The grade of the worst check of a recording. */
export function worst(recording) {
  if (!readable(recording)) return "bad";
  if (!recording.look || recording.look.checking) return "";
  if (unchecked(recording)) return "suspect";
  const grades = recording.look.checks.map((check) => check.grade);
  return grades.includes("bad") ? "bad" : grades.includes("suspect") || recording.look.warnings.length ? "suspect" : grades.length ? "good" : "";
}

function drawList(list, details) {
  fill(list, all("recording").map((recording) => item(recording.id, recording.id === chosen, worst(recording), recording.name, STATES[recording.status] || bytes(recording.size),
    () => { chosen = recording.id; drawList(list, details); drawDetails(details); })));
}

/** The map that is shown: as edited, or else as given or proposed. A saved map stays until the server shows it. */
function draftOf(recording) {
  const kept = drafts.get(recording.id);
  const shown = JSON.stringify(recording.look.map);
  if (kept && (isEdited(recording) || kept.shown === shown)) return kept.map;
  const map = structuredClone(recording.look.map);
  drafts.set(recording.id, { map, given: shown, shown });
  return map;
}

function isEdited(recording) {
  const kept = drafts.get(recording.id);
  return Boolean(kept) && JSON.stringify(kept.map) !== kept.given;
}

/** The channels of a recording: number of the time grid, stored column, and what look says of them. */
function channelsOf(recording) {
  const { channels, grids, plots } = recording.look;
  const found = [];
  let next = 0;
  grids.forEach((grid, g) => plots[g].forEach((column) => {
    const channel = channels[next++];
    if (channel) found.push({ ...channel, grid: g, column, key: `${g} ${column}` });
  }));
  return found;
}

function quantityOf(draft, channel, several) {
  const match = Object.entries(draft).find(([, entry]) => entry.channel === channel.heading && (!several || !entry.group || entry.group === channel.group));
  return match ? match[0] : "";
}

/** The value that is shown, its unit, and what it is called, for a channel with an entry of the map. */
function meaning(channel, quantity, entry, ambient) {
  const unit = about.units[entry?.unit || channel.unit];
  const si = quantity ? about.quantities[quantity] : channel.si;
  if (!unit || !si || unit.si !== si) return { title: channel.unit || "as written", unit: channel.unit || "", value: scaled(entry, (x) => x) };
  const [name, factor, shift = 0] = SHOWN[si] ?? [si, 1];
  const zero = unit.offset + (unit.gauge ? ambient : 0);
  return { title: TITLES[si] ?? quantity ?? si, unit: name, value: scaled(entry, (x) => factor * (unit.scale * x + zero) + shift) };
}
const scaled = (entry, convert) => (entry ? (x) => convert(entry.sign * entry.factor * x + entry.offset) : convert);

function drawDetails(details) {
  const recording = one("recording", chosen);
  details.dataset.of = chosen;
  if (!recording?.look || stripsKey(recording) !== keyOfShown) endStrips();
  if (!recording) {
    fill(details, h("div", { class: "empty" }, h("h2", {}, "Recordings"),
      h("p", {}, "Open a recording of the clutch actuator: position, duty cycles of the valves and, for a calibration, the pressure in the chamber."),
      h("ol", {}, h("li", {}, "Look at it here, and see what the checks say."), h("li", {}, "Calibrate the new clutch under “Load”."),
        h("li", {}, "Estimate the load of the worn clutch, and compare the two."))));
    return;
  }
  const head = h("div", { class: "head" }, h("h2", {}, named(recording.name)),
    h("button", { type: "button", class: "plain", onclick: () => forget(recording) }, "Forget this recording"));
  if (!recording.look) {
    fill(details, head, recording.message ? notice(recording.message) : h("p", { class: "hint" }, "Reading …"));
    return;
  }
  const { look } = recording;
  const time = look.grids[0]?.time;
  const facts = [look.format, plural(look.grids.length, "time grid"), look.grids.length && `${look.grids[0].samples.toLocaleString("en")} samples`,
    time && `${short(time.last_s - time.first_s, 4)} s`, time?.usual_interval_s && `${short(1 / time.usual_interval_s, 4)} Hz`].filter(Boolean);
  const plots = shown ? holderOfShown : h("section", { "aria-label": "Samples" });  // what was zoomed stays so
  const channels = h("section", { "aria-label": "Channels" });
  const usable = readable(recording);
  fill(details, head, h("p", { class: "facts" }, facts.join(" · ")),
    recording.status === "failed" && notice(recording.message), look.status === "bad_input" && notice(look.message),
    usable && look.needs_map && !recording.map && (look.complete ? h("p", { class: "hint" }, "The channels were recognised by their names. They are listed below.") :
      h("div", { class: "notice care" }, "Some of the channels below are guessed. Check them, then keep the map:", h("ul", {}, look.remarks.map((text) => h("li", {}, text))))),
    ...(look.channels.length ? [plots, channels] : []), usable && drawChecks(recording), drawStrokes(recording));
  if (!look.channels.length) return;
  drawChannels(channels, recording, () => drawStrips(plots, recording, () => drawDetails(details)));
  if (!shown) drawStrips(plots, recording, () => drawDetails(details));
}

function endStrips() {
  shown?.end();
  shown = null;
}

/** What the strips of a recording depend on. */
const stripsKey = (recording) => JSON.stringify([recording.id, draftOf(recording), [...selection(recording)], recording.look.grids, recording.look.ambient]);

async function forget(recording) {
  for (const kept of [drafts, plotted, messages, searches]) kept.delete(recording.id);
  await send("DELETE", `/api/recordings/${recording.id}`);
}

/** The channels that are plotted, unless they were ticked or unticked: those that the map names, and the candidates of a duty cycle that it lacks. */
function selection(recording) {
  const several = recording.look.grids.length > 1;
  const [draft, every, ticked] = [draftOf(recording), channelsOf(recording), plotted.get(recording.id)];
  const mapped = every.filter((channel) => !["", "time"].includes(quantityOf(draft, channel, several)));
  const lacking = ["duty_supply", "duty_exhaust"].some((name) => !draft[name]);
  const candidates = lacking ? every.filter((channel) => channel.si === "1" && channel.high > channel.low && !mapped.includes(channel)) : [];
  const usual = new Set(mapped.length ? [...mapped, ...candidates.slice(0, MOST_CANDIDATES)] : every.slice(1, 4));
  return new Set(every.filter((channel) => ticked?.get(channel.key) ?? usual.has(channel)).map((channel) => channel.key));
}

function tick(recording, key, wanted) {
  if (!plotted.has(recording.id)) plotted.set(recording.id, new Map());
  plotted.get(recording.id).set(key, wanted);
}

function drawStrips(holder, recording, refused) {
  endStrips();
  const { look } = recording;
  const several = look.grids.length > 1;
  const draft = draftOf(recording);
  const panels = new Map();
  const chosenOnes = selection(recording);
  for (const channel of channelsOf(recording)) {
    if (!chosenOnes.has(channel.key)) continue;
    const quantity = quantityOf(draft, channel, several);
    const entry = draft[quantity];
    const { title, unit, value } = meaning(channel, quantity, entry, look.ambient);
    const key = `${title} ${unit}`;
    if (!panels.has(key)) panels.set(key, { title, unit, series: [] });
    const { series } = panels.get(key);
    const label = quantity && quantity !== channel.heading ? `${quantity} (${channel.heading})` : channel.heading;
    series.push({ label, colour: SERIES[series.length % SERIES.length], grid: channel.grid, column: channel.column, value, delay: entry?.delay || 0 });
  }
  const spans = look.grids.map((grid) => grid.time ? [grid.time.first_s, grid.time.last_s] : [0, Math.max(grid.samples - 1, 1)]);
  if (!panels.size || !spans.length) { fill(holder, h("p", { class: "hint" }, "Choose the channels to plot in the table below.")); return; }
  const span = [Math.min(...spans.map((one) => one[0])), Math.max(...spans.map((one) => one[1]))];
  if (!(span[1] > span[0])) span[1] = span[0] + 1;
  [holderOfShown, keyOfShown] = [holder, stripsKey(recording)];
  shown = strips(holder, { panels: [...panels.values()], span, ranged: unchecked(recording) ? [] : RANGED.map(([text, label, act]) => [text, label, (range) => act(recording, range, refused)]), read: (...rest) => points(`/api/recordings/${recording.id}/plot`, ...rest) });
}

function drawChannels(holder, recording, replot) {
  const { look } = recording;
  const draft = draftOf(recording);
  const several = look.grids.length > 1;
  const search = searches.get(recording.id) ?? "";
  const every = channelsOf(recording);
  const found = every.filter((channel) => `${channel.heading} ${channel.group} ${channel.unit ?? ""}`.toLowerCase().includes(search.toLowerCase()));
  const drawn = selection(recording);
  const redraw = () => { drawChannels(holder, recording, replot); replot(); };
  const number = (entry, name, label, width = 5) => h("input", { type: "number", step: "any", class: `w${width}`, value: String(entry[name]), "aria-label": label,
    onchange: (event) => { entry[name] = Number(event.target.value) || (name === "factor" ? 1 : 0); redraw(); } });
  const rows = found.slice(0, MOST_CHANNELS).map((channel, index) => {
    const quantity = quantityOf(draft, channel, several);
    const entry = draft[quantity];
    const known = Object.entries(about.units).filter(([, unit]) => !quantity || unit.si === about.quantities[quantity]).map(([name]) => name);
    const unit = entry?.unit || channel.unit || "";
    return h("tr", {},
      h("td", {}, h("input", { type: "checkbox", id: `plot-${index}`, checked: drawn.has(channel.key), "aria-label": `Plot ${channel.heading}`,
        onchange: (event) => { tick(recording, channel.key, event.target.checked); replot(); } })),
      h("th", { scope: "row", class: "channel" }, named(channel.heading), several && channel.group && h("span", { class: "hint" }, ` ${channel.group}`)),
      h("td", {}, h("select", { id: `quantity-${index}`, "aria-label": `Quantity of ${channel.heading}`, onchange: (event) => {
        if (quantity) delete draft[quantity];
        const name = event.target.value;
        if (name) draft[name] = { channel: channel.heading, group: several ? channel.group : null, unit: null, sign: 1, factor: 1, offset: 0, delay: 0, longest: null, ...entry };
        redraw();
      } }, h("option", { value: "" }, "–"), Object.keys(about.quantities).map((name) => h("option", { value: name, selected: name === quantity }, name)))),
      h("td", {}, entry ? h("select", { "aria-label": `Unit of ${channel.heading}`, id: `unit-${index}`, onchange: (event) => { entry.unit = event.target.value || null; redraw(); } },
        h("option", { value: "", selected: !known.includes(unit) }, known.includes(channel.unit) ? channel.unit : "unit?"),
        known.filter((name) => name !== channel.unit).map((name) => h("option", { value: name, selected: name === unit }, name))) : channel.unit),
      h("td", {}, entry && quantity !== "time" && h("button", { type: "button", class: "plain sign", id: `sign-${index}`, "aria-label": `Sign of ${channel.heading}: ${entry.sign < 0 ? "minus" : "plus"}`,
        onclick: () => { entry.sign = -entry.sign; redraw(); } }, entry.sign < 0 ? "−" : "+")),
      h("td", {}, entry && quantity !== "time" && number(entry, "factor", `Factor of ${channel.heading}`)),
      h("td", {}, entry && quantity !== "time" && number(entry, "offset", `Offset of ${channel.heading} in its unit`)),
      h("td", {}, entry && quantity !== "time" && number(entry, "delay", `Delay of ${channel.heading} in s`)),
      h("td", { class: "number" }, `${short(channel.low, 4)} to ${short(channel.high, 4)}`),
      h("td", { class: "number" }, channel.missing ? channel.missing.toLocaleString("en") : "0"));
  });
  const absent = Object.entries(draft).filter(([, entry]) => !every.some((channel) => channel.heading === entry.channel)).map(([name, entry]) => h("tr", { class: "absent" }, h("td", {}),
    h("th", { scope: "row", class: "channel" }, named(entry.channel), h("span", { class: "hint" }, " not in this recording")), h("td", {}, name),
    h("td", { colSpan: 7 }, h("button", { type: "button", class: "plain", "aria-label": `Remove ${name} from the map`, onclick: () => { delete draft[name]; redraw(); } }, "Remove from the map"))));
  const changed = isEdited(recording);
  const ambient = h("input", { id: "ambient", class: "w7", value: recording.ambient, placeholder: "1.013bar" });
  const put = async (map, then) => {
    try {
      await send("PUT", `/api/recordings/${recording.id}/map`, { ...map, ambient: ambient.value });
      messages.delete(recording.id);
      then();
    } catch (problem) { messages.set(recording.id, problem.message); drawChannels(holder, recording, replot); }
  };
  const apply = () => put({ channels: draft }, () => Object.assign(drafts.get(recording.id) ?? {}, { given: JSON.stringify(draft) }));
  const use = async (text) => put({ toml: await text }, () => drafts.delete(recording.id));
  const calibrated = all("result").filter((result) => result.map && result.found?.is_calibration);
  const mapped = [...all("recording").filter((other) => other.map && other.id !== recording.id), ...calibrated];
  const useOf = async (id) => use((await fetch(`/api/${id.split("-")[0]}s/${id}/map.toml`)).text());
  const usual = recording.map ? null : calibrated.at(-1);
  const others = look.grids.flatMap((grid) => grid.without_numbers);
  fill(holder, h("h3", {}, "Channels"),
    h("div", { class: "tools" }, h("input", { type: "search", id: "search", placeholder: `Search ${plural(every.length, "channel")}`, value: search, "aria-label": "Search channels",
      oninput: (event) => { searches.set(recording.id, event.target.value); const at = event.target.selectionStart; drawChannels(holder, recording, replot); document.getElementById("search").setSelectionRange(at, at); } }),
    h("label", { for: "ambient" }, "Ambient pressure"), ambient,
    (changed || readable(recording)) && h("button", { type: "button", id: "apply", onclick: apply, class: changed || unchecked(recording) ? "" : "plain" }, changed ? "Apply the map and check" : "Keep this map and check"),
    changed && h("button", { type: "button", class: "plain", onclick: () => { drafts.delete(recording.id); redraw(); } }, "Undo"),
    h("label", { class: "button plain" }, "Use a map …", h("input", { type: "file", id: "use-map", accept: ".toml", class: "hidden", onchange: ({ target }) => target.files.length && use(target.files[0].text()) })),
    usual && h("button", { type: "button", id: "map-of-calibration", class: "plain", onclick: () => useOf(usual.id) }, `Use the map of ${usual.name}`),
    mapped.length > 0 && h("select", { id: "map-of", "aria-label": "Use the map of another recording or of a calibration", onchange: ({ target }) => useOf(target.value) },
      h("option", { value: "" }, "Use the map of …"), mapped.map((other) => h("option", { value: other.id }, other.name))),
    recording.map && h("a", { class: "button plain", href: `/api/recordings/${recording.id}/map.toml`, download: "" }, "map.toml")),
    notice(messages.get(recording.id)),
    table(["plot", "channel", "quantity", "unit", "sign", "factor", "offset", "delay [s]", "range in the file", "missing"], [...rows, ...absent], { name: "stack", scroll: "Table of channels" }),
    found.length > MOST_CHANNELS && h("p", { class: "hint" }, `${found.length - MOST_CHANNELS} more channels: use the search.`),
    others.length ? h("p", { class: "hint" }, `Channels without numbers: ${others.slice(0, 20).map((other) => `${other.channel} (${other.holds})`).join(", ")}`) : null);
}

function drawChecks(recording) {
  const { look } = recording;
  if (look.checking) return h("section", {}, h("h3", {}, "Checks"), h("p", { class: "hint" }, "Checking …"));
  const poor = { bad: 0, suspect: 1, undetermined: 2, good: 3 };
  const rows = [...look.checks].sort((a, b) => poor[a.grade] - poor[b.grade]).map((check) => {
    const place = check.begin_s !== null;
    return h("tr", {}, h("td", {}, badge(check.grade, check.grade)), h("th", { scope: "row" }, check.name), h("td", {}, check.value,
      check.grade !== "good" && h("p", { class: "sentence" }, check.sentence),
      place && check.grade !== "good" && h("button", { type: "button", class: "plain", onclick: () => shown?.mark(check.begin_s, check.end_s) }, "Show the place")));
  });
  return h("section", { "aria-label": "Checks" }, h("h3", {}, "Checks before a fit"),
    rows.length ? h("table", { class: "checks" }, h("tbody", {}, rows)) : notice(look.message, "care"),
    look.warnings.length ? h("ul", { class: "notes" }, look.warnings.map((text) => h("li", {}, text))) : null,
    look.notes.length ? folded("assumed", "Assumptions about the file", h("ul", { class: "notes" }, look.notes.map((text) => h("li", {}, text)))) : null);
}

/** Make a recording of a range of time, and show it; its id. */
async function cut(recording, span, redraw) {
  try {
    const { id } = await send("POST", `/api/recordings/${recording.id}/cut`, { span });
    messages.delete(recording.id);
    chosen = id;
    return id;
  } catch (problem) { messages.set(recording.id, problem.message); redraw(); }
  return "";
}

/** What is done with a range of time that is shown. */
const RANGED = [
  ["Fit this range", "Fit this range: cut it out and choose it under “Load”", async (recording, span, refused) => {
    const id = await cut(recording, span, refused);
    if (id) lead("load", id, recording.id);
  }],
  ["Cut out this range", "Cut out this range of time as a recording of its own", (recording, span, refused) => cut(recording, span, refused)],
];

function drawStrokes(recording) {
  const { strokes = [] } = recording.look;
  const only = strokes.filter((stroke) => stroke.kind === "stroke");
  if (!only.length) return null;
  return h("section", { "aria-label": "Strokes" }, folded("strokes", h("h3", {}, plural(only.length, "stroke")),
    h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Table of strokes" }, h("table", {}, h("tbody", {}, only.slice(0, 500).map((stroke) => h("tr", {},
      h("td", { class: "number" }, `${short(stroke.begin)} to ${short(stroke.end)} s`),
      h("td", {}, h("button", { type: "button", class: "plain", onclick: () => shown?.mark(stroke.begin, stroke.end) }, "Show")))))))));
}
