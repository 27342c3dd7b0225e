// The stage "Vehicle and fleet": the vehicles of a fleet, and of one its trend with alarms and forecast, and its loads.
import { all, drawBox, fill, gone, h, item, lasts, named, notice, one, plural, send, sending, short, table, trusted } from "./page.js";
import { curves, trends } from "./curves.js";

const PART = 100;             // vehicles that are shown at a time
const states = new Map();     // of a fleet: filter, sort, part; of a vehicle: its loads that are overlaid, forecast
let chosen = "";
lasts("vehicle", { states, get chosen() { return chosen; }, set chosen(id) { chosen = id; } });
let running = null;           // what draws and must be ended
const box = { id: "tables-", of: "tables", title: "Drop results of track or fleet here", none: "No results here.", take,
  accepts: "FILE.parquet and FILE.load.parquet of clutchid track, or the tables of clutchid fleet",
  open: async (path) => { chosen = (await send("POST", "/api/tables", { path })).id; } };

export function vehicleStage(main) {
  const add = h("section", { class: "add", "aria-label": "Open results" });
  const list = h("div", { class: "list", role: "list", "aria-label": "Opened results" });
  const details = h("div", { class: "details" });
  main.replaceChildren(h("div", { class: "columns" }, h("aside", {}, add, list), details));
  let drawn = "";
  const draw = (these) => {
    if (these && ![...these].some((text) => text.startsWith("table"))) return;
    if ((!chosen || gone.has(chosen)) && !awaited()) chosen = all("table").at(-1)?.id ?? "";
    drawList(list, draw);
    const table = one("table", chosen);
    const now = JSON.stringify([chosen, table?.status, table?.message, Boolean(table?.found)]);
    if (now === drawn) return;
    drawn = now;
    running?.end();
    running = null;
    drawDetails(details, table, draw);
  };
  drawBox(add, box);
  draw();
  return {
    changed: draw, redraw() { running?.redraw(); }, end() { running?.end(); running = null; },
    take(files) { take(files, () => drawBox(add, box)); },
  };
}

/** Whether the chosen vehicle has been requested, and is not among the events yet. */
const awaited = () => chosen !== "" && !seen.has(chosen);
const seen = new Set();

/** Send the files of one run: the first is what is opened, the others are read beside it. */
async function take(files, redraw) {
  const place = ({ name }) => (/\.load\.|^part-/.test(name) ? 2 : name === "vehicles.parquet" ? 0 : 1);
  let first = "";
  await sending(box, [...files].sort((a, b) => place(a) - place(b)), redraw, async (file, upload) => {
    const { id } = await upload(`/api/tables?${new URLSearchParams({ name: file.name, ...(first && { beside: first }) })}`);
    first = chosen = id;
  });
}

function open(id, draw) {
  chosen = id;
  draw();
  scrollTo(0, 0);
}

const kindOf = (table) => table.vehicle ?? (table.found?.kind === "vehicle" ? table.found.vehicle || table.name : "");

function drawList(list, draw) {
  for (const table of all("table")) seen.add(table.id);
  fill(list, all("table").map((one) => item(one.id, one.id === chosen, dot(one), kindOf(one) || `fleet in ${one.folder}`,
    !one.found ? (one.status === "failed" ? "not read" : "reading") : one.found.kind === "fleet" ? plural(one.found.count, "vehicle") : "", () => open(one.id, draw))));
}

/** Whether a vehicle was tracked, and none of its recordings has a load. */
const unread = ({ recordings, trend }) => !trend && recordings.some((row) => row.outcome);

/** The mark of a table: bad where it cannot be read or a vehicle has no load, suspect for a vehicle with an alarm. */
function dot({ status, found }) {
  if (status === "failed") return "bad";
  if (found?.kind !== "vehicle") return found ? "good" : "";
  return unread(found) ? "bad" : found.trend?.alarms.length ? "suspect" : "good";
}

function drawDetails(details, table, draw) {
  if (!table) {
    fill(details, h("div", { class: "empty" }, h("h2", {}, "Vehicle and fleet"), h("p", {}, "Open what clutchid track or clutchid fleet has written."), h("ul", {},
      h("li", {}, "A vehicle: the trend of its load and wear, its alarms, the life left, and the load of every recording."),
      h("li", {}, "A fleet: a table of all vehicles to sort and filter. Click a vehicle to open it."))));
    return;
  }
  const fleet = table.vehicle !== null && all("table").find((other) => other.path === table.path && other.vehicle === null && other.found?.kind === "fleet");
  const head = h("div", { class: "head" }, h("h2", {}, named(kindOf(table) || `Fleet in ${table.folder}`)), h("div", { class: "buttons" },
    fleet && h("button", { type: "button", id: "to-fleet", class: "plain", onclick: () => open(fleet.id, draw) }, "◀ Back to the fleet"),
    h("button", { type: "button", class: "plain", onclick: () => send("DELETE", `/api/tables/${table.id}`) }, "Forget")));
  if (!table.found) { fill(details, head, table.message ? notice(table.message) : h("p", { class: "hint" }, "Reading …")); return; }
  if (table.found.kind === "fleet") drawFleet(details, head, table, draw);
  else drawVehicle(details, head, table);
}

// a fleet

const infinite = (value) => (value === "inf" ? Infinity : value);

/** A value with its interval, as text: ∞ is more than five lives. */
function interval(band, shown) {
  if (!band) return "–";
  const [value, low, high] = band.map((side) => (side === null ? "–" : shown(infinite(side))));
  return [value, h("span", { class: "soft" }, ` ${low} to ${high}`)];
}

const decimals = (digits, factor = 1) => (value) => (Number.isFinite(value) ? (factor * value).toFixed(digits).replace("-", "−") : value < 0 ? "−∞" : "∞");
const signed = (digits, factor = 1) => (value) => {
  const text = decimals(digits, factor)(value);
  return Number(text.replace("−", "")) === 0 ? text.replace("−", "") : text.startsWith("−") ? text : `+${text}`;
};
const rounded = (value) => (Number.isFinite(value) ? Number(value.toPrecision(2)).toLocaleString("en") : "∞");
/** The alarms of a vehicle without their places, which its own page has. */
const alarmKinds = (text) => [...new Set(text.split("; ").map((words) => words.split(/ (?:between|before) /)[0]))].join("; ");

/** The columns of a fleet that have values: title, what it is sorted by, and its cell, for a row. */
function columnsOf({ vehicles, lives }) {
  const axes = new Set(vehicles.axis.filter((axis, i) => axis && vehicles.left[i]));
  const unit = axes.size === 1 ? ` [${[...axes][0]}]` : "";
  const band = (name, title, shown) => ({ name, title, number: true, sort: (i) => infinite(vehicles[name][i]?.[0] ?? null), cell: (i) => interval(vehicles[name][i], shown) });
  const text = (name, title) => ({ name, title, sort: (i) => vehicles[name][i] || null, cell: (i) => vehicles[name][i] || "–" });
  const due = Object.keys(vehicles).filter((name) => name.startsWith("p_within_")).map((name) => ({ name, number: true,
    title: `due within ${name.slice(9).replace("_", " ")} [%]`, sort: (i) => vehicles[name][i], cell: (i) => (vehicles[name][i] === null ? "–" : decimals(1, 100)(vehicles[name][i])) }));
  return [
    text("type", "type"), ...due,
    { ...text("last", "last"), cell: (i) => h("span", { class: "date" }, vehicles.last[i]?.slice(0, 10) ?? "–") },
    { name: "counted", title: "recordings", number: true, sort: (i) => vehicles.counted[i], cell: (i) => `${vehicles.counted[i]} of ${vehicles.recordings[i]}` },
    { name: "trust", title: "trust", sort: (i) => ["good", "with care", "none"].indexOf(vehicles.trust[i]), cell: (i) => trusted(vehicles.trust[i]) },
    { ...text("alarms", "alarms"), cell: (i) => (vehicles.alarms[i] ? h("span", { class: "alarm" }, alarmKinds(vehicles.alarms[i])) : "") },
    { ...band("left", `life left${unit}`, rounded), sort: (i) => (vehicles.left[i] ? infinite(vehicles.left[i][0]) / (axes.size > 1 ? lives[vehicles.axis[i]] : 1) : null),
      cell: (i) => [interval(vehicles.left[i], rounded), axes.size > 1 && vehicles.left[i] ? ` ${vehicles.axis[i]}` : ""] },
    band("wear", "wear [mm]", signed(2)), band("shift", "shift [mm]", signed(3)), band("load", "load [%]", signed(1, 100)),
    band("peak", "greatest load [N]", decimals(0)), band("half_load", "half load at [mm]", decimals(2)),
  ].filter((column) => vehicles[column.name].some((value) => value !== null && value !== ""));
}

function drawFleet(details, head, { id, found }, draw) {
  const { vehicles } = found;
  const order = new Intl.Collator("en", { numeric: true });
  const columns = [{ name: "vehicle", title: "vehicle", sort: (i) => vehicles.vehicle[i] }, ...columnsOf(found)];
  const first = columns.find(({ name }) => name.startsWith("p_within_"))?.name ?? "";
  if (!states.has(id)) states.set(id, { filter: "", sort: first, up: !first, part: 0 });
  const state = states.get(id);
  const words = vehicles.vehicle.map((name, i) => `${name}\n${vehicles.type[i] ?? ""}\n${vehicles.trust[i] ?? ""}\n${vehicles.alarms[i] ?? ""}\n${vehicles.last[i] ?? ""}`.toLowerCase());
  const refused = h("div", {});
  const holder = h("div", {});
  const count = h("span", { class: "hint", role: "status" });
  const [earlier, later] = [[-1, "◀ Earlier"], [1, "Later ▶"]].map(([step, text]) => h("button", { type: "button", class: "plain", onclick: () => { state.part += step; show(); } }, text));
  const heads = columns.map((column) => h("th", { scope: "col", class: column.number ? "number" : null }, h("button", { type: "button", class: "sort", id: `sort-${column.name}`,
    onclick: () => { state.up = state.sort === column.name ? !state.up : true; state.sort = column.name; state.part = 0; show(); } }, column.title)));
  const go = async (name) => {
    try { open((await send("POST", `/api/tables/${id}/vehicles`, { vehicle: name })).id, draw); }
    catch (problem) { fill(refused, notice(problem.message)); }
  };
  const known = (value) => value !== null && value !== undefined && value !== -1;
  function show() {
    const indices = vehicles.vehicle.map((_, i) => i).filter((i) => words[i].includes(state.filter.toLowerCase()));
    const column = columns.find((each) => each.name === state.sort);
    if (column) {
      indices.sort((i, j) => {
        const [a, b] = [column.sort(i), column.sort(j)];
        if (!known(a) || !known(b)) return known(b) - known(a);  // unknown ones are last in either order
        const difference = typeof a === "number" ? (a === b ? 0 : a - b) : order.compare(a, b);
        return state.up ? difference : -difference;
      });
    }
    const parts = Math.max(1, Math.ceil(indices.length / PART));
    state.part = Math.min(Math.max(0, state.part), parts - 1);
    const these = indices.slice(state.part * PART, (state.part + 1) * PART);
    heads.forEach((cell, k) => {
      if (columns[k].name === state.sort) cell.setAttribute("aria-sort", state.up ? "ascending" : "descending");
      else cell.removeAttribute("aria-sort");
    });
    fill(holder, table(heads, these.map((i) => h("tr", { class: "row", onclick: (event) => event.target.closest("button") || getSelection().toString() || go(vehicles.vehicle[i]) },
      h("th", { scope: "row" }, h("button", { type: "button", class: "link", id: `vehicle-${i}`, onclick: () => go(vehicles.vehicle[i]) }, vehicles.vehicle[i] || "without a name")),
      columns.slice(1).map((each) => h("td", { class: each.number ? "number" : null }, each.cell(i))))), { name: "fleet stack", scroll: "Table of vehicles" }));
    count.textContent = indices.length ? `${(state.part * PART + 1).toLocaleString("en")} to ${(state.part * PART + these.length).toLocaleString("en")} of ${indices.length.toLocaleString("en")}` : "no vehicle matches";
    [earlier.hidden, later.hidden] = [parts === 1, parts === 1];
    [earlier.disabled, later.disabled] = [state.part === 0, state.part === parts - 1];
  }
  const alarmed = vehicles.alarms.filter(Boolean).length;
  fill(details, head, h("p", { class: "facts" }, [plural(found.count, "vehicle"), found.trends ? plural(alarmed, "vehicle").concat(" with an alarm") : "no trends: clutchid fleet --verb track writes them"].join(" · ")), refused,
    found.count > vehicles.vehicle.length && notice(`Only the first ${vehicles.vehicle.length.toLocaleString("en")} vehicles are shown; the page of the fleet, index.html in its folder, has all.`, "care"),
    h("div", { class: "tools" }, h("label", { for: "filter" }, "Filter"), h("input", { type: "search", id: "filter", value: state.filter, placeholder: "name, type, trust, alarm", oninput: (event) => { state.filter = event.target.value; state.part = 0; show(); } }), count, earlier, later),
    holder,
    h("p", { class: "hint" }, "Click a heading to sort, or a vehicle to open it. Due is the probability to reach the limit. Values are those at the last recording, and changes are since the calibration. Intervals are 95 %, that of the life left 90 %; ∞ is more than five lives."),
    found.tables.map(({ title, heads: titles, rows, note }) => h("section", {}, h("h3", {}, title),
      table(titles, rows.map(([name, ...cells]) => h("tr", {}, h("th", { scope: "row" }, name), cells.map((cell) => h("td", {}, cell)))), { name: "stack", scroll: title }), note && h("p", { class: "hint" }, note))));
  show();
}

// a vehicle

const LABELS = { wear: "wear of the facing", shift: "half-load position", load: "load over 5 to 8 mm" };
const SHOWN = { wear: ["mm", signed(2, 1e3)], shift: ["mm", signed(3, 1e3)], load: ["%", signed(1, 100)] };

function drawVehicle(details, head, { id, found }) {
  const { recordings, trend, loads } = found;
  if (!states.has(id)) {
    const counts = loads.filter((load) => ["used", "jump", undefined, null].includes(recordings.find((row) => row.recording === load.recording)?.outcome));
    const ends = (counts.length ? counts : loads).map((load) => load.recording);
    states.set(id, { shown: new Set([ends[0], ends.at(-1)].filter(Boolean)), forecast: null });
  }
  const state = states.get(id);
  const last = recordings.slice(0, trend?.along.length).findLast((row) => row.trust);  // those without a load come last
  const dates = recordings.map((row) => row.begin?.slice(0, 10)).filter(Boolean).sort();
  const facts = [found.type && `type ${found.type}`, trend ? `${trend.counted} of ${plural(recordings.length, "recording")} count` : plural(recordings.length, "recording"),
    trend && trend.axis !== "recordings" && `over ${Math.round(trend.along.at(-1) - trend.along[0]).toLocaleString("en")} ${trend.axis}`, dates.length && `${dates[0]} to ${dates.at(-1)}`].filter(Boolean);
  const [chart, panels] = [h("div", { class: "chart", id: "chart-loads" }), h("div", { id: "trends" })];
  const alarms = trend?.alarms ?? [];
  fill(details, head, h("p", { class: "facts" }, facts.join(" · "), last && [" · ", trusted(last.trust, "trust "), ` of ${last.recording}`]),
    alarms.length ? h("div", { class: "notice bad" }, h("ul", {}, alarms.map((alarm) => h("li", {}, alarm.words)))) : null,
    trend ? now(trend, alarms) : unread(found) ? notice("This vehicle has no trend, because none of its recordings gave a load. The table says why.")
      : notice("This vehicle has no trend. clutchid track writes one, and so does clutchid fleet --verb track.", "care"), panels,
    chart, tableOfLoads());
  const drawLoads = () => {
    const these = loads.filter((load) => state.shown.has(load.recording));
    return curves(chart, "Load of the clutch", these.map((load, k) => ({ label: load.recording, colour: colourOf(k, these.length), position: load.curve.position_m, force: load.curve.force_N, low: load.curve.low_N, high: load.curve.high_N })));
  };
  const plots = trend ? trends(panels, trend, recordings, state) : null;
  let plot = drawLoads();
  running = { redraw() { plots?.redraw(); plot?.end(); plot = drawLoads(); }, end() { plots?.end(); plot?.end(); } };

  function tableOfLoads() {
    const some = (of) => recordings.some((row) => of(row) !== null && of(row) !== undefined && of(row) !== "");
    const known = new Set(loads.map((load) => load.recording));
    const value = (shown) => (x) => (x === null || x === undefined ? "–" : shown(x));
    const columns = [
      [(row) => row.begin, "date", (row) => h("span", { class: "date" }, row.begin?.slice(0, 10) ?? "–")], [(row) => row.strokes, "strokes", (row) => value((x) => x.toLocaleString("en"))(row.strokes), true],
      [(row) => row.trust, "trust", (row) => trusted(row.trust)], [(row) => row.outcome, "in the trend", (row) => row.outcome ?? "–"],
      [(row) => row.change, "load [%]", (row) => value(signed(1, 100))(row.change), true], [(row) => row.shift, "shift [mm]", (row) => value(signed(3, 1e3))(row.shift), true],
      ...found.places.map((place, k) => [(row) => row.at, `at ${place} mm [N]`, (row) => interval(row.at?.[k], decimals(0)), true]),
      [(row) => row.half_load, "half load at [mm]", (row) => interval(row.half_load, decimals(2, 1e3)), true],
      [(row) => row.odometer, "km", (row) => value((x) => Math.round(x).toLocaleString("en"))(row.odometer), true],
      [(row) => row.said, "reason or message", (row) => h("span", { class: "alarm" }, row.said)],
    ].filter(([of]) => some(of));
    const alarmed = new Set(alarms.map((alarm) => alarm.index));
    return h("section", { "aria-label": "Loads over time" }, h("h3", {}, "Loads over time"),
      table(["plot", "recording", ...columns.map(([, title, , number]) => h("th", { scope: "col", class: number ? "number" : null }, title))],
        recordings.map((row, i) => h("tr", { class: alarmed.has(i) ? "alarmed" : null },
          h("td", {}, known.has(row.recording) && h("input", { type: "checkbox", checked: state.shown.has(row.recording), "aria-label": `Plot the load of ${row.recording}`,
            onchange: (event) => { state.shown[event.target.checked ? "add" : "delete"](row.recording); plot?.end(); plot = drawLoads(); } })),
          h("th", { scope: "row" }, named(row.recording)), columns.map(([, , cell, number]) => h("td", { class: number ? "number" : null }, cell(row))))), { name: "fleet stack", scroll: "Table of loads" }),
      h("p", { class: "hint" }, `Loads have 95 % intervals.${alarmed.size ? " A bar at the left marks a recording with an alarm." : ""}`,
        found.load_count > loads.length ? ` ${loads.length} of ${found.load_count} loads can be plotted, evenly over the life.` : loads.length ? "" : " No loads of this vehicle lie beside this file (FILE.load.parquet, or recordings/ of a fleet), so none is plotted."));
  }
}

const colourOf = (k, count) => (k === count - 1 ? 0 : k === 0 ? 5 : 1 + ((k - 1) % 4));  // the last in blue, the first in ink

/** What is known at the last recording, and what is left. */
function now(trend, alarms) {
  const line = (name) => {
    const [unit, shown] = SHOWN[name];
    const [value, sides] = interval(trend.now[name], shown);
    return trend.now[name][0] === null ? null : [h("dt", {}, LABELS[name]), h("dd", {}, `${value} ${unit}`, sides)];
  };
  return h("dl", { class: "summary wide" }, Object.keys(LABELS).filter((name) => name in trend.now).map(line), h("dt", {}, "life left"), h("dd", { id: "left" }, left(trend)),
    alarms.length ? null : [h("dt", {}, "alarms"), h("dd", {}, "none")]);
}

function left({ axis, left: band, limit }) {
  if (limit === null) return "unknown without a limit: give --limit, or a table of wear";
  const end = `${short(1e3 * limit.value, 3)} mm of ${limit.of}`;
  if (!band) return `unknown: after a sudden change of the load, or without a reading, nobody can say when ${end} is reached`;
  const [median, low, high] = band.map(infinite);
  if (!Number.isFinite(low)) return `the trend does not reach ${end}`;
  return [`${rounded(median)} ${axis} to ${end} `, h("span", { class: "soft" }, `${rounded(low)} to ${rounded(high)}, 90 %`)];
}
