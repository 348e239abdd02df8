// @ts-check
// The picture of a model shows its first output under a step, as the server simulates it.

import { query, send } from "../shell/api.js";
import { h, svg } from "../shell/dom.js";
import { number, quantity, words } from "../shell/format.js";
import { excitationOf, stepOf } from "./excitation.js";

const SIZE = { width: 322, height: 76, edge: 6 };
const POINTS = 160;
/** @type {Map<string, Promise<{ name: string, unit: string, xs: number[], ys: number[] } | null>>} */
const simulated = new Map();

// The response is simulated once for each model, however often its picture is drawn; it is null where
// the simulation fails.
function responseOf(model) {
  if (!simulated.has(model.name)) {
    const excitation = excitationOf(model);
    const simulation = send("POST", `/v1/simulations${query({ max_points: POINTS })}`, {
      model: model.name,
      inputs: stepOf(excitation),
      initial_state: excitation.state,
    });
    simulated.set(
      model.name,
      simulation
        .then(({ data }) => {
          const { name, unit } = model.outputs[0];
          return { name, unit, xs: data.time_s, ys: data.outputs[name].values };
        })
        .catch(() => null),
    );
  }
  return simulated.get(model.name);
}

// Writes samples as the path of a line in the picture.
export function lineOf(xs, ys, { width, height, edge } = SIZE) {
  const [low, high] = [Math.min(...ys), Math.max(...ys)];
  const across = (x) => edge + ((x - xs[0]) / (xs.at(-1) - xs[0] || 1)) * (width - 2 * edge);
  const up = (y) => height - edge - (high > low ? (y - low) / (high - low) : 0.5) * (height - 2 * edge);
  return xs.map((x, k) => `${k ? "L" : "M"}${across(x).toFixed(1)} ${up(ys[k]).toFixed(1)}`).join("");
}

// The ends of a range have as many digits as tell them apart.
export function endTexts(low, high) {
  const texts = (digits) => [low, high].map((end) => number(end, digits));
  const digits = [3, 4, 5, 6, 7].find((many) => texts(many)[0] !== texts(many)[1]) ?? 3;
  return texts(digits);
}

// The picture is drawn when it comes into sight.
export function responsePicture(model) {
  const place = h("span", { class: "response" });
  const seen = new IntersectionObserver(async (entries) => {
    if (!entries.some(({ isIntersecting }) => isIntersecting)) {
      return;
    }
    seen.disconnect();
    const response = await responseOf(model);
    if (!response) {
      return;
    }
    const { name, unit, xs, ys } = response;
    const [low, high] = endTexts(Math.min(...ys), Math.max(...ys)).map((end) => quantity(end, unit));
    const stepped = excitationOf(model).inputs.find(
      (input) => excitationOf(model).before[input.name] !== excitationOf(model).after[input.name],
    );
    place.append(
      svg(
        "svg",
        { viewBox: `0 0 ${SIZE.width} ${SIZE.height}`, class: "diagram", "aria-hidden": "true" },
        svg("path", {
          class: "axis",
          d: `M${SIZE.edge} ${SIZE.edge}V${SIZE.height - SIZE.edge}H${SIZE.width - SIZE.edge}`,
        }),
        svg("path", { class: "curve", d: lineOf(xs, ys) }),
      ),
      h(
        "span",
        { class: "quiet fine" },
        `${words(name)} after a step of ${words(stepped?.name ?? "its input")}: ` +
          `${low} to ${high} in ${number(excitationOf(model).seconds, 3)} s`,
      ),
    );
  });
  seen.observe(place);
  return place;
}
