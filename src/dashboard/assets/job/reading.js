// @ts-check
// A picture of many values is read value by value: the value under the pointer or the focus is written
// below the picture. The picture is a single stop of the Tab key, and the arrow keys go from value to
// value.

const STEPS = { ArrowRight: [0, 1], ArrowLeft: [0, -1], ArrowDown: [1, 0], ArrowUp: [-1, 0] };

/**
 * The cell that a key leads to in rows of different lengths; null where the key leads nowhere.
 *
 * @param {number[]} lengths
 * @param {[number, number]} from
 * @param {string} key
 * @returns {[number, number] | null}
 */
export function cellAfter(lengths, [row, column], key) {
  if (key === "Home") {
    return [row, 0];
  }
  if (key === "End") {
    return [row, lengths[row] - 1];
  }
  const [down, right] = STEPS[key] ?? [0, 0];
  const next = row + down;
  if ((down === 0 && right === 0) || next < 0 || next >= lengths.length) {
    return null;
  }
  const across = Math.min(column, lengths[next] - 1) + right;
  return across < 0 || across >= lengths[next] ? null : [next, across];
}

/**
 * Makes the cells of a picture readable. The label of a cell is the text that is written.
 *
 * @param {(HTMLElement | SVGElement)[][]} rows
 * @param {HTMLElement} readout
 */
export function readable(rows, readout) {
  const filled = rows.filter(({ length }) => length > 0);
  const lengths = filled.map(({ length }) => length);
  let current = filled[0]?.[0];
  current?.setAttribute("tabindex", "0");
  const write = (cell) => {
    readout.textContent = cell ? cell.getAttribute("aria-label") : "";
  };
  const enter = (cell) => {
    current.setAttribute("tabindex", "-1");
    current = cell;
    current.setAttribute("tabindex", "0");
    write(cell);
  };
  filled.forEach((cells, row) => {
    cells.forEach((cell, column) => {
      if (cell !== current) {
        cell.setAttribute("tabindex", "-1");
      }
      cell.addEventListener("focus", () => enter(cell));
      cell.addEventListener("pointerenter", () => write(cell));
      cell.addEventListener("pointerleave", () => write(document.activeElement === current ? current : null));
      cell.addEventListener("blur", () => write(null));
      cell.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
        const target = cellAfter(lengths, [row, column], event.key);
        if (target) {
          event.preventDefault();
          filled[target[0]][target[1]].focus();
        }
      });
    });
  });
}
