// The page: its stages, the theme, files dropped anywhere, and the events of the server.
import { follow, h, learn, listen, notice } from "./page.js";
import { jobBar } from "./jobs.js";
import { loadStage } from "./load.js";
import { onlineStage } from "./online.js";
import { recordingStage, take } from "./recording.js";

const STAGES = { recording: ["Recording", recordingStage], load: ["Load", loadStage], online: ["On line", onlineStage] };
const main = document.getElementById("main");
const bar = jobBar(document.getElementById("jobs"));
let stage = null;
let name = "";

function go(wanted) {
  const next = wanted in STAGES ? wanted : "recording";
  if (next === name) return;
  stage?.end();
  name = next;
  stage = STAGES[name][1](main, show);
  document.title = `${STAGES[name][0]} – clutchid`;
  document.getElementById("stages").replaceChildren(...Object.entries(STAGES).map(([key, [title]]) => h("a", { href: `#${key}`, "aria-current": key === name ? "page" : null }, title)));
}

/** Show a stage, and in it the object with this id, in place of another one. */
function show(wanted, id, other) {
  go(wanted);
  location.hash = wanted;
  stage.choose(id, other);
}

function setTheme(dark) {
  document.documentElement.dataset.theme = dark ? "dark" : "light";
  document.getElementById("theme").textContent = dark ? "Light" : "Dark";
  stage?.redraw();
}

const kept = localStorage.getItem("theme");
setTheme(kept ? kept === "dark" : matchMedia("(prefers-color-scheme: dark)").matches);
document.getElementById("theme").addEventListener("click", () => {
  const dark = document.documentElement.dataset.theme !== "dark";
  localStorage.setItem("theme", dark ? "dark" : "light");
  setTheme(dark);
});

addEventListener("hashchange", () => go(location.hash.slice(1)));
addEventListener("dragover", (event) => event.preventDefault());
addEventListener("drop", (event) => {
  event.preventDefault();
  if (!event.dataTransfer.files.length || event.target.closest?.(".drop")) return;
  const files = [...event.dataTransfer.files];
  location.hash = "#recording";
  go("recording");
  take(files, () => stage.redrawAdd?.());
});

try {
  await learn();
  go(location.hash.slice(1));
  listen((these) => { bar.draw(); stage?.changed(these); });
  follow((lost) => bar.lost(lost));
} catch (problem) {
  main.replaceChildren(notice(problem.message));
}
