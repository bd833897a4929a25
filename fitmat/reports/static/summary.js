// The table of a batch: sorted by a column, cut down to what is asked for.
"use strict";
(() => {
  document.documentElement.classList.add("drawn");
  const table = document.getElementById("files");
  if (!table) return;
  const body = table.tBodies[0], heads = [...table.tHead.rows[0].cells], rows = [...body.rows];

  const value = (row, k) => {
    const cell = row.cells[k], number = cell.dataset.value;
    if (number === undefined) return cell.textContent.trim().toLowerCase();
    return number === "" ? null : Number(number);
  };
  const compared = (a, b) => (typeof a === "number" ? a - b : a.localeCompare(b, undefined, { numeric: true }));

  heads.forEach((head, k) => head.querySelector("button.sort")?.addEventListener("click", () => {
    const down = head.getAttribute("aria-sort") === "ascending";
    heads.forEach((other) => other.removeAttribute("aria-sort"));
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const known = rows.filter((row) => value(row, k) !== null), rest = rows.filter((row) => value(row, k) === null);
    known.sort((a, b) => (down ? -1 : 1) * compared(value(a, k), value(b, k)));
    body.append(...known, ...rest);
  }));

  const filter = document.getElementById("filter"), count = document.getElementById("count");
  filter.addEventListener("input", () => {
    const wanted = filter.value.trim().toLowerCase().split(/\s+/);
    for (const row of rows) row.hidden = !wanted.every((word) => row.textContent.toLowerCase().includes(word));
    count.textContent = `${rows.filter((row) => !row.hidden).length} of ${rows.length} shown`;
    table.dispatchEvent(new Event("shown"));
  });
})();
