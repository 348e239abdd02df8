//! Documents of a megabyte that were written to hurt: each is close to the largest body that the
//! service takes, and spends it on one thing.

use serde_json::{Value, json};
use std::fmt::Write;

/// The bytes of a body at the most.
pub const LIMIT: usize = 1 << 20;

/// A body and how it is read.
pub struct Body {
    /// What it is made of.
    pub name: &'static str,
    /// In YAML, not in JSON.
    pub is_yaml: bool,
    /// The text.
    pub text: String,
}

/// A small sound model.
fn lag() -> Value {
    json!({
        "name": "lag",
        "inputs": {"u": {"unit": "V"}},
        "parameters": {"time": {"symbol": "T", "unit": "s", "default": 1}},
        "states": {"x": {"unit": "V", "derivative": "(u - x)/T", "initial": 0}},
        "outputs": {"y": {"unit": "V", "expression": "x"}}
    })
}

/// `part(0)`, `part(1)` … as long as there is room in `bytes`.
fn filled(bytes: usize, part: impl Fn(usize) -> String) -> String {
    let mut text = String::new();
    for index in 0.. {
        let next = part(index);
        if text.len() + next.len() > bytes {
            break;
        }
        text += &next;
    }
    text
}

/// The small model with one more section, text and all.
fn with_section(name: &str, section: &str) -> String {
    let mut text = lag().to_string();
    text.pop();
    write!(text, ",\"{name}\":{section}}}").expect("a text takes all that is written");
    text
}

/// A section of entries, as many as fit.
fn section(name: &str, entry: impl Fn(usize) -> String) -> String {
    let entries = filled(LIMIT - 1000, |index| {
        format!("{}{}", if index > 0 { "," } else { "" }, entry(index))
    });
    with_section(name, &format!("{{{entries}}}"))
}

/// A sum of terms that are all different, 84 of which fill an expression when they are long.
fn sum(index: usize, term: impl Fn(usize) -> String) -> String {
    let terms: Vec<String> = (0..84).map(|k| term(1000 * index + k)).collect();
    let mut text = terms.join("+");
    text.truncate(4090);
    text.truncate(text.rfind('+').unwrap_or(text.len()));
    text
}

/// Quantities that are such sums.
fn sums(term: impl Fn(usize) -> String) -> String {
    section("quantities", |index| {
        format!("\"q{index}\":\"{}\"", sum(index, &term))
    })
}

/// A list of one item over and over.
fn list(item: &str) -> String {
    let items = (LIMIT - 2000) / (item.len() + 1);
    format!("[{item}{}]", format!(",{item}").repeat(items))
}

/// Sums of names that are not there, each close to the 240 that are.
fn close_names() -> String {
    let name = |index: usize| format!("a_name_that_is_close_to_the_others_{index:08}");
    let mut document = lag();
    for (section, value) in [("parameters", "default"), ("constants", "value")] {
        for index in 0..120 {
            let key = format!("{}{}", name(index), &section[..1]);
            document[section][key] = json!({value: 1});
        }
    }
    let mut text = document.to_string();
    text.pop();
    let quantities = filled(LIMIT - text.len() - 100, |index| {
        let unknown: Vec<String> = (0..50).map(|k| name(50 * index + k + 1000)).collect();
        format!(",\"q{index}\":\"{}\"", unknown.join("+"))
    });
    text + &format!(",\"quantities\":{{\"q\":\"x\"{quantities}}}}}")
}

fn json_structures() -> Vec<(&'static str, String)> {
    let (open, close) = ("{\"a\":".repeat(120), "}".repeat(120));
    let nested = |k: usize| format!("\"q{k}\":{open}[]{close}");
    vec![
        ("lists in lists", "[".repeat(LIMIT)),
        ("objects in objects", "{\"a\":".repeat(LIMIT / 5)),
        ("objects 120 deep", section("quantities", nested)),
        (
            "many constants",
            section("constants", |k| format!("\"c{k}\":{{\"value\":{k}}}")),
        ),
        (
            "entries that are no names",
            section("constants", |k| format!("\"c {k}\":1")),
        ),
        (
            "unknown fields",
            section("options", |k| format!("\"delai{k}\":0")),
        ),
        (
            "a table of numbers",
            with_section("tables", &format!("{{\"t\":{{\"x\":{}}}}}", list("0"))),
        ),
        (
            "a table of texts",
            with_section("tables", &format!("{{\"t\":{{\"x\":{}}}}}", list("\"\""))),
        ),
        (
            "kinks",
            with_section("options", &format!("{{\"kinks\":{}}}", list("0"))),
        ),
    ]
}

fn json_expressions() -> Vec<(&'static str, String)> {
    let minuses = "-".repeat(60);
    let chained = |k: usize| format!("\"q{k}\":\"{minuses}q{}\"", k + 1);
    let giant = format!("{{\"q\":\"1{}\"}}", "+1".repeat(LIMIT / 2 - 500));
    vec![
        ("one expression of 1 MB", with_section("quantities", &giant)),
        ("sums of 84 terms", sums(|k| format!("sin({k:034}*x/u)"))),
        ("sums of kinks", sums(|k| format!("abs(x-{k:036})"))),
        ("sums of unknown names", sums(|k| format!("nosuch{k:042}"))),
        (
            "sums of unknown functions",
            sums(|k| format!("f{k:042}(x)")),
        ),
        (
            "sums of units that do not fit",
            sums(|k| format!("(u*{k:036}+T)")),
        ),
        ("a chain of names", section("quantities", chained)),
        (
            "texts that are no expressions",
            section("quantities", |k| format!("\"q{k}\":\"?\"")),
        ),
    ]
}

fn json_texts() -> Vec<(&'static str, String)> {
    let long = "x".repeat(LIMIT - 1000);
    let short = "x".repeat(4000);
    let unit = format!("m{}", "*m".repeat(LIMIT / 2 - 1000));
    let escapes = "\\u0041".repeat(LIMIT / 6 - 1000);
    vec![
        ("names close to 240 others", close_names()),
        (
            "names of 4000 characters",
            section("quantities", |k| format!("\"q{k}\":\"{short}{k}\"")),
        ),
        ("a field of 1 MB", with_section(&long, "0")),
        (
            "a name of 1 MB",
            with_section("inputs", &format!("{{\"{long}\":{{}}}}")).replacen(
                "\"inputs\":{\"u\":{\"unit\":\"V\"}},",
                "",
                1,
            ),
        ),
        (
            "a unit of 1 MB",
            with_section("constants", &format!("{{\"c\":{{\"unit\":\"{unit}\"}}}}")),
        ),
        (
            "unknown units",
            section("constants", |k| {
                format!("\"c{k}\":{{\"value\":1,\"unit\":\"{short}\"}}")
            }),
        ),
        (
            "a text of 1 MB",
            with_section("summary", &format!("\"{long}\"")),
        ),
        (
            "a text of escapes",
            with_section("summary", &format!("\"{escapes}\"")),
        ),
    ]
}

/// Aliases of aliases: 9 of the line before in each line.
fn bomb() -> String {
    filled(LIMIT, |index| match index.checked_sub(1) {
        None => "a0: &a0 [x]\n".to_owned(),
        Some(before) => {
            let aliases = vec![format!("*a{before}"); 9].join(", ");
            format!("a{index}: &a{index} [{aliases}]\n")
        }
    })
}

/// One line over and over.
fn lines(line: &str) -> String {
    line.repeat(LIMIT / line.len())
}

fn yaml_structures() -> Vec<(&'static str, String)> {
    let staircase = filled(LIMIT, |depth| format!("{}a:\n", " ".repeat(depth)));
    let braces = filled(LIMIT - 10, |k| format!("k{k}: 1, "));
    let aliases = "*a, ".repeat(LIMIT / 4 - 10);
    vec![
        ("lists in lists", "[".repeat(LIMIT)),
        ("braces in braces", "{a: ".repeat(LIMIT / 4)),
        ("dashes", "- ".repeat(LIMIT / 2)),
        ("question marks", "? ".repeat(LIMIT / 2)),
        ("a staircase of mappings", staircase),
        ("aliases of aliases", bomb()),
        ("aliases", format!("b: [{aliases}]\n")),
        (
            "anchors",
            format!("[{}]\n", "&a 1, ".repeat(LIMIT / 6 - 10)),
        ),
        (
            "tags",
            format!("[{}]\n", "!!str 1, ".repeat(LIMIT / 9 - 10)),
        ),
        ("documents", lines("---\n")),
        ("directives", lines("%TAG !a! b\n")),
        ("keys on lines", filled(LIMIT, |k| format!("k{k}: 1\n"))),
        ("keys in braces", format!("{{{braces}}}\n")),
        ("items", format!("a: [{}]\n", "1, ".repeat(LIMIT / 3 - 10))),
        ("items on lines", lines("- 1\n")),
    ]
}

fn yaml_texts() -> Vec<(&'static str, String)> {
    let comments = lines("# no\n").split_off(2000);
    let escapes = "\\u0041".repeat(LIMIT / 6 - 10);
    vec![
        ("comments", comments + &lag().to_string()),
        (
            "a comment of 1 MB",
            format!("#{}\n{}", "#".repeat(LIMIT - 1000), lag()),
        ),
        ("empty lines", lines("\n")),
        ("a text of many lines", lines("b\n")),
        (
            "a text of empty lines",
            format!("a: b{}\n c\n", "\n".repeat(LIMIT - 100)),
        ),
        ("a literal text", format!("a: |\n{}", lines("  b\n"))),
        ("a folded text", format!("a: >\n{}", lines("  b\n\n"))),
        ("a text of escapes", format!("a: \"{escapes}\"\n")),
        ("a key of 1 MB", format!("{}: 1\n", "a".repeat(LIMIT - 10))),
        ("blanks", " ".repeat(LIMIT)),
        ("tabs", "\t".repeat(LIMIT)),
        ("colons", ":".repeat(LIMIT)),
        ("colons and blanks", ": ".repeat(LIMIT / 2)),
        ("quotes", "'".repeat(LIMIT - 1)),
        ("control characters", "\u{1}".repeat(LIMIT)),
    ]
}

/// All of them.
pub fn bodies() -> Vec<Body> {
    let of = |is_yaml: bool| {
        move |(name, mut text): (&'static str, String)| {
            text.truncate(LIMIT);
            Body {
                name,
                is_yaml,
                text,
            }
        }
    };
    let json = [json_structures(), json_expressions(), json_texts()];
    let yaml = [yaml_structures(), yaml_texts()];
    let json = json.into_iter().flatten().map(of(false));
    json.chain(yaml.into_iter().flatten().map(of(true)))
        .collect()
}
