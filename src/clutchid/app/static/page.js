// What all parts of the page use: elements from text, requests, the objects of the server, numbers in words.

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

async function answered(answer) {
  const text = await answer.text();
  let content = {};
  try { content = JSON.parse(text); } catch { content = { message: text }; }
  if (!answer.ok) throw new Error(content.message || `The server answered ${answer.status}.`);
  return content;
}

/** A file sent as it is, with its share; a function that breaks it off is given to `begun`. */
export function upload(path, file, share, begun = () => {}) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("PUT", path);
    request.setRequestHeader("x-clutchid", "1");
    request.upload.onprogress = (event) => event.lengthComputable && share(event.loaded / event.total);
    request.onload = () => {
      let content = {};
      try { content = JSON.parse(request.responseText); } catch { content = { message: request.responseText }; }
      if (request.status < 300) resolve(content);
      else reject(new Error(content.message || `The server answered ${request.status}.`));
    };
    request.onerror = () => reject(new Error(`${file.name}: the connection to the server was lost.`));
    request.onabort = () => reject(new Error(`${file.name}: stopped.`));
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
    if (content === null) objects[kind].delete(id);
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

export const about = { units: {}, quantities: {}, verbs: {}, methods: [] };
export async function learn() { Object.assign(about, await ask("/api/about")); }

/** A number with so many digits, without an exponent where none is needed. */
export function short(value, digits = 5) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = Number(value.toPrecision(digits));
  return Math.abs(text) >= 1e6 || (text !== 0 && Math.abs(text) < 1e-4) ? text.toExponential(2) : String(text);
}

export function bytes(size) {
  if (size >= 1e9) return `${(size / 1e9).toFixed(2)} GB`;
  return size >= 1e6 ? `${(size / 1e6).toFixed(1)} MB` : `${Math.max(1, Math.round(size / 1e3))} kB`;
}

export const plural = (count, word) => `${count} ${word}${count === 1 ? "" : "s"}`;

/** A sentence at the place where something was given. */
export const notice = (text, mood = "bad") => (text ? h("p", { class: `notice ${mood}`, role: mood === "bad" ? "alert" : "status" }, text) : null);

export const badge = (text, mood) => h("span", { class: `badge ${mood.replace(" ", "-")}` }, text);

/** A button that copies a text, and says so. */
export function copying(text, label) {
  const button = h("button", { type: "button", class: "plain", onclick: async () => {
    try {
      await navigator.clipboard.writeText(text);
      button.textContent = "Copied";
    } catch { button.textContent = "Select and copy it below"; }
    setTimeout(() => { button.textContent = label; }, 2000);
  } }, label);
  return button;
}

export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
export const SERIES = ["blue", "orange", "green", "red", "purple", "ink"];
