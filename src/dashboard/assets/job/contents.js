// @ts-check
// This module leads through the page of a job. The contents stand beside the page on a wide screen, and above
// it on a narrow screen. The tour of the first result is a card that stands before the part that it explains.
// A part of the page is an element with the attribute `data-part`, whose value is its title.

import { h } from "../shell/dom.js";

const LOOKED_AT = 0.4;
const LEAST_PARTS = 3;

/**
 * @param {HTMLElement} root The element that has the parts.
 * @param {AbortSignal} signal
 */
export function contentsOf(root, signal) {
  const list = h("ul", {});
  const element = h("nav", { class: "contents", "aria-label": "Parts of this job", hidden: true }, list);
  /** @type {Map<Element, HTMLElement>} */
  const entries = new Map();
  // The part that the reader looks at is the lowest of those that begin above this share of the window.
  const mark = () => {
    const tops = [...entries.keys()].map(
      (part) => /** @type {[Element, number]} */ ([part, part.getBoundingClientRect().top]),
    );
    const [first] = entries.keys();
    const begun = tops.filter(([, top]) => top < LOOKED_AT * innerHeight);
    const [current] = begun.reduce(
      (lowest, next) => (next[1] > lowest[1] ? next : lowest),
      [first, -Infinity],
    );
    for (const [part, button] of entries) {
      part === current ? button.setAttribute("aria-current", "true") : button.removeAttribute("aria-current");
    }
  };
  let isMarking = false;
  const markSoon = () => {
    if (!isMarking) {
      isMarking = true;
      requestAnimationFrame(() => {
        isMarking = false;
        mark();
      });
    }
  };
  addEventListener("scroll", markSoon, { signal, passive: true });
  const go = (part) => {
    if (part instanceof HTMLDetailsElement) {
      part.open = true;
    }
    part.scrollIntoView({ block: "start" });
    focusOn(part);
  };
  return {
    element,
    // Lists the parts that the page has now.
    draw() {
      const parts = [...root.querySelectorAll("[data-part]")].filter((part) => !part.closest("[hidden]"));
      entries.clear();
      for (const part of parts) {
        const onclick = () => go(part);
        entries.set(
          part,
          h(
            "button",
            { type: "button", class: "link", onclick },
            /** @type {HTMLElement} */ (part).dataset.part,
          ),
        );
      }
      list.replaceChildren(...[...entries.values()].map((button) => h("li", {}, button)));
      element.hidden = parts.length < LEAST_PARTS;
      mark();
    },
  };
}

// Puts the focus on the heading of a part, or on a part without a heading.
/** @param {HTMLElement} part */
function focusOn(part) {
  const heading = part.matches("h3, a") ? part : (part.querySelector("summary, h2, h3") ?? part);
  if (!heading.matches("summary, a")) {
    heading.setAttribute("tabindex", "-1");
  }
  /** @type {HTMLElement} */ (heading).focus({ preventScroll: true });
}

const TOUR = "greybox.tour";
const LEFT = "left";

/** @type {{ part: string, title: string, text: string }[]} */
const STEPS = [
  {
    part: ".verdict",
    title: "Can the numbers be used?",
    text: "The verdict grades the whole estimate: high, moderate or low trust. The reasons stand below it, the gravest first, each with buttons that prepare the job to run next.",
  },
  {
    part: "[data-part='Parameters']",
    title: "What was estimated",
    text: "Each row is a parameter of the plant, with its standard error (±) and its 95 % interval. The bar shows the interval on the range that was searched. Trust grades each parameter by itself.",
  },
  {
    part: "[data-part='Fit']",
    title: "How well the simulation fits",
    text: "A fit of 100 % meets every sample. The fit of validation data counts most: the estimate was made without them.",
  },
  {
    part: "[data-part='Measured and simulated']",
    title: "Where it fits and where it does not",
    text: "The plots show what a single number hides. Drag across a plot to look closer; a double click shows all again.",
  },
  {
    part: "[data-part='Uncertainty budget']",
    title: "Where the uncertainty comes from",
    text: "Each bar divides the uncertainty of a parameter among its causes: the noise of the measurement, and each value that was taken as known. The largest part says what to measure better.",
  },
  {
    part: "a[href$='/report']",
    title: "What to do with the result",
    text: "The report has all of this on paper, with fields to sign. “Use as template”, at the top, begins another job from this one.",
  },
];

// A browser that stores nothing shows the tour once more when the page is opened anew.
let isLeft = false;

function hasLeft() {
  try {
    return isLeft || localStorage.getItem(TOUR) === LEFT;
  } catch {
    return isLeft;
  }
}

function leaveForGood() {
  isLeft = true;
  try {
    localStorage.setItem(TOUR, LEFT);
  } catch {
    // The variable above holds until the page is opened anew.
  }
}

/**
 * Shows the first step of the tour, unless the reader has left a tour before. The focus stays where it is until
 * the reader goes to another step.
 *
 * @param {HTMLElement} root The element that has the parts.
 */
export function startTour(root) {
  if (hasLeft() || root.querySelector(".tour")) {
    return;
  }
  const place = ({ part }) => /** @type {HTMLElement | null} */ (root.querySelector(part));
  const steps = STEPS.filter((step) => place(step));
  if (steps.length === 0) {
    return;
  }
  let step = 0;
  const title = h("p", { class: "grade" });
  const text = h("p", { id: "tour-text" });
  const button = (look, act) =>
    h("button", { type: "button", class: look, "aria-describedby": "tour-text", onclick: act });
  const back = button("small", () => go(step - 1));
  const next = button("small primary", () => (step + 1 < steps.length ? go(step + 1) : leave()));
  const away = button("small", () => leave());
  back.textContent = "Back";
  away.textContent = "Leave the tour";
  const card = h(
    "section",
    {
      class: "tour",
      "aria-label": "Tour of the result",
      onkeydown: ({ key }) => key === "Escape" && leave(),
    },
    title,
    text,
    h("div", { class: "actions" }, back, next, away),
  );
  const show = () => {
    const entry = steps[step];
    const isLast = step + 1 === steps.length;
    title.replaceChildren(
      h("strong", {}, entry.title),
      h("span", { class: "quiet" }, ` ${step + 1} of ${steps.length}`),
    );
    text.textContent = entry.text;
    back.hidden = step === 0;
    away.hidden = isLast;
    next.textContent = isLast ? "End the tour" : "Next";
    const target = place(entry);
    const part = target?.matches("a") ? target.parentElement : target;
    part?.before(card);
    if (part instanceof HTMLDetailsElement) {
      part.open = true;
    }
  };
  const go = (to) => {
    step = to;
    show();
    card.scrollIntoView({ block: "start" });
    next.focus({ preventScroll: true });
  };
  const leave = () => {
    leaveForGood();
    card.remove();
    const part = place(steps[step]);
    part && focusOn(part);
  };
  show();
}
