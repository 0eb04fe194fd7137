"use strict";
// The page of several missions: its table is sorted by a click on a column's name, and filtered; nothing is fetched.
const table = document.getElementById("all");
const heads = [...table.tHead.rows[0].cells];
const rows = [...table.tBodies[0].rows];
const filters = [...document.querySelectorAll(".filters select")];
const wanted = document.getElementById("wanted");

/** A number where the column has numbers, null where it is not known, else the text. */
function value(row, column) {
  const cell = row.cells[column];
  if (cell.dataset.value === undefined) return cell.textContent || null;
  return cell.dataset.value === "" ? null : Number(cell.dataset.value);
}

function compare(one, other) {
  return typeof one === "number" ? one - other : one.localeCompare(other, "en", { numeric: true });
}

/** Rising, or falling where it was rising already; what is not known comes last either way. */
function sort(column) {
  const falls = heads[column].getAttribute("aria-sort") === "ascending";
  for (const head of heads) head.removeAttribute("aria-sort");
  heads[column].setAttribute("aria-sort", falls ? "descending" : "ascending");
  rows.sort((first, second) => {
    const [one, other] = [value(first, column), value(second, column)];
    if (one === null || other === null) return Number(one === null) - Number(other === null);
    return falls ? compare(other, one) : compare(one, other);
  });
  table.tBodies[0].append(...rows);
}

function filter() {
  const text = wanted.value.toLowerCase();
  for (const row of rows) {
    const fits = filters.every((one) => one.value === "" || row.cells[one.dataset.column].textContent === one.value);
    row.hidden = !fits || !row.textContent.toLowerCase().includes(text);
  }
  const left = rows.filter((row) => !row.hidden).length;
  document.getElementById("shown").value = `${left} of ${rows.length} shown`;
}

heads.forEach((head, column) => head.querySelector("button").addEventListener("click", () => sort(column)));
document.querySelector(".filters").addEventListener("input", filter);
document.querySelector(".filters").addEventListener("submit", (event) => event.preventDefault());
filter();
