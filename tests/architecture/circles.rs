//! Which file needs what another file defines, names that are handed on followed to where they are
//! defined.

use super::source::Source;
use std::collections::{BTreeMap, BTreeSet};

/// The place of a module in the crate.
type Place = Vec<String>;

/// A file as a module: what it defines, and the paths that it names.
struct Module {
    file: String,
    defines: BTreeSet<String>,
    /// Each as a whole from the crate.
    paths: Vec<Place>,
}

/// The files, by their places.
pub struct Files(BTreeMap<Place, Module>);

impl Files {
    /// Reads sources.
    pub fn new(sources: &[Source]) -> Files {
        let places: BTreeSet<Place> = sources.iter().map(|source| place(&source.path)).collect();
        let module = |source: &Source| {
            let own = place(&source.path);
            let module = Module {
                file: source.path.clone(),
                defines: defined(&source.code),
                paths: paths(&source.code, &own, &places),
            };
            (own, module)
        };
        Files(sources.iter().map(module).collect())
    }

    /// The other files that a file needs.
    fn needs(&self, place: &Place) -> BTreeSet<&Place> {
        let paths = self.0[place].paths.iter();
        let definers = paths.filter_map(|path| self.definer(path, 0));
        definers.filter(|other| *other != place).collect()
    }

    /// Where a path leads.
    fn definer(&self, path: &[String], followed: usize) -> Option<&Place> {
        let module = (0..=path.len())
            .rev()
            .find_map(|length| self.0.get_key_value(&path[..length]));
        let (place, module) = module?;
        let Some(name) = path.get(place.len()) else {
            return Some(place);
        };
        if module.defines.contains(name) || followed > 8 {
            return Some(place);
        }
        let handed_on = module.paths.iter().find(|other| {
            other.last() == Some(name) && other[..] != *path && !other.starts_with(path)
        });
        match handed_on {
            Some(other) => self.definer(other, followed + 1),
            None => Some(place),
        }
    }

    /// The circles: files each of which needs every other, by way of others.
    pub fn circles(&self) -> Vec<Vec<&str>> {
        let needs = self.0.keys().map(|from| (from, self.needs(from)));
        let needs: BTreeMap<&Place, BTreeSet<&Place>> = needs.collect();
        let reach = needs.keys().map(|from| (*from, reached(&needs, from)));
        let reach: BTreeMap<&Place, BTreeSet<&Place>> = reach.collect();
        let mut circles = BTreeSet::new();
        for (from, reached) in &reach {
            let back = reached.iter().filter(|other| reach[*other].contains(from));
            let circle: BTreeSet<&str> = back.map(|other| &*self.0[*other].file).collect();
            if circle.len() > 1 {
                circles.insert(circle.into_iter().collect::<Vec<&str>>());
            }
        }
        circles.into_iter().collect()
    }
}

/// What a file needs, also by way of others.
fn reached<'a>(
    needs: &BTreeMap<&'a Place, BTreeSet<&'a Place>>,
    from: &'a Place,
) -> BTreeSet<&'a Place> {
    let (mut reached, mut open) = (BTreeSet::new(), vec![from]);
    while let Some(next) = open.pop() {
        let more = needs[next].iter().copied();
        open.extend(more.filter(|other| reached.insert(*other)));
    }
    reached
}

fn place(file: &str) -> Place {
    if file == "lib.rs" {
        return Place::new();
    }
    let name = file.trim_end_matches(".rs");
    let name = name.trim_end_matches("/mod");
    name.split('/').map(str::to_owned).collect()
}

fn is_of_name(character: char) -> bool {
    character.is_alphanumeric() || character == '_'
}

/// The names of the items of a file.
fn defined(code: &str) -> BTreeSet<String> {
    const KINDS: [&str; 9] = [
        "fn ",
        "struct ",
        "enum ",
        "trait ",
        "type ",
        "const ",
        "static ",
        "union ",
        "macro_rules! ",
    ];
    let of_kind = |kind: &'static str| super::after_path_starts(code, kind);
    let names = KINDS.into_iter().flat_map(of_kind);
    let names = names.map(|rest| {
        rest.chars()
            .take_while(|c| is_of_name(*c))
            .collect::<String>()
    });
    names
        .filter(|name| !name.is_empty() && name != "fn")
        .collect()
}

/// Every path into this crate, whole.
fn paths(code: &str, own: &Place, places: &BTreeSet<Place>) -> Vec<Place> {
    // Who may see an item is no need of the file.
    let code = &code.replace("pub(in crate::", "pub(in ");
    let mut found = Vec::new();
    for rest in super::after_path_starts(code, "crate::") {
        spelled_out(rest, &[], &mut found);
    }
    let mut base = own.clone();
    let mut prefix = String::new();
    while base.pop().is_some() {
        prefix.push_str("super::");
        for rest in super::after_path_starts(code, &prefix) {
            if !rest.starts_with("super::") {
                spelled_out(rest, &base, &mut found);
            }
        }
    }
    for child in places
        .iter()
        .filter(|other| other.len() == own.len() + 1 && other.starts_with(own))
    {
        let name = &child[own.len()];
        for rest in super::after_path_starts(code, &format!("{name}::")) {
            spelled_out(rest, child, &mut found);
        }
    }
    found
}

/// `a::{b, c::d}` as two paths.
fn spelled_out(text: &str, base: &[String], found: &mut Vec<Place>) {
    if text.is_empty() {
        // What follows the last comma of a group.
        return;
    }
    if let Some(group) = text.strip_prefix('{') {
        let (mut depth, mut start) = (1, 0);
        for (at, character) in group.char_indices() {
            depth += i32::from(character == '{') - i32::from(character == '}');
            if depth == 0 || (depth == 1 && character == ',') {
                spelled_out(group[start..at].trim(), base, found);
                start = at + 1;
            }
            if depth == 0 {
                return;
            }
        }
        return;
    }
    let name: String = text.chars().take_while(|c| is_of_name(*c)).collect();
    let rest = &text[name.len()..];
    let mut place = base.to_vec();
    if !name.is_empty() && name != "self" {
        place.push(name);
    }
    match rest.strip_prefix("::") {
        Some(rest) => spelled_out(rest, &place, found),
        None if place.is_empty() => {}
        None => found.push(place),
    }
}

#[test]
fn a_circle_by_way_of_a_name_that_is_handed_on_is_seen() {
    let source = |path: &str, code: &str| Source::new("src", path.to_owned(), code);
    let files = Files::new(&[
        source("a/mod.rs", "mod b; mod c; pub use b::B; pub struct A(B);"),
        source("a/b.rs", "use super::{A, c::C}; pub struct B(C, A);"),
        source("a/c.rs", "use super::B; pub struct C(B);"),
        source("d.rs", "use crate::a::{self, b::B}; struct D(B, a::A);"),
    ]);
    assert_eq!(files.circles(), [["a/b.rs", "a/c.rs", "a/mod.rs"]]);
}

#[test]
fn a_folder_whose_own_file_only_hands_on_is_no_circle() {
    let source = |path: &str, code: &str| Source::new("src", path.to_owned(), code);
    let files = Files::new(&[
        source("a/mod.rs", "mod b; mod c; pub use b::B; use c::C;"),
        source("a/b.rs", "use super::{\n    C,\n}; pub struct B(C);"),
        source("a/c.rs", "pub(in crate::a) struct C;"),
    ]);
    assert!(files.circles().is_empty());
}
