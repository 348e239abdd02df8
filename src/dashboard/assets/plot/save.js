// @ts-check
// A plot is saved as a PNG or SVG of what it shows, or as a CSV of its numbers.

import { h } from "../shell/dom.js";
import { escaped, unitSigns } from "../shell/format.js";
import { axis, axisTitle, rangeOf } from "./axes.js";
import { isoText } from "./clock.js";

const SIZE = { width: 1000, height: 360, left: 80, right: 16, top: 34, bottom: 44 };
const COLOURS = {
  first: "#1769aa",
  second: "#b3500b",
  measured: "#6b7681",
  faint: "#6b7681",
  simulated: "#b3261e",
};
const ROW = [
  "#1769aa",
  "#b3500b",
  "#1d6f42",
  "#7a3e9d",
  "#8a5a00",
  "#00798c",
  "#b3261e",
  "#4a5a6a",
  "#a0307a",
  "#3f6b00",
];

export function saveMenu(plot) {
  const item = (text, act) =>
    h(
      "button",
      {
        type: "button",
        class: "small",
        onclick: (event) => {
          event.target.closest("details").open = false;
          act();
        },
      },
      text,
    );
  return h(
    "details",
    { class: "save" },
    h("summary", { "aria-label": `Save ${plot.title}` }, "Save"),
    h(
      "div",
      { class: "menu" },
      item("PNG", () => savePng(plot)),
      item("SVG", () => save(plot, svgText(plot), "svg", "image/svg+xml")),
      item("CSV", () => save(plot, csvText(plot), "csv", "text/csv")),
    ),
  );
}

export function download(blob, name) {
  const address = URL.createObjectURL(blob);
  const link = h("a", { href: address, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}

function save(plot, text, extension, type) {
  download(new Blob([text], { type }), `${fileName(plot.title)}.${extension}`);
}

function fileName(title) {
  return (
    title
      .toLowerCase()
      .replace(/[^a-z0-9]+/g, "-")
      .replace(/^-|-$/g, "") || "plot"
  );
}

function savePng(plot) {
  const drawn = plot.chart?.ctx.canvas;
  if (!drawn) {
    return;
  }
  const ratio = drawn.width / plot.chart.width;
  const canvas = document.createElement("canvas");
  canvas.width = drawn.width;
  canvas.height = drawn.height + 30 * ratio;
  const brush = canvas.getContext("2d");
  const style = getComputedStyle(document.documentElement);
  brush.fillStyle = style.getPropertyValue("--page");
  brush.fillRect(0, 0, canvas.width, canvas.height);
  brush.fillStyle = style.getPropertyValue("--text");
  brush.font = `600 ${15 * ratio}px system-ui, sans-serif`;
  brush.fillText(`${plot.title} [${unitSigns(plot.unit.name)}]`, 10 * ratio, 20 * ratio);
  brush.drawImage(drawn, 0, 30 * ratio);
  canvas.toBlob((blob) => download(blob, `${fileName(plot.title)}.png`));
}

// The CSV has the samples that the plot shows, in the units that it shows.
export function csvText(plot) {
  const [from, to] = plot.extent();
  const unit = (name) => (name ? ` [${name}]` : "");
  const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const head = [
    `${plot.x.label}${unit(plot.x.unit)}`,
    ...plot.series.map(({ name }) => `${name}${unit(plot.unit.name)}`),
  ];
  const rows = [head.map(quoted).join(",")];
  plot.xs.forEach((x, k) => {
    if (x >= from && x <= to) {
      rows.push([plot.x.clock ? isoText(x) : x, ...plot.shown.map((column) => column[k] ?? "")].join(","));
    }
  });
  return `${rows.join("\n")}\n`;
}

export function svgText(plot) {
  const [from, to] = plot.extent();
  const inside = plot.xs.map((x) => x >= from && x <= to);
  const seen = plot.shown.map((column) => column.filter((_, k) => inside[k]));
  const { width, height, left, right, top, bottom } = SIZE;
  const horizontal = axis([from, to], { steps: 8, tight: true });
  /** @type {any[]} */
  const ticks = plot.clock?.ticks([from, to], 8) ?? horizontal.ticks;
  const vertical = axis(rangeOf(seen, plot.y.log) ?? [0, 1], { log: plot.y.log, steps: 6 });
  const atX = (value) => left + horizontal.position(value) * (width - left - right);
  const atY = (value) => top + (1 - vertical.position(value)) * (height - top - bottom);
  const text = (x, y, words, anchor = "start", weight = "400") =>
    `<text x="${x.toFixed(1)}" y="${y.toFixed(1)}" text-anchor="${anchor}" font-weight="${weight}">${escaped(words)}</text>`;
  const parts = [
    `<rect width="${width}" height="${height}" fill="#ffffff"/>`,
    text(10, 18, plot.title, "start", "600"),
  ];
  for (const [value, words] of vertical.ticks) {
    parts.push(
      `<path stroke="#d4dae0" d="M${left} ${atY(value).toFixed(1)}H${width - right}"/>`,
      text(left - 6, atY(value) + 4, words, "end"),
    );
  }
  for (const [value, words] of ticks) {
    parts.push(text(atX(value), height - bottom + 18, words.replace("\n", ", "), "middle"));
  }
  const exponent = plot.clock ? 0 : horizontal.exponent;
  parts.push(
    text(width - right, height - 6, axisTitle(plot.x.label, plot.x.unit ?? "", exponent), "end"),
    text(width - right, 18, axisTitle("", plot.unit.name, vertical.exponent).trim(), "end"),
  );
  plot.shown.forEach((column, k) => {
    const { look, step, name } = plot.series[k];
    const stroke = COLOURS[look] ?? ROW[k % ROW.length];
    parts.push(
      `<path fill="none" stroke="${stroke}" stroke-width="1.4" d="${path(plot.xs, column, inside, atX, atY, step)}"/>`,
    );
    if (plot.series.length > 1) {
      parts.push(`<g fill="${stroke}">${text(width - right - 10, top + 16 + 16 * k, name, "end")}</g>`);
    }
  });
  const font = 'font-family="sans-serif" font-size="12" fill="#1b2127"';
  const head = `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${width} ${height}" ${font}>`;
  return `${head}${parts.join("\n")}</svg>\n`;
}

function path(xs, column, inside, atX, atY, step) {
  let text = "";
  let pen = "M";
  column.forEach((value, k) => {
    if (value === null || !inside[k]) {
      pen = "M";
      return;
    }
    const x = atX(xs[k]).toFixed(1);
    text += step && pen === "L" ? `H${x}V${atY(value).toFixed(1)}` : `${pen}${x} ${atY(value).toFixed(1)}`;
    pen = "L";
  });
  return text;
}
