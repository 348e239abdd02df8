// @ts-check
// An editor for texts: CodeMirror, in a shadow root, where it may bring its own style sheet under the
// page's policy. It is fetched when the first editor is shown.

import { h } from "./dom.js";
import { MODEL_WORDS, wordsAt } from "./model_language.js";

const LIBRARY = "/assets/vendor/codemirror-6.43.15.min.js";
let library = null;

// The editor and the reader of YAML that comes with it.
export function editorLibrary() {
  library ??= import(LIBRARY);
  return library;
}

// { element, value, mark([{ from, to, message }]), go(from, to), ready }. `changed(text)` is called
// with what is typed, not with what is set; `document()` gives what completion may name.
export class Editor {
  /** @param {{ label: string, value?: string, changed?: (text: string) => void, document?: () => any, words?: (before: string, document: any) => any, signal?: AbortSignal }} options */
  constructor({ label, value = "", changed = () => {}, document: known = () => null, words = null, signal = null }) {
    this.label = label;
    this.changed = changed;
    this.known = known;
    this.words = words ?? wordsAt;
    this.text = value;
    this.view = null;
    this.marks = [];
    this.setting = false;
    this.host = h("div", { class: "editor" });
    this.help = h("p", { class: "quiet fine" }, "Tab indents here; Escape, then Tab, leaves the editor. Ctrl+Space lists the names that could stand here.");
    this.element = h("div", { class: "editing" }, this.host, this.help);
    this.host.getText = () => this.value;
    this.ready = editorLibrary().then((made) => signal?.aborted || this.open(made));
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

  // Faults at their places; each is underlined and marked at its line.
  mark(faults) {
    this.marks = faults;
    if (this.view) {
      const { length } = this.view.state.doc;
      const within = (at) => Math.max(0, Math.min(length, at));
      const marks = faults.map(({ from, to, message }) => ({ from: within(from), to: within(Math.max(from, to)), severity: "error", message }));
      this.view.dispatch(this.made.setDiagnostics(this.view.state, marks));
    }
    this.view?.contentDOM.setAttribute("aria-invalid", String(faults.length > 0));
  }

  go(from, to = from) {
    this.view?.dispatch({ selection: { anchor: from, head: to }, scrollIntoView: true });
    this.view?.focus();
  }

  open(made) {
    this.made = made;
    const root = this.host.attachShadow({ mode: "open" });
    const language = made.StreamLanguage.define(MODEL_WORDS);
    const complete = (context) => {
      const before = context.state.doc.sliceString(0, context.pos);
      const found = this.words(before, this.known());
      return found && (context.explicit || found.from < context.pos) ? { ...found, validFor: /^[\p{L}\p{N}_]*$/u } : null;
    };
    this.view = new made.EditorView({
      root, parent: root,
      state: made.EditorState.create({ doc: this.text, extensions: [
        made.lineNumbers(), made.history(), made.drawSelection(), made.bracketMatching(), made.closeBrackets(), made.lintGutter(), language,
        made.indentUnit.of("  "), made.syntaxHighlighting(colours(made)), made.autocompletion({ override: [complete], icons: false }),
        made.keymap.of([...made.closeBracketsKeymap, ...made.completionKeymap, ...made.historyKeymap, ...made.lintKeymap, ...made.defaultKeymap, made.indentWithTab]),
        made.EditorView.lineWrapping, made.EditorView.theme(LOOK),
        made.EditorView.contentAttributes.of({ "aria-label": `${this.label}. Escape, then Tab, leaves the editor.`, spellcheck: "false", tabindex: "0" }),
        made.EditorView.updateListener.of((update) => {
          if (update.docChanged && !this.setting) {
            this.changed(this.value);
          }
        }),
      ] }),
    });
    this.mark(this.marks);
  }
}

// The colours are those of the page, which follow the reader's system.
function colours({ HighlightStyle, tags }) {
  return HighlightStyle.define([
    { tag: tags.propertyName, color: "var(--first)" }, { tag: tags.function(tags.variableName), color: "var(--second)" }, { tag: tags.keyword, color: "var(--second)", fontWeight: "600" },
    { tag: [tags.number, tags.bool], color: "var(--good)" }, { tag: tags.string, color: "var(--text)" }, { tag: tags.comment, color: "var(--quiet)", fontStyle: "italic" },
    { tag: tags.variableName, color: "var(--text)", fontWeight: "600" }, { tag: [tags.operator, tags.punctuation], color: "var(--quiet)" },
  ]);
}

const LOOK = {
  "&": { fontSize: "0.875rem", backgroundColor: "var(--page)", color: "var(--text)", border: "1px solid var(--quiet)", borderRadius: "4px", maxHeight: "70vh", minHeight: "inherit" },
  "&.cm-focused": { outline: "3px solid var(--focus)", outlineOffset: "2px" },
  ".cm-scroller": { fontFamily: "ui-monospace, monospace", lineHeight: "1.5", overflow: "auto" },
  ".cm-content": { caretColor: "var(--text)" },
  ".cm-cursor": { borderLeftColor: "var(--text)" },
  ".cm-gutters": { backgroundColor: "var(--panel)", color: "var(--quiet)", border: "0" },
  "&.cm-focused > .cm-scroller > .cm-selectionLayer .cm-selectionBackground, .cm-selectionBackground": { backgroundColor: "var(--rule)" },
  "&.cm-focused .cm-matchingBracket, .cm-matchingBracket": { backgroundColor: "var(--rule)", color: "inherit" },
  "&.cm-focused .cm-nonmatchingBracket": { backgroundColor: "transparent", color: "var(--bad)" },
  ".cm-tooltip": { backgroundColor: "var(--panel)", color: "var(--text)", border: "1px solid var(--quiet)", borderRadius: "4px" },
  ".cm-tooltip.cm-tooltip-autocomplete > ul": { fontFamily: "ui-monospace, monospace", maxHeight: "14em" },
  ".cm-tooltip.cm-tooltip-autocomplete > ul > li[aria-selected]": { backgroundColor: "var(--link)", color: "var(--page)" },
  ".cm-completionDetail": { fontStyle: "normal", opacity: "0.85" },
  ".cm-diagnostic-error": { borderLeftColor: "var(--bad)", backgroundColor: "var(--panel)" },
  ".cm-lintRange-error": { backgroundImage: "none", textDecoration: "underline wavy var(--bad)", textUnderlineOffset: "3px" },
  ".cm-lint-marker-error": { content: "normal", color: "var(--bad)", fontSize: "0.7rem", textAlign: "center" },
  ".cm-lint-marker-error::before": { content: "'●'" },
  ".cm-panels": { backgroundColor: "var(--panel)", color: "var(--text)" },
};
