// Tables: filtered while the user types, sorted by a column, with no more rows in the page than requested.

const ROWS = 200;

function tableView(table, textOf, onBar, onOpen) {
  const body = element("tbody");
  const count = element("span", { class: "note", role: "status" });
  const more = element("button", { type: "button" }, "show all");
  let offset = 0, limit = ROWS, sorted = null, query = "", shown = [], current = -1;
  const plain = table.rows.map((row) => row.map(textOf));
  const lower = plain.map((row) => row.join("\u0000").toLowerCase());

  // Columns of numbers and of short words do not break.
  const kinds = table.columns.map(([, isNumber], column) =>
    isNumber ? "number" : plain.every((row) => row[column].length <= 14) ? "short" : null);
  const heads = table.columns.map(([name, isNumber], column) => {
    const button = element("button", { type: "button", onclick: () => {
      sorted = sorted?.column === column && !sorted.down ? { column, down: true } : { column, down: false };
      for (const [index, head] of heads.entries()) {
        head.setAttribute("aria-sort", index !== column ? "none" : sorted.down ? "descending" : "ascending");
      }
      fill();
    } }, name);
    return element("th", { scope: "col", class: kinds[column], "aria-sort": "none" }, button);
  });

  function order() {
    const rows = [...plain.keys()].filter((row) => lower[row].includes(query));
    if (!sorted) return rows;
    const { column, down } = sorted;
    const isNumber = table.columns[column][1];
    const key = (row) => (isNumber ? parseFloat(plain[row][column]) : plain[row][column]);
    const compare = (a, b) => {
      const [x, y] = [key(a), key(b)];
      if (!isNumber) return x < y ? -1 : x > y ? 1 : 0;
      return (Number.isNaN(x) ? 1 : 0) - (Number.isNaN(y) ? 1 : 0) || x - y || 0;
    };
    rows.sort((a, b) => (down ? compare(b, a) : compare(a, b)));
    return rows;
  }

  function fill() {
    shown = order();
    offset = Math.max(0, Math.min(offset, shown.length - limit));
    const visible = shown.slice(offset, offset + limit);
    body.replaceChildren(...visible.map((row) => {
      const bar = table.bars[row];
      const cells = plain[row].map((text, column) =>
        element("td", { class: kinds[column] }, words(text)));
      if (table.opens.length) {
        const page = table.opens[row];
        cells.push(element("td", {}, page === null ? null : element("button", { type: "button", onclick: () => onOpen(page) }, "show")));
      }
      return element("tr", {
        "data-row": row, "data-bar": bar, class: row === current ? "current" : null,
        onclick: bar === undefined ? null : () => onBar(bar),
      }, ...cells);
    }));
    more.hidden = shown.length <= limit;
    more.textContent = `show all ${shown.length}`;
    for (const button of [before, after]) button.hidden = shown.length <= limit;
    before.disabled = offset === 0;
    after.disabled = offset + limit >= shown.length;
    count.textContent = shown.length <= limit ? `${shown.length} rows` : `rows ${offset + 1} to ${offset + visible.length} of ${shown.length}`;
  }

  const turn = (name, by) => element("button", { type: "button", onclick: () => { offset += by * ROWS; fill(); } }, name);
  const before = turn("previous rows", -1), after = turn("next rows", 1);
  more.addEventListener("click", () => { offset = 0; limit = Infinity; fill(); });
  const search = element("input", { type: "search", "aria-label": `Filter: ${table.heading}`, placeholder: "filter", oninput: () => {
    query = search.value.toLowerCase();
    offset = 0;
    fill();
  } });
  fill();
  const box = element("div", { class: "wide", tabindex: "0", role: "region", "aria-label": table.heading },
    element("table", {}, element("thead", {}, element("tr", {}, ...heads, table.opens.length ? element("th", { scope: "col" }, "trial") : null)), body));
  const node = element("section", {},
    element("h2", {}, table.heading),
    table.note ? element("p", { class: "note" }, table.note) : null,
    plain.length > 8 ? element("div", { class: "controls" }, search, count, before, after, more) : null,
    box);

  // Shows the row of a moment, with the rows around it.
  function at(time, isMoved) {
    current = lastAt(table.times, time);
    const position = shown.indexOf(current);
    if (isMoved && (position < offset || position >= offset + limit)) {
      offset = position - ROWS / 2;
      fill();
    }
    for (const row of body.querySelectorAll("tr.current")) row.classList.remove("current");
    body.querySelector(`tr[data-row="${current}"]`)?.classList.add("current");
  }
  function pick(bar) {
    for (const row of body.querySelectorAll("tr.picked")) row.classList.remove("picked");
    body.querySelector(`tr[data-bar="${bar}"]`)?.classList.add("picked");
  }
  const chosen = () => ({ query: search.value, offset, limit });
  const choose = (before) => {
    search.value = before.query;
    query = before.query.toLowerCase();
    ({ offset, limit } = before);
    fill();
  };
  return { node, chosen, choose, at: table.times.length ? at : null, pick: table.bars.length ? pick : null };
}
