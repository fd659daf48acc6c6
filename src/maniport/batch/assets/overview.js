"use strict";
// Each heading of the table of pairs becomes a button that sorts by its column: numbers by size, texts by letters,
// what is missing last. A second press turns the order round.
for (const table of document.querySelectorAll("table.pairs")) {
  const body = table.tBodies[0];
  const headings = [...table.tHead.rows[0].cells];
  headings.forEach((heading, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = heading.textContent;
    heading.replaceChildren(button);
    button.addEventListener("click", () => {
      const down = heading.getAttribute("aria-sort") === "ascending";
      for (const other of headings) other.removeAttribute("aria-sort");
      heading.setAttribute("aria-sort", down ? "descending" : "ascending");
      const key = (row) => row.cells[column].dataset.value ?? row.cells[column].textContent;
      const numeric = heading.classList.contains("number");
      const compare = (a, b) => {
        const [first, second] = [key(a), key(b)];
        if ((first === "") !== (second === "")) return first === "" ? 1 : -1;
        const order = numeric ? Number(first) - Number(second) : first.localeCompare(second);
        return down ? -order : order;
      };
      body.append(...[...body.rows].sort(compare));
    });
  });
}
document.documentElement.dataset.ready = "true";
