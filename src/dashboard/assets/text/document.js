// @ts-check
// This module reads a document in YAML or JSON (which is YAML too): its value, its faults, and the
// range of each of its places in the text. The parser of YAML comes with the editor.

// Gives { value, faults: [{ from, to, message }], range(pointer) }.
export function readText(yaml, text) {
  const read = yaml.parseDocument(text, { prettyErrors: false, uniqueKeys: true });
  const faults = read.errors.map(({ pos: [from, to], message }) => ({
    from,
    to,
    message: sentence(message),
  }));
  let value = null;
  if (faults.length === 0) {
    try {
      value = read.toJS({ maxAliasCount: 0 });
    } catch (error) {
      faults.push({ from: 0, to: text.length, message: error.message });
    }
  }
  return { value, faults, range: (pointer) => placeOf(yaml, read.contents, text, pointer) };
}

const sentence = (message) => message.split("\n")[0];

// Lists the names on the way that a JSON pointer goes.
/** @param {string} pointer */
export const namesOnTheWay = (pointer) =>
  pointer
    .split("/")
    .slice(1)
    .map((part) => part.replaceAll("~1", "/").replaceAll("~0", "~"));

// Gives the range of the value that a JSON pointer names, else of the nearest value above it: { from,
// to, exact, scalar }.
function placeOf(yaml, root, text, pointer) {
  let node = root;
  let nearest = { from: 0, to: Math.max(0, text.indexOf("\n")), exact: pointer === "" };
  const parts = namesOnTheWay(pointer);
  for (const [k, part] of parts.entries()) {
    const last = k === parts.length - 1;
    if (yaml.isMap(node)) {
      const pair = node.items.find(({ key }) => String(key?.value) === part);
      if (!pair) {
        return nearest;
      }
      const [from, to] = pair.key.range;
      nearest = { from, to, exact: last };
      node = pair.value;
    } else if (yaml.isSeq(node) && node.items[part]) {
      node = node.items[part];
      nearest = { from: node.range?.[0] ?? nearest.from, to: node.range?.[1] ?? nearest.to, exact: last };
    } else {
      return nearest;
    }
  }
  if (yaml.isScalar(node) && node.range && node.range[1] > node.range[0]) {
    const quoted = ["QUOTE_DOUBLE", "QUOTE_SINGLE"].includes(node.type) ? 1 : 0;
    return { from: node.range[0] + quoted, to: node.range[1] - quoted, exact: true, scalar: true };
  }
  return nearest;
}

// Places the faults that a server finds in a document in its text: [{ from, to, message, line, column
// }].
export function placed(read, text, faults, prefix = "") {
  return faults.map(({ pointer = "", line, column, detail }) => {
    const place = pointer.startsWith(prefix) ? pointer.slice(prefix.length) : pointer;
    let { from, to, scalar } = read.range(place);
    if (scalar && line && column) {
      from = Math.min(to, inside(text, from, to, Number(line), Number(column)));
      to = Math.max(from, from + (/^[\p{L}\p{N}_.]+|^./u.exec(text.slice(from, to))?.[0].length ?? 0));
    }
    return {
      from,
      to: Math.min(to, text.length),
      message: detail,
      line: lineAt(text, from),
      column: columnAt(text, from),
    };
  });
}

// Gives the offset of a column in a line of a scalar; a scalar that goes over several lines of the
// document is followed line by line.
function inside(text, from, to, line, column) {
  let at = from;
  for (let k = 1; k < line; k += 1) {
    const next = text.indexOf("\n", at);
    if (next < 0 || next >= to) {
      break;
    }
    at = next + 1 + /^ */.exec(text.slice(next + 1))[0].length;
  }
  return at + [...text.slice(at, to)].slice(0, column - 1).join("").length;
}

export const lineAt = (text, at) => text.slice(0, at).split("\n").length;
export const columnAt = (text, at) => at - text.lastIndexOf("\n", at - 1);

// Writes a document as YAML, each entry of a section on a line of its own.
export function asYaml(yaml, value) {
  const document = new yaml.Document(value);
  for (const { value: section } of document.contents.items) {
    if (yaml.isMap(section)) {
      section.items.forEach(({ value: entry }) => {
        if (yaml.isMap(entry) || yaml.isSeq(entry)) {
          entry.flow = true;
        }
      });
    }
  }
  return document.toString({ lineWidth: 0, flowCollectionPadding: false });
}
