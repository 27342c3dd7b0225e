"use strict";
// The table of a page is shown in parts, and sorted and filtered by its reader; without this script it is there in full.
// The address of a state: #sort=3 by the third column, #sort=-3 from its greatest value, &filter=TEXT, &part=2.
document.documentElement.classList.add("js");
document.addEventListener("DOMContentLoaded", () => {
  const SIZE = 200;
  const box = document.querySelector(".sortable");
  const body = box.querySelector("tbody");
  const heads = Array.from(box.querySelector("thead").rows).at(-1).cells;
  const [input, earlier, count, later] = ["input", ".earlier", ".count", ".later"].map((name) => box.querySelector(name));
  const order = new Intl.Collator("en", { numeric: true });
  const all = Array.from(body.rows, (row) => ({ row, cells: Array.from(row.cells, (cell) => cell.textContent) }));
  for (const one of all) one.text = one.cells.join("\n").toLowerCase();
  let state = { sort: 0, filter: "", part: 1 };

  const NUMBER = /^−?(∞|\d+(\.\d+)?)(\sto\s.+)?$/; // also a band, which is sorted by its lower end
  const number = (text) => Number(text.split(/\s/)[0].replace("−", "-").replace("∞", "Infinity"));
  const unknown = (text) => text === "–" || text === "";

  function compared(column, sign) {
    const numeric = all.every(({ cells }) => unknown(cells[column]) || NUMBER.test(cells[column]));
    return (a, b) => {
      const [x, y] = [a.cells[column], b.cells[column]];
      const missing = unknown(x) - unknown(y);
      if (missing || x === y) return missing; // unknown ones are last in either order
      return sign * (numeric ? number(x) - number(y) : order.compare(x, y));
    };
  }

  function show() {
    const wanted = state.filter.toLowerCase();
    const found = all.filter((one) => one.text.includes(wanted));
    const column = Math.abs(state.sort) - 1;
    if (column >= 0) found.sort(compared(column, Math.sign(state.sort)));
    const parts = Math.max(1, Math.ceil(found.length / SIZE));
    state.part = Math.min(Math.max(1, state.part), parts);
    const first = (state.part - 1) * SIZE;
    const part = found.slice(first, first + SIZE);
    body.replaceChildren(...part.map((one) => one.row));
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
