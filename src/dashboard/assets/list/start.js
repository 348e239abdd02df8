// @ts-check
// The first page says what the service is for, and lets a newcomer try it: with a recording whose true
// parameters are known, or with a file.

import { get, send } from "../shell/api.js";
import { h, notice, svg } from "../shell/dom.js";

export function showStart(view) {
  view.root.append(h("h1", { tabindex: "-1" }, "greybox"), startPanel(view));
}

export function startPanel(view) {
  const outcome = notice();
  const state = h("span", { class: "quiet", role: "status" });
  const button = h(
    "button",
    {
      type: "button",
      class: "primary for-writers",
      onclick: async () => {
        button.disabled = true;
        outcome.clear();
        try {
          location.hash = `/jobs/${await demonstrate(view, (text) => {
            state.textContent = text;
          })}`;
        } catch (error) {
          outcome.fail(error);
          state.textContent = "";
        }
        button.disabled = false;
      },
    },
    "Try it with the demonstration rig",
  );
  return h(
    "section",
    { class: "start", "aria-label": "First steps" },
    h(
      "p",
      {},
      "A recording of a plant shows what went in and what came out. greybox finds the physical parameters of the plant from it: masses, dampings, gains, time constants. With each it says how far it can be off, whether it can be trusted, and what to do where it cannot.",
    ),
    picture(),
    h(
      "div",
      { class: "actions" },
      button,
      h("a", { class: "button for-writers", href: "#/new" }, "Begin with your own file"),
      h("a", { class: "button", href: "/docs/start" }, "Read how it works"),
      state,
    ),
    outcome.place,
    h(
      "p",
      { class: "quiet" },
      "The demonstration is two minutes of a simulated servo axis, measured as a data logger would; its true parameters stand beside the estimates.",
    ),
  );
}

// Stores the recording of the demonstration, and starts its job; answers the id of the job.
async function demonstrate(view, tell) {
  tell("Making the recording …");
  const { data: demonstration } = await get("/v1/demonstration", view.signal);
  tell("Storing the recording …");
  const { data: dataset } = await send("POST", "/v1/datasets", demonstration.recording);
  const job = /** @type {any} */ (demonstration.job);
  const [experiment] = job.experiments;
  const { data } = await send("POST", "/v1/jobs", {
    ...job,
    experiments: [{ ...experiment, dataset: dataset.id }],
  });
  return data.id;
}

const SIZE = { width: 724, height: 150 };

// The picture shows how a recording becomes parameters.
function picture() {
  const box = (x, width) => svg("rect", { x, y: 20, width, height: 100, rx: 6 });
  const caption = (x, y, text, look = "") => svg("text", { x, y, class: `caption middle ${look}` }, text);
  const arrow = (from, to) =>
    svg("path", { class: "arrow", fill: "none", d: `M${from} 70H${to}m-7 -5l7 5l-7 5` });
  const wave = (x, y, width, height) => {
    const points = Array.from({ length: 41 }, (_, k) => {
      const share = k / 40;
      const value = 1 - Math.exp(-4 * share) * Math.cos(14 * share);
      return `${k ? "L" : "M"}${(x + share * width).toFixed(1)} ${(y + height * (0.65 - 0.5 * value)).toFixed(1)}`;
    });
    return svg("path", { class: "curve", d: points.join("") });
  };
  const estimate = (y, name, low, high) => [
    svg("text", { x: 552, y: y + 4, class: "caption" }, name),
    svg("path", { class: "curve", d: `M${592 + low} ${y}H${592 + high}` }),
    svg("circle", { cx: 592 + (low + high) / 2, cy: y, r: 3.5, class: "best" }),
  ];
  return svg(
    "svg",
    {
      viewBox: `0 0 ${SIZE.width} ${SIZE.height}`,
      class: "diagram wide",
      role: "img",
      "aria-label": "A recording and the equations of a plant go in; parameters with intervals come out.",
    },
    box(4, 200),
    wave(20, 40, 168, 76),
    caption(104, 110, "recording", "faint"),
    arrow(208, 258),
    box(262, 200),
    caption(362, 62, "m · a = F − d · v"),
    caption(362, 84, "m, d unknown"),
    caption(362, 110, "equations of the plant", "faint"),
    arrow(466, 516),
    box(520, 200),
    estimate(46, "m", 20, 52),
    estimate(74, "d", 34, 96),
    caption(620, 110, "parameters, trusted or not", "faint"),
  );
}
