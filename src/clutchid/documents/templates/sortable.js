"use strict";
// The table of a page is shown in parts, and sorted and filtered by its reader; without this script its first part is there.
// The address of a state: #sort=3 by the third column, #sort=-3 from its greatest value, &filter=TEXT, &part=2.
document.documentElement.classList.add("js");
document.addEventListener("DOMContentLoaded", () => {
  const box = document.querySelector(".sortable");
  const [cells, links] = JSON.parse(box.querySelector("script").textContent);
  const body = box.querySelector("tbody");
  const sample = body.rows[0];
  const SIZE = {{ part }};
  const heads = Array.from(box.querySelector("thead").rows).at(-1).cells;
  const [input, earlier, count, later] = ["input", ".earlier", ".count", ".later"].map((name) => box.querySelector(name));
  const order = new Intl.Collator("en", { numeric: true });
  const keys = new Map();
  let texts = null;
  let state = { sort: 0, filter: "", part: 1 };

  const NUMBER = /^−?(∞|\d+(\.\d+)?)(\sto\s.+)?$/; // also a band, which is sorted by its lower end
  const number = (text) => Number(text.split(/\s/)[0].replace("−", "-").replace("∞", "Infinity"));
  const unknown = (text) => text === "–" || text === "";

  function keysOf(column) {
    if (!keys.has(column)) {
      const numeric = cells[column].every((text) => unknown(text) || NUMBER.test(text));
      keys.set(column, cells[column].map((text) => (unknown(text) ? null : numeric ? number(text) : text)));
    }
    return keys.get(column);
  }

  function compared(column, sign) {
    const key = keysOf(column);
    return (i, j) => {
      const [x, y] = [key[i], key[j]];
      if (x === null || y === null) return (x === null) - (y === null); // unknown ones are last in either order
      return x === y ? 0 : sign * (typeof x === "number" ? x - y : order.compare(x, y));
    };
  }

  function matching(filter) {
    const all = Array.from(links.keys());
    if (!filter) return all;
    texts ??= all.map((i) => cells.map((column) => column[i]).join("\n").toLowerCase());
    return all.filter((i) => texts[i].includes(filter));
  }

  function row(i) {
    const made = sample.cloneNode(true);
    Array.from(made.cells).forEach((cell, column) => { cell.textContent = cells[column][i]; });
    if (links[i]) {
      const link = document.createElement("a");
      link.setAttribute("href", links[i]);
      link.textContent = cells[0][i];
      made.cells[0].replaceChildren(link);
    }
    return made;
  }

  function show() {
    const found = matching(state.filter.toLowerCase());
    const column = Math.abs(state.sort) - 1;
    if (column >= 0) found.sort(compared(column, Math.sign(state.sort)));
    const parts = Math.max(1, Math.ceil(found.length / SIZE));
    state.part = Math.min(Math.max(1, state.part), parts);
    const first = (state.part - 1) * SIZE;
    const part = found.slice(first, first + SIZE);
    body.replaceChildren(...part.map(row));
    Array.from(heads).forEach((head, i) => {
      if (i === column) head.setAttribute("aria-sort", state.sort > 0 ? "ascending" : "descending");
      else head.removeAttribute("aria-sort");
    });
    const shown = (value) => value.toLocaleString("en");
    count.textContent = found.length
      ? `${shown(first + 1)} to ${shown(first + part.length)} of ${shown(found.length)}` : "none";
    earlier.disabled = state.part === 1;
    later.disabled = state.part === parts;
    if (input.value !== state.filter) input.value = state.filter;
  }

  function change(changes) {
    state = { ...state, ...changes };
    show();
    const address = new URLSearchParams();
    if (state.sort) address.set("sort", state.sort);
    if (state.filter) address.set("filter", state.filter);
    if (state.part > 1) address.set("part", state.part);
    history.replaceState(null, "", `#${address}`);
  }

  function read() {
    const address = new URLSearchParams(location.hash.slice(1));
    if (!["sort", "filter", "part"].some((name) => address.has(name))) return false;
    const whole = (name) => Math.trunc(Number(address.get(name))) || 0;
    const sort = Math.abs(whole("sort")) <= heads.length ? whole("sort") : 0;
    state = { sort, filter: address.get("filter") ?? "", part: whole("part") || 1 };
    return true;
  }

  Array.from(heads).forEach((head, i) => {
    const button = document.createElement("button");
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => change({ sort: state.sort === i + 1 ? -i - 1 : i + 1, part: 1 }));
  });
  let typed = 0;
  input.addEventListener("input", () => {
    clearTimeout(typed);
    typed = setTimeout(() => change({ filter: input.value, part: 1 }), 150);
  });
  earlier.addEventListener("click", () => change({ part: state.part - 1 }));
  later.addEventListener("click", () => change({ part: state.part + 1 }));
  const jump = () => { show(); box.scrollIntoView(); };
  addEventListener("hashchange", () => { if (read()) jump(); });
  const addressed = read();
  box.classList.add("ready");
  if (addressed) jump(); else show();
});
