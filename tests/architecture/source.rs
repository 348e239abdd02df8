//! Reads Rust sources as far as the rules of this project need: which modules and crates code
//! names, comments, literals and test code left out.

use std::collections::BTreeSet;

/// A source file without comments, literals and test code.
pub struct Source {
    /// From the top of the repository, e.g. `src/api/mod.rs`.
    pub file: String,
    /// From the sources of its crate, e.g. `api/mod.rs`.
    pub path: String,
    /// What is left of it.
    pub code: String,
}

impl Source {
    /// The source of a file.
    pub fn new(folder: &str, path: String, text: &str) -> Source {
        let code = without_tests(&without_comments_and_literals(text));
        let file = format!("{folder}/{path}");
        Source { file, path, code }
    }

    /// The module of the crate that it belongs to.
    pub fn module(&self) -> &str {
        let first = self.path.split('/').next().unwrap_or_default();
        first.trim_end_matches(".rs")
    }

    /// How many `super` lead from the file's module to the crate.
    fn depth(&self) -> usize {
        let folders = self.path.matches('/').count();
        folders + usize::from(!self.path.ends_with("mod.rs") && self.path != "lib.rs")
    }

    /// The modules of this crate that the code names.
    pub fn edges(&self) -> BTreeSet<String> {
        let root = "super::".repeat(self.depth());
        let mut edges = BTreeSet::new();
        for prefix in ["crate::", &root] {
            if prefix.is_empty() {
                continue;
            }
            for rest in after_path_starts(&self.code, prefix) {
                edges.extend(first_names(rest));
            }
        }
        edges
    }

    /// Whether the code uses the crate of that name.
    pub fn names_crate(&self, name: &str) -> bool {
        after_path_starts(&self.code, &format!("{name}::"))
            .next()
            .is_some()
            || self.code.contains(&format!("use {name};"))
            || self.code.contains(&format!("#[{name}"))
    }

    /// Whether it is one of the files or lies in one of the folders; the file beside a folder, of the
    /// folder's name, counts as part of the folder.
    pub fn stands_in(&self, places: &[&str]) -> bool {
        let file = self.file.trim_end_matches(".rs");
        places.iter().any(|place| {
            let place = place.trim_end_matches(".rs");
            file == place
                || file
                    .strip_prefix(place)
                    .is_some_and(|rest| rest.starts_with('/'))
        })
    }
}

/// What follows each occurrence of `prefix` that begins a path.
pub fn after_path_starts<'a>(code: &'a str, prefix: &'a str) -> impl Iterator<Item = &'a str> {
    code.match_indices(prefix).filter_map(move |(at, _)| {
        let before = code[..at].chars().next_back().unwrap_or(' ');
        let continues = before.is_alphanumeric() || before == '_' || before == ':';
        (!continues).then(|| &code[at + prefix.len()..])
    })
}

/// `a` of `a::b`, or `a` and `c` of `{a::b, c}`.
pub fn first_names(path: &str) -> Vec<String> {
    let name = |text: &str| -> String {
        let text = text.trim_start();
        text.chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect()
    };
    let Some(group) = path.strip_prefix('{') else {
        return vec![name(path)];
    };
    let (mut depth, mut names, mut start) = (1, Vec::new(), 0);
    for (at, character) in group.char_indices() {
        match character {
            '{' => depth += 1,
            '}' => depth -= 1,
            _ => {}
        }
        if depth == 0 || (depth == 1 && character == ',') {
            names.push(name(&group[start..at]));
            start = at + 1;
        }
        if depth == 0 {
            break;
        }
    }
    names.retain(|name| !name.is_empty());
    names
}

/// The code with comments and the contents of literals left out.
fn without_comments_and_literals(text: &str) -> String {
    let mut code = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let length = skipped(rest, code.chars().next_back()).unwrap_or(0);
        if length == 0 {
            code.push(first);
            rest = &rest[first.len_utf8()..];
        } else {
            code.push(' ');
            rest = &rest[length..];
        }
    }
    code
}

/// The length of the comment or literal that `rest` begins with.
fn skipped(rest: &str, before: Option<char>) -> Option<usize> {
    let in_word = before.is_some_and(|c| c.is_alphanumeric() || c == '_');
    if rest.starts_with("//") {
        return Some(rest.find('\n').unwrap_or(rest.len()));
    }
    if rest.starts_with("/*") {
        return rest.find("*/").map(|end| end + 2);
    }
    if rest.starts_with('"') {
        return escaped_end(rest, '"');
    }
    if rest.starts_with('r') && !in_word {
        let hashes = rest[1..].chars().take_while(|c| *c == '#').count();
        if rest[1 + hashes..].starts_with('"') {
            let close = format!("\"{}", "#".repeat(hashes));
            let start = 2 + hashes;
            return rest[start..]
                .find(&close)
                .map(|end| start + end + close.len());
        }
    }
    let is_character = rest.starts_with("'\\") || rest.chars().nth(2) == Some('\'');
    if rest.starts_with('\'') && is_character {
        return escaped_end(rest, '\'');
    }
    None
}

fn escaped_end(rest: &str, quote: char) -> Option<usize> {
    let mut escaped = false;
    rest.char_indices().skip(1).find_map(|(at, character)| {
        let ends = character == quote && !escaped;
        escaped = character == '\\' && !escaped;
        ends.then_some(at + 1)
    })
}

/// The code without the items under `#[cfg(test)]`.
fn without_tests(code: &str) -> String {
    const MARK: &str = "#[cfg(test)]";
    let mut kept = String::new();
    let mut rest = code;
    while let Some(at) = rest.find(MARK) {
        kept.push_str(&rest[..at]);
        rest = &rest[at + MARK.len()..];
        rest = &rest[item_length(rest)..];
    }
    kept + rest
}

fn item_length(code: &str) -> usize {
    let mut depth = 0;
    for (at, character) in code.char_indices() {
        match character {
            '{' => depth += 1,
            '}' => depth -= 1,
            _ => {}
        }
        if depth == 0 && matches!(character, ';' | '}') {
            return at + 1;
        }
    }
    code.len()
}

/// A checker that sees nothing finds nothing.
mod reader {
    use super::Source;

    fn source(path: &str, text: &str) -> Source {
        Source::new("src", path.to_owned(), text)
    }

    #[test]
    fn sees_every_form_of_import() {
        let text = "use crate::{credit::icra, genetic::{a, b}};\nfn f() { crate::model::g() }";
        let edges = source("x/mod.rs", text).edges();
        let edges: Vec<&str> = edges.iter().map(String::as_str).collect();
        assert_eq!(edges, ["credit", "genetic", "model"]);
        assert!(
            source("x.rs", "use super::store;")
                .edges()
                .contains("store")
        );
        assert!(
            source("x/y.rs", "use super::super::store;")
                .edges()
                .contains("store")
        );
        assert!(source("x/y.rs", "use super::store;").edges().is_empty());
    }

    #[test]
    fn overlooks_comments_literals_and_tests() {
        let text = "// crate::a\n/* crate::b */ const C: &str = \"crate::c \\\" crate::d\";\n\
                    const R: &str = r#\"crate::e\"#; const Q: char = '\"';\n\
                    #[cfg(test)]\nmod tests { use crate::f; fn g() {} }\nuse crate::h;";
        let edges = source("x/mod.rs", text).edges();
        assert_eq!(edges.into_iter().collect::<Vec<_>>(), ["h"]);
    }

    #[test]
    fn sees_third_parties_and_tells_them_from_modules_of_their_name() {
        let uses = |text: &str| source("x/mod.rs", text).names_crate("tokio");
        assert!(uses("use tokio::net::TcpListener;") && uses("fn f() { tokio::spawn(g()) }"));
        assert!(uses("#[tokio::main] async fn main() {}"));
        assert!(!uses("use crate::tokio::x;") && !uses("use my_tokio::x;"));
    }
}
