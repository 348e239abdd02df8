// @ts-check
// The search looks for words in the chapters of the guides and in the operations of the API. A chapter answers a search
// that has each of the words in its title or in its text, at the beginning of a word.

/** @typedef {{ page: string, title: string, to: string, text: string }} Chapter */
/** @typedef {{ chapter: Chapter, score: number, snippet: string[] }} Hit */

const IN_TITLE = 20;
const IN_TEXT = 1;
const MOST_IN_TEXT = 5;
const AROUND = 70;

/**
 * Lists what answers a search, the best first.
 *
 * @param {Chapter[]} chapters
 * @param {string} words
 * @returns {Hit[]}
 */
export function hitsOf(chapters, words) {
  const patterns = words.split(/\s+/).filter(Boolean).map(beginning);
  if (patterns.length === 0) {
    return [];
  }
  return chapters
    .map((chapter) => ({
      chapter,
      score: scoreOf(chapter, patterns),
      snippet: snippetOf(chapter.text, patterns),
    }))
    .filter(({ score }) => score > 0)
    .sort((a, b) => b.score - a.score);
}

// An underscore stands between words, as in the names of fields.
/** @param {string} word */
function beginning(word) {
  const literal = word.replace(/[.*+?^${}()|[\]\\]/g, "\\$&");
  return new RegExp(`(?<![\\p{L}\\p{N}])${literal}`, "giu");
}

/**
 * @param {Chapter} chapter
 * @param {RegExp[]} patterns
 */
function scoreOf({ title, text }, patterns) {
  const scores = patterns.map((pattern) => {
    const inText = Math.min(MOST_IN_TEXT, text.match(pattern)?.length ?? 0);
    return IN_TITLE * (title.match(pattern)?.length ?? 0) + IN_TEXT * inText;
  });
  return scores.every((score) => score > 0) ? scores.reduce((sum, score) => sum + score) : 0;
}

/**
 * Cuts the text around the first of the words: pieces, of which every second one is a word that was looked for.
 *
 * @param {string} text
 * @param {RegExp[]} patterns
 */
function snippetOf(text, patterns) {
  const places = patterns.map((pattern) => text.search(pattern)).filter((place) => place >= 0);
  const first = places.length > 0 ? Math.min(...places) : 0;
  const from = first > AROUND ? text.indexOf(" ", first - AROUND) + 1 : 0;
  const end = text.indexOf(" ", from + 3 * AROUND);
  const cut = text.slice(from, end < 0 ? text.length : end);
  const whole = new RegExp(`(${patterns.map(({ source }) => source).join("|")})`, "iu");
  const pieces = cut.split(whole);
  pieces[0] = `${from > 0 ? "… " : ""}${pieces[0]}`;
  pieces[pieces.length - 1] += end < 0 ? "" : " …";
  return pieces;
}
