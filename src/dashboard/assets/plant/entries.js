// @ts-check
// This module chooses which entries of the audit log are shown. The functions are pure.

// Entries about deliveries and commands have methods that HTTP has not.
const WORDS = { DELIVER: "a delivery", COMMAND: "a command" };

export const methodText = (method) => WORDS[method] ?? method;

export const isRefusal = ({ status }) => status >= 400;

/**
 * Every word of the text has to stand somewhere in an entry.
 *
 * @param {any[]} entries
 * @param {{ text?: string, method?: string, outcome?: string }} filter
 */
export function matchingEntries(entries, { text = "", method = "", outcome = "" }) {
  const parts = text.toLowerCase().split(/\s+/).filter(Boolean);
  return entries.filter(
    (entry) =>
      (!method || entry.method === method) &&
      (!outcome || isRefusal(entry) === (outcome === "refused")) &&
      parts.every((part) => textOf(entry).includes(part)),
  );
}

function textOf({ who, project, address, method, path, status, request_id: request }) {
  return [who, project, address, method, path, status, request].join("\n").toLowerCase();
}
