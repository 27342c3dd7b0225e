// The list in which the free parameters of a fit and their bounds are chosen; the choice is kept as the text that a command has for it.
import { about, fill, h, notice, send, short, table } from "./page.js";

/** The free parameters of a verb as a list of names. */
const freeOf = (verb, given) => (given.free?.trim() || about.verbs[verb].free).split(",").map((name) => name.trim()).filter(Boolean);
/** Bounds as the words of a command. */
export const boundsOf = ({ bounds = {} }) => Object.entries(bounds).filter(([, sides]) => sides.some(Boolean)).map(([name, sides]) => `${name}=${sides.join(":")}`);

const TOGETHER = { auto: "all that a recording with pressure determines", load: "the load: all its weights" };
const usual = (bound) => (bound === null ? "none" : String(Number(bound.toPrecision(3))));
const base = (name) => name.split("@")[0];

/** Open the list for a verb with the options `given`; `options` are those of the request, and `done` is called when the list is closed. */
export function chooseFree(verb, given, start, options, done) {
  let free = freeOf(verb, given);
  let search = "";
  let [rows, asked] = [[], 0];
  const [said, holder] = [h("div", {}), h("div", {}, h("p", { class: "hint" }, "Reading the parameters …"))];
  const dialog = h("dialog", { class: "free", "aria-labelledby": "free-title", onclose: () => { dialog.remove(); done(); } },
    h("div", { class: "head" }, h("h2", { id: "free-title" }, `Free parameters: ${verb}`), h("button", { type: "button", id: "free-done", onclick: () => dialog.close() }, "Done")),
    h("p", { class: "hint" }, "All values are in SI units. An empty bound is the one shown in grey."),
    h("input", { type: "search", id: "free-search", placeholder: "Search parameters", "aria-label": "Search parameters", oninput: (event) => { search = event.target.value.toLowerCase(); sift(); } }), said, holder);
  const sift = () => { for (const row of holder.querySelectorAll("tbody tr")) row.hidden = !row.querySelector("th").textContent.toLowerCase().includes(search); };
  const isFree = (name) => free.some((one) => base(one) === name);

  async function check() {
    const number = ++asked;
    let answer = { choices: null };
    try { answer = await send("POST", "/api/choices", { verb, free: given.free ?? "", start, options: options() }); } catch (problem) { answer.message = problem.message; }
    if (number !== asked) return null;
    fill(said, notice(free.length ? answer.message : "No parameter is free: choose at least one."));
    return answer.choices;
  }

  const within = (name) => rows.some((row) => row.name === name && row.group && isFree(row.group));
  const tick = (name, wanted) => {
    free = wanted ? [...free, name] : free.filter((one) => base(one) !== name);
    free = free.filter((one) => !within(base(one)) && !(one === "load" && isFree("auto")));
    if (!wanted && name === "auto") free.push("load");  // what else is free is chosen one by one
    given.free = free.join(",") === about.verbs[verb].free ? "" : free.join(",");
    for (const bounded of Object.keys(given.bounds ?? {})) if (!isFree(bounded) && !within(bounded)) delete given.bounds[bounded];
    return draw();
  };
  const box = (name, covered, label) => h("input", { type: "checkbox", id: `free-${name}`, checked: covered || isFree(name), disabled: covered, "aria-label": label, onchange: (event) => tick(name, event.target.checked) });
  const bound = (row, side) => h("input", { class: "w7", id: `${["low", "high"][side]}-${row.name}`, placeholder: usual([row.low, row.high][side]), value: given.bounds?.[row.name]?.[side] ?? "",
    disabled: !within(row.name) && !isFree(row.name) && !given.bounds?.[row.name], "aria-label": `${["Lower", "Upper"][side]} bound of ${row.name}`, onchange: (event) => {
      given.bounds ??= {};
      (given.bounds[row.name] ??= ["", ""])[side] = event.target.value.trim();
      check();
    } });

  async function draw() {
    rows = (await check()) ?? rows;
    const together = Object.entries(TOGETHER).filter(([name]) => name === "load" || verb === "calibrate").map(([name, words]) => h("tr", {}, h("td", {}, box(name, name === "load" && isFree("auto"), words)),
      h("th", { scope: "row" }, words, h("span", { class: "hint" }, ` ${name}`)), h("td", { colSpan: 4 })));
    fill(holder, table(["free", "parameter", "unit", "start", "lower bound", "upper bound"], [...together, ...rows.map((row) => h("tr", {},
      h("td", {}, box(row.name, within(row.name), `${row.meaning} ${row.name}`)), h("th", { scope: "row" }, row.meaning, h("span", { class: "hint" }, ` ${row.name}`)),
      h("td", {}, row.unit), h("td", { class: "number" }, short(row.start)), h("td", {}, bound(row, 0)), h("td", {}, bound(row, 1))))], { name: "stack", scroll: "Table of parameters" }));
    sift();
  }
  document.body.append(dialog);
  dialog.showModal();
  draw();
}
