"use strict";
// Sorts and hides the rows of the tables of subjects; tables and figures hold the same subjects and are filtered together.
(() => {
  const tables = [...document.querySelectorAll("table.sortable")];
  const key = (row, column) => {
    const cell = row.children[column];
    const value = cell.dataset.value;
    return value === undefined ? cell.textContent.trim() : Number(value);
  };
  // Numbers before words, words by the reader's alphabet; what has no value ("–") comes last either way.
  const compare = (a, b, sign) => {
    const empty = (v) => v === "–";
    if (empty(a) || empty(b)) return empty(a) - empty(b);
    if (typeof a === "number" && typeof b === "number") return sign * (a - b);
    return sign * String(a).localeCompare(String(b), "en", { numeric: true });
  };
  for (const table of tables) {
    const heads = [...table.tHead.rows[0].cells];
    heads.forEach((head, column) => {
      const button = document.createElement("button");
      button.type = "button";
      button.className = "sort";
      button.textContent = head.textContent;
      head.textContent = "";
      head.append(button);
      button.addEventListener("click", () => {
        const sign = head.getAttribute("aria-sort") === "ascending" ? -1 : 1;
        heads.forEach((other) => other.removeAttribute("aria-sort"));
        head.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
        const body = table.tBodies[0];
        const rows = [...body.rows].map((row, n) => [key(row, column), n, row]);
        rows.sort((a, b) => compare(a[0], b[0], sign) || a[1] - b[1]);
        body.append(...rows.map((row) => row[2]));
      });
    });
  }
  // Pointing at a subject in one figure shows it in all, and in the tables; pressing it opens its page.
  const points = [...document.querySelectorAll(".strips .subject")];
  const pointAt = (name) => {
    document.querySelectorAll(".strips").forEach((strips) => strips.classList.toggle("pointing", name !== undefined));
    points.forEach((point) => point.classList.toggle("pointed", point.dataset.of === name));
    document.querySelectorAll("tr[data-subject]").forEach((row) => row.classList.toggle("pointed", row.dataset.subject === name));
  };
  for (const row of document.querySelectorAll("tr[data-subject]")) {
    for (const on of ["mouseenter", "focusin"]) row.addEventListener(on, () => pointAt(row.dataset.subject));
    for (const off of ["mouseleave", "focusout"]) row.addEventListener(off, () => pointAt(undefined));
  }
  for (const point of points) {
    point.addEventListener("mouseenter", () => pointAt(point.dataset.of));
    point.addEventListener("mouseleave", () => pointAt(undefined));
    if (point.dataset.page) point.addEventListener("click", () => { location.href = point.dataset.page; });
  }
  const [text, verdict, apart, said] = ["text", "verdict", "apart", "said"].map((name) => document.getElementById(`filter-${name}`));
  const filter = () => {
    const words = text.value.trim().toLowerCase();
    // A subject's words are those of its row in any of the tables.
    const has = new Map();
    for (const row of document.querySelectorAll("tr[data-subject]")) {
      const name = row.dataset.subject;
      has.set(name, (has.get(name) || "") + " " + row.textContent.toLowerCase());
    }
    const shown = new Set();
    for (const row of document.querySelectorAll("tr[data-subject]")) {
      const fits = has.get(row.dataset.subject).includes(words) &&
        (!verdict.value || row.dataset.verdict === verdict.value) && (!apart.checked || row.dataset.apart === "yes");
      row.hidden = !fits;
      if (fits) shown.add(row.dataset.subject);
    }
    for (const point of points) point.classList.toggle("filtered", !shown.has(point.dataset.of));
    said.textContent = `${shown.size} of ${has.size} subjects`;
  };
  for (const control of [text, verdict, apart]) control.addEventListener("input", filter);
  document.getElementById("filters").hidden = false;
  filter();
})();
