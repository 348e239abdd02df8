// @ts-check
// A line of the form of a new job says which version of a recording's marks the job leaves out, and offers the other
// versions.

import { numberOfVersion, UNMARKED, versionName } from "../data/marks.js";
import { get, items } from "../shell/api.js";
import { h } from "../shell/dom.js";

/** @typedef {import("../data/marks.js").Version} Version */

// Gives the marks that an experiment leaves out: those of its version, or of the newest version where it has none; null
// where the version is not among those that were read.
/** @param {Version[]} versions @param {any} asked */
export function marksLeftOut(versions, asked) {
  const number = numberOfVersion(asked);
  if (number === 0 || (number === undefined && versions.length === 0)) {
    return [];
  }
  const version = number === undefined ? versions[0] : versions.find((version) => version.number === number);
  return version?.marks ?? asked?.marks ?? null;
}

// Says what is left out, in words.
/** @param {Version[]} versions @param {any} asked */
export function versionText(versions, asked) {
  const number = numberOfVersion(asked) ?? versions[0]?.number ?? 0;
  return number === 0
    ? "Nothing that is marked as bad is left out"
    : `Leaves out what is marked as bad: ${versionName({ number, marks: marksLeftOut(versions, asked) })}`;
}

// Says that a version is not the newest; the text is empty elsewhere.
/** @param {Version[]} versions @param {any} asked */
export function newerText(versions, asked) {
  const [newest, number] = [versions[0]?.number ?? 0, numberOfVersion(asked)];
  return number !== undefined && number < newest ? `version ${newest} is newer` : "";
}

export class VersionLine {
  /**
   * `put(number)` sets the version of the experiments, undefined for the newest, and `drawn()` is called once the
   * versions are read.
   *
   * @param {any} recording
   * @param {{ signal: AbortSignal, put: (number: number | undefined) => void, drawn: () => void, failed: (error: any) => void }} acts
   */
  constructor(recording, { signal, put, drawn, failed }) {
    this.recording = recording;
    this.put = put;
    this.asked = undefined;
    /** @type {Version[]} */
    this.versions = [];
    this.words = h("span", {});
    this.newer = h("strong", {});
    this.choice = h("select", {
      "aria-label": `Version of the marks of ${recording.name || recording.id}`,
      onchange: () => put(this.choice.value === "" ? undefined : Number(this.choice.value)),
    });
    this.element = h("p", { class: "leave-out", hidden: true }, this.words, this.choice, this.newer);
    if (recording.version > 0) {
      this.read(signal).then(() => {
        this.draw(this.asked);
        drawn();
      }, failed);
    }
  }

  async read(signal) {
    const { data } = await get(`/v1/datasets/${this.recording.id}/versions`, signal);
    const number = numberOfVersion(this.asked) ?? 0;
    const isRead = number === 0 || items(data).some((version) => version.number === number);
    const further = isRead ? [] : [await get(`/v1/datasets/${this.recording.id}/versions/${number}`, signal)];
    this.versions = [...items(data), ...further.map((answer) => answer.data)];
  }

  get marks() {
    return marksLeftOut(this.versions, this.asked) ?? [];
  }

  // `asked` is the version as the specification has it: a number, an object, or nothing.
  draw(asked) {
    this.asked = asked;
    const number = numberOfVersion(asked);
    const { versions } = this;
    this.element.hidden = versions.length === 0 && number === undefined;
    this.words.textContent = versionText(versions, asked);
    this.newer.textContent = newerText(versions, asked);
    const listed = [...versions, UNMARKED];
    const isListed = number === undefined || listed.some((version) => version.number === number);
    const all = isListed ? listed : [{ number, marks: marksLeftOut(versions, asked) }, ...listed];
    const option = (value, text, isChosen) => h("option", { value, selected: isChosen }, text);
    this.choice.replaceChildren(
      option("", "the newest version", number === undefined),
      ...all.map((version) =>
        option(String(version.number), versionName(version), version.number === number),
      ),
    );
  }
}
