// @ts-check
// The uncertainty budget says where the uncertainty of each estimate comes from: a bar for each parameter,
// whose parts are the shares of the noise and of each assumption, with the table of all assumptions behind.

import { keyOf } from "../compare/differences.js";
import { h } from "../shell/dom.js";
import { assumptionWords, number, quantity } from "../shell/format.js";
import { heatTable } from "./heat.js";
import { readable } from "./reading.js";
import { unknownWords } from "./unknowns.js";

/** @typedef {import("page/api").Schemas["BudgetLine"]} BudgetLine */
/** @typedef {{ source: string, look: string, share: number, detail: string, members?: string }} Share */
/** @typedef {(line: BudgetLine) => number} ShareOf */

// A colour is given to this many assumptions; all further ones are listed by name in one part.
const MOST_NAMED = 10;
// At most this many of the assumptions that are summed are named beside a bar; the tip of the bar and the table have all.
const MOST_MEMBERS = 4;
const LEAST_NAMED = 0.01;
const LEAST_DRAWN = 0.001;
// A part that is narrower shows no text.
const LEAST_WRITTEN = 0.07;
const SCORE_LIMIT = 4;
// A share that is smaller is what rounding leaves of a sum.
const ROUNDING = 1e-9;

const TOGETHER =
  "Striped parts are several assumptions together: an error of one of them makes up for a part of the error of another, so that their sum alone is a share, and one by one they may be below zero or above 100 %.";

/** @param {{ budget: BudgetLine[], parameters: any[] }} result */
export function budgetPart(result) {
  const { bars, sources } = budgetBars(result);
  return h(
    "div",
    {},
    bars.length > 0 && picture(bars, sources),
    h(
      "p",
      { class: "quiet" },
      "The parts of each bar are shares of the square of the total standard error, and sum to 100 %.",
      bars.some(({ parts }) => parts.some(({ members }) => members)) ? ` ${TOGETHER}` : "",
    ),
    h("details", {}, h("summary", {}, "Budget as a table"), budgetTable(result)),
  );
}

/** @param {BudgetLine[]} lines @param {ShareOf} shareOf */
const sumOf = (lines, shareOf) => lines.reduce((sum, line) => sum + shareOf(line), 0);

/**
 * Adds others to lines, in their order, until the shares of all sum to no less than zero.
 *
 * @param {BudgetLine[]} lines
 * @param {BudgetLine[]} others
 * @param {ShareOf} shareOf
 */
function filledUp(lines, others, shareOf) {
  const all = [...lines];
  for (const line of others) {
    if (sumOf(all, shareOf) >= 0) {
      break;
    }
    all.push(line);
  }
  return all;
}

/**
 * Sorts the assumptions of a bar into those that are summed since some of their shares are below zero, those that stand
 * alone, and the remaining ones. A share below zero that cannot be seen is summed with the remaining ones.
 *
 * @param {BudgetLine[]} lines The largest first.
 * @param {BudgetLine[]} named Those that have a colour.
 * @param {ShareOf} shareOf
 */
export function sorted(lines, named, shareOf) {
  const negative = lines.filter((line) => shareOf(line) < 0);
  const positive = lines.filter((line) => shareOf(line) > 0).sort((a, b) => shareOf(b) - shareOf(a));
  const isSeen = sumOf(negative, shareOf) <= -LEAST_NAMED;
  const together = isSeen ? filledUp(negative, positive, shareOf) : [];
  const alone = named.filter((line) => shareOf(line) >= LEAST_DRAWN && !together.includes(line));
  const unnamed = lines.filter((line) => !alone.includes(line) && !together.includes(line));
  const smallest = positive.filter((line) => alone.includes(line)).reverse();
  const rest = filledUp(unnamed, smallest, shareOf);
  return {
    together: together.sort((a, b) => Math.abs(shareOf(b)) - Math.abs(shareOf(a))),
    alone: alone.filter((line) => !rest.includes(line)),
    rest,
  };
}

/**
 * The bars of the budget: for each parameter the shares of the noise, of assumptions that make up for each other
 * together, of the assumptions with the largest shares, of the remaining assumptions together, and of what the total
 * covers beside the budget. The shares of a bar sum to 1.
 *
 * @param {{ budget: BudgetLine[], parameters: any[] }} result
 */
export function budgetBars({ budget, parameters }) {
  const total = parameters.filter((parameter) => remainderOf(parameter, budget));
  const keys = total.map(keyOf);
  const shareIn = (/** @type {BudgetLine} */ { contributions }, key) => contributions[key]?.share ?? 0;
  const largest = (line) => Math.max(0, ...keys.map((key) => Math.abs(shareIn(line, key))));
  const lines = [...budget].sort((a, b) => largest(b) - largest(a));
  const named = lines.filter((line) => largest(line) >= LEAST_NAMED).slice(0, MOST_NAMED);
  const bars = total.map((parameter) => {
    const key = keyOf(parameter);
    const { noise, beside } = remainderOf(parameter, budget);
    const shareOf = (/** @type {BudgetLine} */ line) => shareIn(line, key);
    const { together, alone, rest } = sorted(lines, named, shareOf);
    const shares = (/** @type {BudgetLine[]} */ some) =>
      some
        .filter((line) => Math.abs(shareOf(line)) > ROUNDING)
        .map((line) => `${assumptionWords(line.assumption)} ${shareText(shareOf(line))}`)
        .join(", ");
    const smaller = together.length - MOST_MEMBERS;
    const colour = named.indexOf(together.find((line) => shareOf(line) > 0) ?? together[0]);
    const error = (value) => `± ${quantity(number(value, 2), parameter.unit)}`;
    /** @type {Share[]} */
    const parts = [
      { source: "noise", look: "noise", share: noise, detail: `${error(parameter.standard_error)} alone` },
      {
        source: "assumptions together",
        look: `${colour < 0 ? "rest" : `source-${colour}`} summed`,
        share: sumOf(together, shareOf),
        detail: shares(together),
        members: `${shares(together.slice(0, MOST_MEMBERS))}${smaller > 0 ? `, and ${smaller} smaller` : ""}`,
      },
      ...alone.map((line) => ({
        source: assumptionWords(line.assumption),
        look: `source-${named.indexOf(line)}`,
        share: shareOf(line),
        detail: `${error(line.contributions[key].standard_error)} alone; five times better known, ${error(line.contributions[key].total_if_better)} in all`,
      })),
      {
        source: "remaining assumptions",
        look: "rest",
        share: sumOf(rest, shareOf),
        detail: shares(rest),
      },
      {
        source: "beside the budget",
        look: "beside",
        share: beside,
        detail: "other noise models, windows or changes, and assumptions that cannot be simulated",
      },
    ];
    return {
      key,
      label: unknownWords(key),
      total: error(parameter.total_standard_error),
      parts: parts.filter(({ share }) => share !== 0),
    };
  });
  const shown = new Map(
    bars.flatMap(({ parts }) =>
      parts.map(({ source, look, members }) => [members ? "summed" : look, source]),
    ),
  );
  const looks = ["noise", "summed", ...named.map((_, k) => `source-${k}`), "rest", "beside"];
  const sources = looks.filter((look) => shown.has(look)).map((look) => ({ look, source: shown.get(look) }));
  return { bars, sources };
}

/**
 * Places the parts of a bar beside each other: shares above zero to the right of zero, those below to the
 * left.
 *
 * @param {{ share: number }[]} parts
 */
export function placedParts(parts) {
  let [low, high] = [0, 0];
  return parts.map(({ share }) => {
    if (share < 0) {
      low += share;
      return { from: low, to: low - share };
    }
    high += share;
    return { from: high - share, to: high };
  });
}

export function shareText(share) {
  const value = 100 * share;
  return `${Math.abs(value) < 0.1 ? number(value, 1) : number(value, Math.abs(value) < 10 ? 2 : 3)} %`;
}

function picture(bars, sources) {
  const readout = h("output", { class: "readout" });
  const cells = bars.map(({ label, parts }) => {
    const placed = placedParts(parts);
    // A bar fills its width; shares below zero move its zero to the right.
    const ends = placed.flatMap(({ from, to }) => [from, to]);
    const [low, high] = [Math.min(...ends), Math.max(...ends)];
    return parts.map(({ source, look, share, detail }, k) => {
      const { from, to } = placed[k];
      const text = `${label}: ${source} ${shareText(share)}${detail ? ` (${detail})` : ""}`;
      const isWide = (to - from) / (high - low) >= LEAST_WRITTEN;
      const cell = h(
        "span",
        { role: "img", "aria-label": text, class: `share ${look}` },
        isWide && h("span", {}, `${number(100 * share, 2)} %`),
      );
      cell.classList.toggle("first-above", low < 0 && from === 0);
      cell.style.left = `${(100 * (from - low)) / (high - low)}%`;
      cell.style.width = `${(100 * (to - from)) / (high - low)}%`;
      return cell;
    });
  });
  readable(cells, readout);
  return h(
    "figure",
    { class: "picture" },
    h(
      "figcaption",
      { class: "legend" },
      sources.map(({ look, source }) => h("span", {}, h("i", { class: `swatch share-of ${look}` }), source)),
    ),
    h(
      "div",
      { class: "stacks", role: "group", "aria-label": "Shares of the uncertainty, by parameter" },
      bars.map(({ label, total, parts }, row) =>
        h(
          "div",
          { class: "stack-row" },
          h("span", { class: "stack-name" }, label),
          h("span", { class: "stack" }, cells[row]),
          h("span", { class: "stack-total" }, total),
          parts
            .filter(({ members }) => members)
            .map(({ members, share }) =>
              h("span", { class: "stack-members quiet" }, `Together ${shareText(share)}: ${members}`),
            ),
        ),
      ),
    ),
    readout,
  );
}

// The table has, for each assumption, its share of the variance of each parameter and how hard the
// residuals pull at it.
/** @param {{ budget?: BudgetLine[], parameters?: any[] }} result */
export function budgetTable({ budget, parameters }) {
  const keys = parameters.map(keyOf).filter((key) => budget.some(({ contributions }) => contributions[key]));
  const largest = ({ contributions }) =>
    Math.max(0, ...Object.values(contributions).map(({ share }) => Math.abs(share)));
  const lines = [...budget].sort((a, b) => largest(b) - largest(a));
  const columns = ["Value", "Residuals pull", "Would explain them", ...keys.map((key) => unknownWords(key))];
  const cells = lines.map((line) => {
    const { value, tolerance, unit, score, suggested, by_default } = line;
    return [
      {
        text: quantity(`${number(value, 4)} ± ${number(tolerance, 2)}`, unit),
        title: by_default ? "nobody declared the tolerance" : null,
      },
      pullOf(score),
      { text: suggested ? `${number(suggested.value, 4)} ± ${number(suggested.standard_error, 2)}` : "–" },
      ...keys.map((key) => {
        const contribution = line.contributions[key];
        return contribution && Math.abs(contribution.share) >= 0.005
          ? {
              text: `${number(100 * contribution.share, 2)} %`,
              value: contribution.share,
              title: `± ${number(contribution.standard_error, 2)}; five times better known: ± ${number(contribution.total_if_better, 2)} in all`,
            }
          : { text: "" };
      }),
    ];
  });
  // Each column sums to 100 %: with the noise, and with what the total covers beside the budget.
  const remainders = keys.map((key) =>
    remainderOf(
      parameters.find((parameter) => keyOf(parameter) === key),
      budget,
    ),
  );
  const row = (part, title) => [
    ...Array.from({ length: 3 }, () => ({ text: "" })),
    ...remainders.map((remainder) => ({
      text: remainder ? `${number(100 * remainder[part], 2)} %` : "–",
      title,
    })),
  ];
  const names = lines.map(({ assumption }) => assumptionWords(assumption));
  names.push("noise alone");
  cells.push(row("noise", "what noise alone leaves unknown"));
  if (remainders.some((remainder) => remainder?.beside > 0.005)) {
    names.push("what else the total covers");
    cells.push(
      row(
        "beside",
        "assumptions that cannot be simulated beside the estimate, other noise models, windows or changes",
      ),
    );
  }
  return h(
    "div",
    {},
    heatTable("Uncertainty budget", names, columns, (i, k) => cells[i][k], { corner: "Taken as known" }),
    h(
      "p",
      { class: "quiet" },
      `Each parameter's column: which share of what is not known of it comes from which assumption. A share below zero makes up for others above it. Beyond ± ${SCORE_LIMIT} σ the residuals contradict the value.`,
      budget.some((line) => line.by_default)
        ? " A model document takes some of them as exact: their tolerances are defaults, and `tolerances` of the job says otherwise."
        : "",
    ),
  );
}

function pullOf(score) {
  if (score === null || score === undefined) {
    return { text: "–", title: "the residuals cannot tell it from the unknowns" };
  }
  const isContradicted = Math.abs(score) > SCORE_LIMIT;
  return {
    text: `${number(score, 2)} σ`,
    value: isContradicted ? -1 : 0,
    title: isContradicted ? "the residuals contradict it" : null,
  };
}

// The shares of the total's square that no assumption has: that of noise alone, and that of what the total
// covers beside the budget; null where the total is not known.
/** @param {any} parameter @param {BudgetLine[]} budget */
export function remainderOf(parameter, budget) {
  const { standard_error: error, total_standard_error: total } = parameter;
  if (!(error >= 0) || !(total > 0)) {
    return null;
  }
  const noise = (error / total) ** 2;
  const assumed = budget
    .map(({ contributions }) => contributions[keyOf(parameter)]?.share ?? 0)
    .reduce((sum, share) => sum + share, 0);
  const beside = 1 - noise - assumed;
  return { noise, beside: beside > ROUNDING ? beside : 0 };
}
