// What all parts of the page use: elements from text, requests, the objects of the server, numbers in words, boxes for files.

/** An element; children that are texts stay texts, so that no name of a file or channel becomes markup. */
export function h(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "class") element.className = value;
    else if (name in element && typeof value !== "string") element[name] = value;
    else element.setAttribute(name, value === true ? "" : value);
  }
  for (const child of children.flat(Infinity)) {
    if (child === null || child === undefined || child === false) continue;
    element.append(child instanceof Node ? child : String(child));
  }
  return element;
}

/** Replace the content of an element, and keep the focus where an element with the same id is there again. */
export function fill(element, ...children) {
  const focused = element.contains(document.activeElement) ? document.activeElement.id : "";
  element.replaceChildren(...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false));
  if (focused) document.getElementById(focused)?.focus();
}

/** A request that changes something; an answer that refuses is an Error with the sentence of the server. */
export async function send(method, path, content, upload) {
  const options = { method, headers: { "x-clutchid": "1" } };
  if (upload) options.body = upload;
  else if (content !== undefined) options.body = JSON.stringify(content);
  else if (method !== "DELETE") options.body = "{}";
  return answered(await fetch(path, options));
}

export async function ask(path) {
  return answered(await fetch(path));
}

const answered = async (answer) => contentOf(await answer.text(), answer.status);

/** The content of an answer; a refusal is an Error with its sentence. */
function contentOf(text, status) {
  let content = {};
  try { content = JSON.parse(text); } catch { content = { message: text }; }
  if (status >= 300) throw new Error(content.message || `The server answered ${status}.`);
  return content;
}

/** A file sent as it is, with its share; a function that breaks it off is given to `begun`. */
export function upload(path, file, share, begun = () => {}) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("PUT", path);
    request.setRequestHeader("x-clutchid", "1");
    request.upload.onprogress = (event) => event.lengthComputable && share(event.loaded / event.total);
    request.onload = () => { try { resolve(contentOf(request.responseText, request.status)); } catch (problem) { reject(problem); } };
    request.onerror = () => reject(new Error(`${file.name}: the connection to the server was lost.`));
    request.onabort = () => reject(new Error(`${file.name}: the upload was stopped.`));
    begun(() => request.abort());
    request.send(file);
  });
}

/** Points of a plot: time and columns as arrays; what is missing is null. */
export async function points(path, grid, columns, begin, end, width) {
  const query = new URLSearchParams({ grid, columns: columns.join(","), begin, end, width });
  const answer = await fetch(`${path}?${query}`);
  if (!answer.ok) throw new Error((await answer.json()).message);
  const all = new Float64Array(await answer.arrayBuffer());
  const size = all.length / (columns.length + 1);
  const found = [];
  for (let row = 0; row <= columns.length; row++) {
    found.push(Array.from(all.subarray(row * size, (row + 1) * size), (value) => (Number.isFinite(value) ? value : null)));
  }
  return found;
}

// The objects of the server, by kind and id, and who wants to know of changes.
const objects = { recording: new Map(), result: new Map(), observation: new Map(), job: new Map() };
const listeners = [];
export const all = (kind) => [...objects[kind].values()];
export const one = (kind, id) => objects[kind].get(id);
export const gone = new Set();  // ids of what was removed; what is kept of others stays until they are among the events
export const listen = (listener) => listeners.push(listener);

/** Follow the server; the browser connects again by itself, and goes on with what it has missed. */
export function follow(lost) {
  let changed = new Set();
  let planned = false;
  const source = new EventSource("/api/events");
  source.onopen = () => lost(false);
  source.onerror = () => lost(true);
  source.onmessage = (event) => {
    const { kind, id, content } = JSON.parse(event.data);
    if (!objects[kind]) return;
    if (content === null) { objects[kind].delete(id); gone.add(id); }
    else objects[kind].set(id, content);
    changed.add(`${kind} ${id}`);
    if (planned) return;
    planned = true;
    setTimeout(() => {
      const these = changed;
      changed = new Set();
      planned = false;
      for (const listener of listeners) listener(these);
    }, 0);
  };
}

export const about = { units: {}, quantities: {}, parameters: {}, verbs: {}, methods: [], session: "", offered: [] };
const lasting = {};           // what was ticked, chosen and written, by stage: a tab keeps it until its server ends
export const lasts = (name, state) => { lasting[name] = state; };
export const older = new Set();  // recordings that had been there, after a fit, when this tab was opened: it chooses none of them by itself
lasts("older", older);
export async function learn() {
  Object.assign(about, await ask("/api/about"));
  const name = `clutchid ${about.session}`;
  const kept = sessionStorage.getItem(name);
  restore(lasting, kept ? JSON.parse(kept, (_, value) => (value?.$map ? new Map(value.$map) : value?.$set ? new Set(value.$set) : value)) : { older: about.offered });
  const save = () => sessionStorage.setItem(name, JSON.stringify(lasting, (_, value) => (value instanceof Set ? { $set: [...value] } : value instanceof Map ? { $map: [...value] } : value)));
  for (const event of ["pagehide", "visibilitychange", "change", "click"]) addEventListener(event, save);
}

/** Fill objects, sets and maps with what was kept of them. */
function restore(state, kept) {
  for (const [name, value] of Object.entries(kept)) {
    const own = state[name];
    if (own instanceof Set) for (const entry of value) own.add(entry);
    else if (own instanceof Map) for (const entry of value) own.set(...entry);
    else if (own && typeof own === "object") restore(own, value);
    else state[name] = value;
  }
}

/** A number with so many digits, and a power of ten where it is large or small: 0.5, −3.2, 1.9·10⁻⁸. A dash where there is none. */
export function short(value, digits = 5) {
  if (!Number.isFinite(value)) return "–";
  const rounded = Number(value.toPrecision(digits));
  if (rounded === 0 || (Math.abs(rounded) >= 1e-4 && Math.abs(rounded) < 1e6)) return String(rounded).replace("-", "−");
  const [mantissa, exponent] = rounded.toExponential(2).split("e");
  return `${String(Number(mantissa)).replace("-", "−")}·10${[...String(Number(exponent))].map((sign) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[sign] ?? "⁻").join("")}`;
}

export function bytes(size) {
  if (size >= 1e9) return `${(size / 1e9).toFixed(2)} GB`;
  return size >= 1e6 ? `${(size / 1e6).toFixed(1)} MB` : `${Math.max(1, Math.round(size / 1e3))} kB`;
}

export const plural = (count, word) => `${count} ${word}${count === 1 ? "" : "s"}`;

/** A sentence at the place where something was given. */
export const notice = (text, mood = "bad") => (text ? h("p", { class: `notice ${mood}`, role: mood === "bad" ? "alert" : "status" }, text) : null);

/** A table: a heading a column, and rows whose cells have it too, as a row is a list of them on a narrow page; `scroll` names a table that scrolls. */
export function table(heads, rows, { name = "", scroll = "" } = {}) {
  const titles = heads.map((head) => (head instanceof Node ? head : h("th", { scope: "col" }, head)));
  for (const row of rows) [...row.cells].forEach((cell, k) => { if (cell.tagName === "TD") cell.dataset.label = titles[k].textContent; });
  const made = h("table", { class: name }, h("thead", {}, h("tr", {}, titles)), h("tbody", {}, rows));
  return scroll ? h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": scroll }, made) : made;
}

/** A name that breaks behind dots, dashes and underscores where it is too long for its line. */
export const named = (name) => name.split(/(?<=[._-])(?=.)/).flatMap((part, k) => (k ? [h("wbr"), part] : [part]));

/** The rows of a summary: what a result says, in the words of the command line. */
export const summary = (rows) => h("dl", { class: "summary" }, (rows ?? []).map((row) => [h("dt", {}, row.label), h("dd", { class: `${row.fixed ? "fixed" : ""} ${row.mood.replace(" ", "-")}` }, row.text)]));

/** What is to do next: a button where the page does it, a command to copy where it does not. */
export const nextStep = (next, act) => h("p", { class: "next" }, h("strong", {}, "Next: "), `${next.why}. `,
  act ? h("button", { type: "button", id: "next", class: "plain", onclick: act[1] }, act[0]) : copying(next.command, "Copy the command"));

const unfolded = new Set();   // names of what was unfolded, which stays so when it is drawn again
lasts("unfolded", unfolded);
/** Content behind a title, which unfolds it. */
export const folded = (name, title, ...content) => h("details", { open: unfolded.has(name) },
  h("summary", { onclick: (event) => unfolded[event.target.closest("details").open ? "delete" : "add"](name) }, title), content);

/** Warnings or notes, behind how many there are. */
export const sentences = (texts, word) => (texts?.length ? folded(word, plural(texts.length, word), h("ul", {}, texts.map((text) => h("li", {}, text)))) : null);

/** Command and Python that repeat a result. */
export function repeat({ command, python }) {
  const block = (title, text) => h("div", { class: "code" }, h("div", { class: "head" }, h("h4", {}, title), copying(text, "Copy")), h("pre", { tabindex: "0" }, text));
  return command ? folded("repeat", "Repeat it on the command line or in Python", block("Command", command), block("Python", python)) : null;
}

export const badge = (text, mood) => h("span", { class: `badge ${mood.replace(" ", "-")}` }, text);

const MOODS = { good: "good", "with care": "suspect", none: "bad" };
/** The trust of a result, with a word before it; a dash where there is none. */
export const trusted = (trust, before = "") => (trust ? badge(`${before}${trust}`, MOODS[trust] ?? "undetermined") : "–");

/** A choice of [value, words] under a label, kept in `state` by its name. */
export const select = (id, label, state, name, values, redraw) => h("p", { class: "field" }, h("label", { for: id }, label),
  h("select", { id, onchange: (event) => { state[name] = event.target.value; redraw(); } }, values.map(([value, words]) => h("option", { value, selected: (state[name] ?? "") === value }, words))));

/** An entry of the list at the left: its mark, name and state. */
export const item = (id, chosen, mood, name, hint, act) => h("div", { role: "listitem" }, h("button", { type: "button", id: `item-${id}`, class: `item ${chosen ? "chosen" : ""}`, "aria-pressed": String(chosen), onclick: act },
  h("span", { class: `dot ${mood}` }), h("span", { class: "name" }, named(name)), h("span", { class: "hint" }, hint)));

/** A button that copies a text, and says so. */
export function copying(text, label) {
  const button = h("button", { type: "button", class: "plain", onclick: async () => {
    try {
      await navigator.clipboard.writeText(text);
      button.textContent = "Copied";
    } catch { button.textContent = "Select the text and copy it"; }
    setTimeout(() => { button.textContent = label; }, 2000);
  } }, label);
  return button;
}

/** The axis of a plot in the colours of the theme. */
export const axis = (more) => ({ stroke: () => colour("ink"), grid: { stroke: () => colour("grid"), width: 1 }, ticks: { stroke: () => colour("grid") }, font: "12px sans-serif", labelFont: "12px sans-serif", ...more });
/** Let plots follow the width of their area; `plots()` are those that are there. */
export function following(area, height, plots) {
  const observer = new ResizeObserver(() => {
    const width = Math.max(area.clientWidth, 200);
    for (const plot of plots()) if (plot.width !== width) plot.setSize({ width, height });
  });
  observer.observe(area);
  return observer;
}
export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
export const SERIES = ["blue", "orange", "green", "red", "purple", "ink"];
/** Marks of a legend in the colours of `names`, by series, which follow the theme as the style sheet does. */
export const marked = (names) => ({ markers: { width: 2, stroke: (_, k) => `var(--${names[k] ?? "paper"})`, fill: "transparent" } });

/**
 * A box in which files are dropped, chosen, or opened by their path. Send files one after the other with their share; `send(file, upload)` calls upload(path) for the answer.
 * A box is {id, of, title, accepts, none, take(files, redraw), open(path)}; what goes on in it is kept in it.
 */
export async function sending(box, files, redraw, send) {
  box.refused = "";
  box.uploads ??= new Map();
  for (const file of files) {
    const entry = { name: file.name, share: 0, abort: () => {} };
    box.uploads.set(file, entry);
    redraw();
    try {
      await send(file, (path) => upload(path, file, (share) => { entry.share = share; redraw(); }, (abort) => { entry.abort = abort; }));
    } catch (problem) { box.refused = problem.message; }
    box.uploads.delete(file);
    redraw();
  }
  return box.refused;
}

export function drawBox(add, box) {
  const redraw = () => drawBox(add, box);
  const input = h("input", { type: "file", multiple: true, id: `${box.id}files`, class: "hidden", tabindex: "-1", "aria-label": `Files of ${box.of}`, onchange: (event) => box.take([...event.target.files], redraw) });
  const zone = h("div", { class: "drop" },
    h("p", {}, h("strong", {}, box.title), h("br"), box.accepts),
    h("div", { class: "buttons" }, h("button", { type: "button", onclick: () => input.click() }, "Choose files"), input,
    h("button", { type: "button", id: `${box.id}by-path`, class: "plain", "aria-expanded": String(Boolean(box.listing)), onclick: async () => {
      if (box.listing) { box.listing = null; redraw(); } else await list(box, "", redraw);
    } }, box.listing ? "Close the list" : "Open by path")));
  dropping(zone, (event) => box.take([...event.dataTransfer.files], redraw));
  const going = [...(box.uploads?.values() ?? [])].map((entry) => h("div", { class: "upload" }, h("span", {}, entry.name),
    h("progress", { max: 1, value: entry.share, "aria-label": `Upload of ${entry.name}` }),
    h("button", { type: "button", class: "plain", onclick: () => entry.abort() }, "Stop")));
  fill(add, zone, going, notice(box.refused), box.listing && drawListing(box, redraw));
}

/** Let an element take what is dropped on it. */
export function dropping(zone, take) {
  for (const name of ["dragover", "dragleave", "drop"]) zone.addEventListener(name, (event) => {
    event.preventDefault();
    zone.classList.toggle("over", name === "dragover");
    if (name === "drop") take(event);
  });
  return zone;
}

async function list(box, under, redraw) {
  try { box.listing = await ask(`/api/files?${new URLSearchParams({ under })}`); box.refused = ""; }
  catch (problem) { box.refused = problem.message; }
  redraw();
}

function drawListing(box, redraw) {
  const { listing } = box;
  const entry = (text, hint, act) => h("li", {}, h("button", { type: "button", class: "link", onclick: act }, text), h("span", { class: "hint" }, hint));
  return h("div", { class: "files" }, h("p", { class: "hint" }, listing.folder), h("ul", {},
    listing.up !== null && entry("..", "", () => list(box, listing.up, redraw)),
    listing.folders.map((one) => entry(`${one.name}/`, "", () => list(box, one.path, redraw))),
    listing.files.map((file) => entry(file.name, bytes(file.size), async () => {
      try { await box.open(file.path); box.refused = ""; }
      catch (problem) { box.refused = problem.message; }
      redraw();
    })), !listing.files.length && !listing.folders.length && h("li", { class: "hint" }, box.none)), listing.others && h("p", { class: "hint" }, listing.others));
}
