"use strict";
// Sorting and filtering of the library's tables.

const all = (selector, within = document) => [...within.querySelectorAll(selector)];
const told = document.querySelector(".told");

function compared(kind, one, other) {
  // Rows without a value come last in both orders.
  if (!one || !other) return { always: Number(!one) - Number(!other) };
  return { by: kind === "number" ? Number(one) - Number(other) : one.localeCompare(other, "en", { numeric: true }) };
}

function sort(table, heading) {
  const column = heading.cellIndex, kind = heading.dataset.kind, now = heading.getAttribute("aria-sort");
  // The first click sorts numbers in descending order, so that the worst come first, and text from A to Z.
  const first = kind === "number" ? "descending" : "ascending", second = kind === "number" ? "ascending" : "descending";
  const order = now === first ? second : first, sign = order === "ascending" ? 1 : -1;
  const rows = all("tbody tr", table);
  rows.sort((a, b) => {
    const { always, by } = compared(kind, a.cells[column].dataset.value, b.cells[column].dataset.value);
    return always ?? sign * by;
  });
  table.tBodies[0].append(...rows);
  all("th[aria-sort]", table).forEach((other) => other.setAttribute("aria-sort", other === heading ? order : "none"));
  told.textContent = `Sorted by ${heading.textContent}, ${order}`;
}

function filter(text) {
  const words = text.toLowerCase().split(/\s+/).filter(Boolean), rows = all(".sortable tbody tr");
  let matches = 0;
  for (const row of rows) {
    const content = row.textContent.toLowerCase();
    row.hidden = !words.every((word) => content.includes(word));
    matches += !row.hidden;
  }
  document.querySelector("#matches").value = words.length ? `${matches} of ${rows.length} scenes` : "";
}

for (const table of all(".sortable")) {
  for (const heading of all("th[aria-sort]", table)) {
    const button = heading.querySelector("button");
    button.disabled = false;
    button.addEventListener("click", () => sort(table, heading));
  }
}
const form = document.querySelector(".filter");
form.hidden = false;
form.addEventListener("submit", (event) => event.preventDefault());
document.querySelector("#filter").addEventListener("input", (event) => filter(event.target.value));
