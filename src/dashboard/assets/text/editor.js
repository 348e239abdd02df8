// @ts-check
// The editor of texts is CodeMirror, in a shadow root, where it may bring its style sheet under the
// policy of the page. The library is fetched when the first editor is shown.

import { h } from "../shell/dom.js";

const LIBRARY = "/assets/vendor/codemirror-6.43.15.min.js";
let library = null;

// The library has the editor and the parser of YAML.
export function editorLibrary() {
  library ??= import(LIBRARY);
  return library;
}

// An editor has { element, value, mark([{ from, to, message }]), go(from, to), ready }. `changed(text)`
// is called with typed text, not with text that is set; `language` tells the words of the text apart,
// and `words(before)` completes the text before the cursor.
export class Editor {
  /**
   * @param {{
   *   label: string,
   *   value?: string,
   *   changed?: (text: string) => void,
   *   language: any,
   *   words: (before: string) => any,
   *   signal?: AbortSignal,
   * }} options
   */
  constructor({ label, value = "", changed = () => {}, language, words, signal = null }) {
    this.label = label;
    this.changed = changed;
    this.language = language;
    this.words = words;
    this.text = value;
    this.view = null;
    this.marks = [];
    this.setting = false;
    this.host = h("div", { class: "editor" });
    this.help = h(
      "p",
      { class: "quiet fine" },
      "Tab indents here; Escape, then Tab, leaves the editor. Ctrl+Space lists the names that could stand here.",
    );
    this.element = h("div", { class: "editing" }, this.host, this.help);
    this.host.getText = () => this.value;
    this.ready = editorLibrary().then((library) => signal?.aborted || this.open(library));
    signal?.addEventListener("abort", () => this.view?.destroy(), { once: true });
  }

  get value() {
    return this.view ? this.view.state.doc.toString() : this.text;
  }

  set value(text) {
    this.text = text;
    if (this.view && text !== this.view.state.doc.toString()) {
      this.setting = true;
      this.view.dispatch({ changes: { from: 0, to: this.view.state.doc.length, insert: text } });
      this.setting = false;
    }
  }

  // Each fault is underlined at its place and marked at its line.
  mark(faults) {
    this.marks = faults;
    if (this.view) {
      const { length } = this.view.state.doc;
      const within = (at) => Math.max(0, Math.min(length, at));
      const marks = faults.map(({ from, to, message }) => ({
        from: within(from),
        to: within(Math.max(from, to)),
        severity: "error",
        message,
      }));
      this.view.dispatch(this.library.setDiagnostics(this.view.state, marks));
    }
    this.view?.contentDOM.setAttribute("aria-invalid", String(faults.length > 0));
  }

  go(from, to = from) {
    this.view?.dispatch({ selection: { anchor: from, head: to }, scrollIntoView: true });
    this.view?.focus();
  }

  open(library) {
    this.library = library;
    const root = this.host.attachShadow({ mode: "open" });
    const language = library.StreamLanguage.define(this.language);
    const complete = (context) => {
      const before = context.state.doc.sliceString(0, context.pos);
      const completions = this.words(before);
      return completions && (context.explicit || completions.from < context.pos)
        ? { ...completions, validFor: /^[\p{L}\p{N}_]*$/u }
        : null;
    };
    this.view = new library.EditorView({
      root,
      parent: root,
      state: library.EditorState.create({
        doc: this.text,
        extensions: [
          library.lineNumbers(),
          library.history(),
          library.drawSelection(),
          library.bracketMatching(),
          library.closeBrackets(),
          library.lintGutter(),
          language,
          library.indentUnit.of("  "),
          library.syntaxHighlighting(colours(library)),
          library.autocompletion({ override: [complete], icons: false }),
          library.keymap.of([
            ...library.closeBracketsKeymap,
            ...library.completionKeymap,
            ...library.historyKeymap,
            ...library.lintKeymap,
            ...library.defaultKeymap,
            library.indentWithTab,
          ]),
          library.EditorView.lineWrapping,
          library.EditorView.theme(LOOK),
          library.EditorView.contentAttributes.of({
            "aria-label": `${this.label}. Escape, then Tab, leaves the editor.`,
            spellcheck: "false",
            tabindex: "0",
          }),
          library.EditorView.updateListener.of((update) => {
            if (update.docChanged && !this.setting) {
              this.changed(this.value);
            }
          }),
        ],
      }),
    });
    this.mark(this.marks);
  }
}

// The colours are the colours of the page, which follow the reader's system.
function colours({ HighlightStyle, tags }) {
  return HighlightStyle.define([
    { tag: tags.propertyName, color: "var(--first)" },
    { tag: tags.function(tags.variableName), color: "var(--second)" },
    { tag: tags.keyword, color: "var(--second)", fontWeight: "600" },
    { tag: [tags.number, tags.bool], color: "var(--good)" },
    { tag: tags.string, color: "var(--text)" },
    { tag: tags.comment, color: "var(--quiet)", fontStyle: "italic" },
    { tag: tags.variableName, color: "var(--text)", fontWeight: "600" },
    { tag: [tags.operator, tags.punctuation], color: "var(--quiet)" },
  ]);
}

const LOOK = {
  "&": {
    fontSize: "0.875rem",
    backgroundColor: "var(--page)",
    color: "var(--text)",
    border: "1px solid var(--quiet)",
    borderRadius: "4px",
    maxHeight: "70vh",
    minHeight: "inherit",
  },
  "&.cm-focused": { outline: "3px solid var(--focus)", outlineOffset: "2px" },
  ".cm-scroller": { fontFamily: "ui-monospace, monospace", lineHeight: "1.5", overflow: "auto" },
  ".cm-content": { caretColor: "var(--text)" },
  ".cm-cursor": { borderLeftColor: "var(--text)" },
  ".cm-gutters": { backgroundColor: "var(--panel)", color: "var(--quiet)", border: "0" },
  "&.cm-focused > .cm-scroller > .cm-selectionLayer .cm-selectionBackground, .cm-selectionBackground": {
    backgroundColor: "var(--rule)",
  },
  "&.cm-focused .cm-matchingBracket, .cm-matchingBracket": {
    backgroundColor: "var(--rule)",
    color: "inherit",
  },
  "&.cm-focused .cm-nonmatchingBracket": { backgroundColor: "transparent", color: "var(--bad)" },
  ".cm-tooltip": {
    backgroundColor: "var(--panel)",
    color: "var(--text)",
    border: "1px solid var(--quiet)",
    borderRadius: "4px",
  },
  ".cm-tooltip.cm-tooltip-autocomplete > ul": { fontFamily: "ui-monospace, monospace", maxHeight: "14em" },
  ".cm-tooltip.cm-tooltip-autocomplete > ul > li[aria-selected]": {
    backgroundColor: "var(--link)",
    color: "var(--page)",
  },
  ".cm-completionDetail": { fontStyle: "normal", opacity: "0.85" },
  ".cm-diagnostic-error": { borderLeftColor: "var(--bad)", backgroundColor: "var(--panel)" },
  ".cm-lintRange-error": {
    backgroundImage: "none",
    textDecoration: "underline wavy var(--bad)",
    textUnderlineOffset: "3px",
  },
  ".cm-lint-marker-error": {
    content: "normal",
    color: "var(--bad)",
    fontSize: "0.7rem",
    textAlign: "center",
  },
  ".cm-lint-marker-error::before": { content: "'●'" },
  ".cm-panels": { backgroundColor: "var(--panel)", color: "var(--text)" },
};
