#!/usr/bin/env python3
"""Counts words that make Rust code hard to read: `.ci/words.py [TREE] [--list] [--under PREFIX]`.

The sources of TREE (default: the current folder) are `src/**/*.rs` and `crates/*/src/**/*.rs` without tests. The counts:
  names     names of types (struct, enum, union, trait, alias) that stand for more than one type, and the types behind them
  pronouns  bindings and fields named by a pronoun or a bare participle instead of the noun of the field, for each word
  tuples    parameters of functions whose pattern or type is a tuple, which hides several parameters in one
  hanging   comments that begin by leaning on the item before
With --list every place is printed below its count. With --under only places in files below PREFIX are counted; a name counts
there as soon as one of its types stands there.
"""
import argparse
import collections
import pathlib
import re

PRONOUNS = ("own", "found", "known", "said", "one", "such", "other", "others", "that", "those", "it")
HANGING = re.compile(
    r"(?:The same\b|The others?\b(?= (?:of|that|is|are)\b|[.,:;])|The (?:former|latter)\b|Those\b|That (?:of|which|one)\b|This one\b|Another one\b"
    r"|Likewise\b|Ditto\b|As (?:above|before|many)\b|Here too\b|And\b|But\b|Also\b|So\b|Such\b|Its\b|Theirs?\b"
    r"|(?:What|Which|Where|When|How|Whether|Whose) (?:it|its|they|their|those|these|came|was|were)\b|Whose it\b|Of (?!course\b))"
)
TOKEN = re.compile(
    r"(?P<space>\s+)"
    r"|(?P<comment>//[^\n]*)"
    r"|(?P<block>/\*.*?\*/)"
    r"|(?P<raw>b?r(?P<hashes>#*)\".*?\"(?P=hashes))"
    r"|(?P<text>b?\"(?:\\.|[^\"\\])*\")"
    r"|(?P<char>b?'(?:\\(?:x[0-9a-fA-F]{2}|u\{[^}]*\}|.)|[^'\\])')"
    r"|(?P<lifetime>'[A-Za-z_]\w*)"
    r"|(?P<word>(?:r#)?[A-Za-z_]\w*)"
    r"|(?P<number>\d[\w]*(?:\.\d[\w]*)?)"
    r"|(?P<mark>=>|->|==|!=|<=|>=|&&|\|\||::|\.\.=|\.\.|.)",
    re.DOTALL,
)
OPEN, CLOSE = {"(": ")", "[": "]", "{": "}"}, {")", "]", "}"}


class Token:
    """A token: `kind` is the name of the group in TOKEN that matched, `line` counts from one."""

    def __init__(self, kind, text, line):
        self.kind, self.text, self.line = kind, text, line


def tokens_of(source):
    """Returns the code tokens and the comments of a file, each as a list of Token."""
    code, comments, line = [], [], 1
    for match in TOKEN.finditer(source):
        kind, text = match.lastgroup, match.group()
        kind = "raw" if match.group("raw") is not None else kind
        if kind == "comment":
            comments.append(Token(kind, text, line))
        elif kind not in ("space", "block"):
            code.append(Token(kind, text, line))
        line += text.count("\n")
    return code, comments


def end_of_group(code, start):
    """Returns the index of the bracket that closes the one at `start`."""
    depth = 0
    for index in range(start, len(code)):
        if code[index].kind == "mark":
            depth += (code[index].text in OPEN) - (code[index].text in CLOSE)
            if depth == 0:
                return index
    return len(code) - 1


def without_tests(code):
    """Returns `code` without the items under `#[cfg(test)]` and `#[test]`, and the ranges of lines that were left out."""
    kept, hidden, index = [], [], 0
    while index < len(code):
        attribute = "".join(token.text for token in code[index : index + 7])
        if attribute.startswith(("#[cfg(test)]", "#[test]")) or attribute.startswith("#[cfg(all(test"):
            stop = end_of_group(code, index + 1) + 1
            while stop < len(code) and code[stop].text not in ("{", ";"):
                stop = end_of_group(code, stop) + 1 if code[stop].text in ("(", "[") else stop + 1
            stop = end_of_group(code, stop) if stop < len(code) and code[stop].text == "{" else stop
            hidden.append((code[index].line, code[min(stop, len(code) - 1)].line))
            index = stop + 1
        else:
            kept.append(code[index])
            index += 1
    return kept, hidden


def split_at_commas(code):
    """Splits tokens at the commas that stand in no bracket, angle brackets included."""
    parts, part, depth, angles = [], [], 0, 0
    for token in code:
        if token.kind == "mark":
            depth += (token.text in OPEN) - (token.text in CLOSE)
            angles = max(0, angles + (token.text == "<") - (token.text == ">"))
            if token.text == "," and depth == 0 and angles == 0:
                parts.append(part)
                part = []
                continue
        part.append(token)
    return [each for each in parts + [part] if each]


def split_at_colon(part):
    """Splits a parameter at the colon between its pattern and its type."""
    depth = 0
    for index, token in enumerate(part):
        depth += (token.text in OPEN) - (token.text in CLOSE) if token.kind == "mark" else 0
        if token.text == ":" and token.kind == "mark" and depth == 0:
            return part[:index], part[index + 1 :]
    return part, []


def is_tuple(part):
    """Says whether tokens of a pattern or a type are a tuple of two or more, behind references too."""
    start = 0
    while start < len(part) and (part[start].text in ("&", "&&", "mut", "ref") or part[start].kind == "lifetime"):
        start += 1
    if start == len(part) or part[start].text != "(" or end_of_group(part, start) != len(part) - 1:
        return False
    return len(split_at_commas(part[start + 1 : -1])) > 1


def names_bound(pattern):
    """Returns the tokens of a pattern that bind a name."""
    bound = []
    for index, token in enumerate(pattern):
        before = pattern[index - 1].text if index else ""
        after = pattern[index + 1].text if index + 1 < len(pattern) else ""
        if token.kind == "word" and before not in ("::", ".") and after not in ("::", "(", "{", "!", ":", "."):
            bound.append(token)
    return bound


def parameters_of(code, index):
    """Returns the parameters of the function whose `fn` stands at `index`, each as a list of tokens."""
    angles, index = 0, index + 2
    while index < len(code) and not (code[index].text == "(" and angles == 0):
        if code[index].text in ("{", ";"):
            return []
        angles += (code[index].text == "<") - (code[index].text == ">")
        index += 1
    return split_at_commas(code[index + 1 : end_of_group(code, index)]) if index < len(code) else []


def closure_pattern(code, index):
    """Returns the parameters of the closure that opens at `index`, or nothing where the bar is an operator."""
    before = code[index - 1] if index else None
    opens = before is None or before.text in ("(", ",", "=", "{", "move", "return", "=>", ";", ":", "&", "[")
    if code[index].text != "|" or not opens or (before is not None and before.kind in ("text", "char")):
        return []
    depth = 0
    for stop in range(index + 1, min(index + 120, len(code))):
        depth += (code[stop].text in OPEN) - (code[stop].text in CLOSE)
        if depth < 0 or code[stop].text in (";", "=>"):
            return []
        if code[stop].text == "|" and depth == 0:
            return code[index + 1 : stop]
    return []


def pattern_until(code, index, ends):
    """Returns the tokens after `index` until one of `ends` outside brackets."""
    depth = 0
    for stop in range(index + 1, min(index + 200, len(code))):
        if depth == 0 and code[stop].text in ends:
            return code[index + 1 : stop]
        depth += (code[stop].text in OPEN) - (code[stop].text in CLOSE) if code[stop].kind == "mark" else 0
    return []


def arm_pattern(code, index):
    """Returns the pattern of the match arm whose `=>` stands at `index`."""
    depth, start = 0, index - 1
    while start >= 0:
        text = code[start].text if code[start].kind == "mark" else ""
        if depth == 0 and text in (",", "{", "}", ";") and not (text == "}" and start == index - 1):
            break
        depth += (text in CLOSE) - (text in OPEN)
        if depth < 0:
            break
        start -= 1
    pattern = code[start + 1 : index]
    for place, token in enumerate(pattern):
        if token.text == "if":
            return pattern[:place]
    return pattern


def fields_of(code, index):
    """Returns the names of the fields of the struct or enum whose keyword stands at `index`."""
    while index < len(code) and code[index].text not in ("{", ";", "("):
        index += 1
    if index == len(code) or code[index].text != "{":
        return []
    body = code[index + 1 : end_of_group(code, index)]
    return [
        token
        for place, token in enumerate(body[:-1])
        if token.kind == "word" and body[place + 1].text == ":" and (place == 0 or body[place - 1].text in (",", "{", "pub", ")", "]"))
    ]


def bindings_of(code):
    """Returns the tokens that name a parameter, a local value or a field; `other` beside `self` alone is the idiom, and
    `one` may name the number 1."""
    bound = []
    for index, token in enumerate(code):
        if token.text == "fn" and token.kind == "word":
            parts = parameters_of(code, index)
            binary = len(parts) == 2 and parts[0][-1].text == "self"
            for part in parts:
                bound += [name for name in names_bound(split_at_colon(part)[0]) if not (binary and name.text == "other")]
        elif token.text in ("struct", "enum") and token.kind == "word":
            bound += fields_of(code, index)
        elif token.text == "let" and token.kind == "word":
            pattern = pattern_until(code, index, ("=", ";"))
            value = pattern_until(code, index + len(pattern) + 1, (";", "{"))
            is_number = any(part.text == "1.0" for part in value)
            names = names_bound(split_at_colon(pattern)[0])
            bound += [name for name in names if not (is_number and name.text == "one")]
        elif token.text == "for" and token.kind == "word":
            pattern = pattern_until(code, index, ("in", "{", ";"))
            follows = code[min(index + len(pattern) + 1, len(code) - 1)].text
            bound += names_bound(pattern) if follows == "in" else []
        elif token.text == "|" and token.kind == "mark":
            for part in split_at_commas(closure_pattern(code, index)):
                bound += names_bound(split_at_colon(part)[0])
        elif token.text == "=>":
            bound += names_bound(arm_pattern(code, index))
    return list({id(token): token for token in bound}.values())


def types_of(code):
    """Returns the names of the types that a file declares; associated types of traits and implementations are left out."""
    declared, inside_until = [], -1
    for index, token in enumerate(code[:-1]):
        before = code[index - 1].text if index else ";"
        if token.text in ("trait", "impl") and before in (";", "{", "}", "(", "]", ")", "pub", "unsafe"):
            opens = index
            while opens < len(code) - 1 and code[opens].text not in ("{", ";"):
                opens += 1
            inside_until = max(inside_until, end_of_group(code, opens) if code[opens].text == "{" else opens)
        if token.kind != "word" or code[index + 1].kind != "word":
            continue
        if token.text in ("struct", "enum", "union", "trait") or (token.text == "type" and index > inside_until):
            declared.append(code[index + 1])
    return declared


def files_of(tree):
    """Returns the source files of a tree, tests left out."""
    for pattern in ("src/**/*.rs", "crates/*/src/**/*.rs"):
        for path in sorted(tree.glob(pattern)):
            inside = path.relative_to(tree)
            if "tests" not in inside.parts and path.name != "tests.rs":
                yield path, str(inside)


def hanging_comments(comments, hidden):
    """Returns the first lines of the comments that lean on the item before."""
    leaning, last = [], -2
    for comment in comments:
        first, last = comment.line != last + 1, comment.line
        if first and not any(start <= comment.line <= stop for start, stop in hidden):
            text = comment.text.lstrip("/!").strip()
            leaning += [(comment.line, text)] if HANGING.match(text) else []
    return leaning


def count(tree):
    """Reads a tree: types by name, pronouns by word, tuples and leaning comments, each as places `file:line` with a text."""
    types, pronouns = collections.defaultdict(list), {word: [] for word in PRONOUNS}
    tuples, hanging = [], []
    for path, name in files_of(tree):
        code, comments = tokens_of(path.read_text(encoding="utf-8"))
        code, hidden = without_tests(code)
        for token in types_of(code):
            types[token.text].append((name, token.line, token.text))
        for token in bindings_of(code):
            if token.text in pronouns:
                pronouns[token.text].append((name, token.line, token.text))
        for index, token in enumerate(code[:-1]):
            if token.text == "fn" and token.kind == "word" and code[index + 1].kind == "word":
                for part in parameters_of(code, index):
                    if any(is_tuple(side) for side in split_at_colon(part)):
                        tuples.append((name, part[0].line, f"{code[index + 1].text}({' '.join(t.text for t in part)})"))
        hanging += [(name, line, text) for line, text in hanging_comments(comments, hidden)]
    return types, pronouns, tuples, hanging


def main():
    """Prints the counts, and with --list the places."""
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("tree", nargs="?", default=".", type=pathlib.Path)
    reader.add_argument("--list", action="store_true", help="print every place")
    reader.add_argument("--under", default="", help="count only places in files below this prefix")
    asked = reader.parse_args()
    types, pronouns, tuples, hanging = count(asked.tree)

    def below(places):
        return [place for place in places if place[0].startswith(asked.under)]

    def show(places):
        for name, line, text in places if asked.list else []:
            print(f"  {name}:{line}: {text}")

    several = {name: places for name, places in sorted(types.items()) if len(places) > 1 and below(places)}
    behind = sum(len(places) for places in several.values())
    print(f"names: {len(several)} names of types stand for {behind} types")
    show([place for places in several.values() for place in places])
    words = {word: below(places) for word, places in pronouns.items()}
    spread = ", ".join(f"{word} {len(places)}" for word, places in words.items())
    print(f"pronouns: {sum(map(len, words.values()))} bindings and fields ({spread})")
    show([place for places in words.values() for place in places])
    print(f"tuples: {len(below(tuples))} parameters")
    show(below(tuples))
    print(f"hanging: {len(below(hanging))} comments")
    show(below(hanging))


if __name__ == "__main__":
    main()
