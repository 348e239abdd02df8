//! Who may import whom, and what every source file keeps to.
//!
//! The tables below are the project's layers. A new edge is fine when it is the natural way: add
//! it, and say why beside it. Test code may reach for whatever it needs and is left out.

#[path = "architecture/circles.rs"]
mod circles;
#[path = "architecture/source.rs"]
mod source;

use circles::Files;
use source::{Source, after_path_starts, first_names};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

/// A crate: where its sources are, and its rooms in the order in which a job travels, each with the
/// rooms of the crate that it may import. What one crate may import of another is said by its
/// manifest. Files that belong to no room of the table are a room of the crate's own name.
struct Crate {
    name: &'static str,
    folder: &'static str,
    rooms: &'static [(&'static str, &'static [&'static str])],
}

#[rustfmt::skip]
const CRATES: [Crate; 5] = [
    Crate { name: "service", folder: "src", rooms: &[
        // The command line starts servers, runs the method without one, and looks after the
        // database of one that does not run.
        ("cli", &["app", "collect", "config", "api", "access", "encrypted_file", "outbound", "store", "span", "job"]),
        // The composition root; only the command line imports it.
        ("app", &["access", "allowance", "config", "api", "dashboard", "delivery", "identity", "job", "priority", "store", "event", "watcher", "worker"]),
        // Samples on their way from historians to streams, in a process of their own: of the store the address of
        // a PostgreSQL alone.
        ("collect", &["access", "outbound", "store"]),
        // Settings are handed to the parts as the parts' own types.
        ("config", &["api", "access", "delivery", "identity", "outbound", "store", "worker"]),
        ("api", &["access", "admission", "allowance", "dashboard", "delivery", "event", "identity", "priority", "span", "monitor", "store", "job"]),
        // Names of projects, scopes and secrets: nothing of ours.
        ("access", &[]),
        // Permits in fair turns.
        ("admission", &[]),
        // Which threads give way to which.
        ("priority", &[]),
        // How often somebody may do something.
        ("allowance", &[]),
        ("dashboard", &[]),
        ("job", &[]),
        // What a monitor is asked, what it knows and what is shown of it.
        ("monitor", &[]),
        ("store", &["access", "encrypted_file", "job", "monitor"]),
        // Files for the holders of some keys: nothing of ours.
        ("encrypted_file", &[]),
        ("delivery", &["access", "event", "outbound", "store", "job"]),
        // The provider that knows people.
        ("identity", &["access", "outbound"]),
        // Requests that the program makes itself.
        ("outbound", &[]),
        ("event", &["access", "store", "job"]),
        // What a collector is told: requests and slices.
        ("span", &["access", "job"]),
        // A window of a stream becomes a job that is read as any other.
        ("watcher", &["event", "store", "monitor", "job"]),
        ("worker", &["access", "admission", "event", "span", "store", "job"]),
    ] },
    Crate { name: "greybox", folder: "crates/greybox/src", rooms: &[
        // Recordings are prepared before anything is identified.
        ("preparation", &[]),
        ("report", &["identification"]),
        ("identification", &["uncertainty", "estimation"]),
        // Recordings that the program makes are simulated ones.
        ("demo", &[]),
        ("uncertainty", &["estimation"]),
        ("estimation", &["credit", "genetic"]),
        ("credit", &[]),
        ("genetic", &[]),
    ] },
    Crate { name: "recording", folder: "crates/recording/src", rooms: &[
        ("intake", &["recording"]),
        ("recording", &[]),
    ] },
    Crate { name: "simulation", folder: "crates/simulation/src", rooms: &[
        // A model may be a document that a user wrote.
        ("model", &["simulation", "language"]),
        // The program of a document is made from the graph of its equations.
        ("simulation", &["language"]),
        ("language", &[]),
    ] },
    Crate { name: "numerics", folder: "crates/numerics/src", rooms: &[
        ("parsing", &[]),
        ("numerics", &[]),
    ] },
];

/// What the library does without.
#[rustfmt::skip]
const OUTSIDE_WORLD: &[&str] = &[
    "std::env", "std::fs", "std::net", "std::process", "std::time", "std::io::std", "Timestamp::now",
];

/// The files and folders where a third party may be used; a third party that is not named here is
/// free wherever the manifest has it.
#[rustfmt::skip]
const PLACES: &[(&str, &[&str])] = &[
    // Settings name headers, and spans come from them.
    ("axum", &["src/api", "src/dashboard", "src/app", "src/config", "src/span.rs"]),
    ("hyper", &["src/app", "src/cli", "src/collect", "src/delivery", "src/identity", "src/outbound"]),
    ("hyper_util", &["src/app", "src/outbound"]),
    // The address of a PostgreSQL is a URL too.
    ("url", &["src/cli", "src/collect", "src/delivery", "src/identity", "src/outbound", "src/store/postgres_address.rs"]),
    ("ring", &["src/encrypted_file", "src/identity", "src/store/secret_keys.rs"]),
    ("x25519_dalek", &["src/encrypted_file"]),
    ("bech32", &["src/encrypted_file"]),
    ("rustls", &["src/app", "src/cli", "src/collect/endpoint.rs", "src/delivery", "src/identity", "src/outbound"]),
    ("tokio_rustls", &["src/app", "src/outbound"]),
    ("rustls_native_certs", &["src/outbound"]),
    // A module of `ring` has the same name.
    ("hmac", &["src/delivery", "src/encrypted_file"]),
    // Clients of InfluxDB send their password in it.
    ("base64", &["crates/recording/src/intake/binary/parquet", "src/delivery", "src/encrypted_file", "src/identity", "src/store/secret_keys.rs", "src/api/sinks/credentials.rs", "src/collect/endpoint.rs"]),
    ("tokio_io_timeout", &["src/app"]),
    ("http_body", &["src/api"]),
    ("http_body_util", &["src/outbound"]),
    ("ipnet", &["src/api", "src/app", "src/config", "src/delivery"]),
    ("getrandom", &["src/access", "src/delivery", "src/encrypted_file"]),
    // Connections are files.
    ("rlimit", &["src/app"]),
    ("libc", &["src/app/memory.rs"]),
    ("rustix", &["src/priority.rs", "src/app/system.rs"]),
    ("tower", &["src/api", "src/dashboard", "src/app"]),
    ("tower_http", &["src/api", "src/dashboard", "src/app"]),
    ("utoipa_axum", &["src/api"]),
    // A collector reads databases of others, and keeps its cursors in one.
    ("sqlx", &["src/store", "src/worker", "src/collect"]),
    ("toml", &["src/collect/document.rs"]),
    ("riverqueue", &["src/store", "src/worker"]),
    ("tracing_subscriber", &["src/cli"]),
    ("tracing_appender", &["src/cli/telemetry.rs"]),
    ("metrics", &["src/api", "src/app", "src/delivery", "src/store", "src/worker"]),
    ("metrics_exporter_prometheus", &["src/api", "src/app"]),
    ("reqwest", &["src/cli"]),
    // Spans are made in one place and sent from another.
    ("opentelemetry", &["src/span.rs", "src/cli/telemetry.rs"]),
    ("async_trait", &["src/cli/collector.rs"]),
    ("opentelemetry_http", &["src/cli/collector.rs"]),
    ("opentelemetry_otlp", &["src/cli/telemetry.rs"]),
    ("opentelemetry_sdk", &["src/cli/telemetry.rs"]),
    ("tracing_opentelemetry", &["src/span.rs", "src/cli/telemetry.rs"]),
    // Where samples are put aside on their way into the database.
    ("tempfile", &["src/app/doctor.rs", "src/store"]),
    // Settings are flags as well as variables.
    ("clap", &["src/cli", "src/config"]),
    ("clap_complete", &["src/cli"]),
    ("clap_mangen", &["src/cli"]),
    // The guides are Markdown.
    ("pulldown_cmark", &["src/dashboard"]),
    ("directories", &["src/config"]),
    ("indicatif", &["src/cli"]),
    ("comfy_table", &["src/cli"]),
    ("calamine", &["crates/recording/src/intake/binary/excel.rs"]),
    ("zip", &["crates/recording/src/intake/binary/workbook.rs"]),
    ("parquet", &["crates/recording/src/intake/binary/mod.rs", "crates/recording/src/intake/binary/parquet"]),
    ("saphyr_parser", &["crates/numerics/src/parsing"]),
    // Every random number comes from one place.
    ("rand", &["crates/numerics/src/rng.rs"]),
    ("rand_chacha", &["crates/numerics/src/rng.rs"]),
    // The pool of jobs is the process's: whoever starts the process sizes it. Requests have their own.
    ("rayon", &[
        "crates/simulation/src/batch.rs", "crates/greybox/src/estimation/refinement.rs",
        "crates/greybox/src/estimation/shooting.rs", "crates/greybox/src/estimation/noise_ladder.rs",
        "crates/greybox/src/estimation/search.rs", "crates/greybox/src/uncertainty",
        "crates/greybox/src/identification/assemble/selection", "src/api/background.rs", "src/app", "src/cli",
    ]),
];

/// What the library must not bring into a program that uses it, by whatever way.
#[rustfmt::skip]
const SERVICE_ALONE: [&str; 9] = [
    "tokio", "axum", "hyper", "tower", "sqlx", "libsqlite3-sys", "reqwest", "rustls", "riverqueue",
];

fn package() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Files below a folder of the package, without the folders of other programs.
fn files(folder: &str, extensions: &[&str]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![package().join(folder)];
    while let Some(folder) = folders.pop() {
        let Ok(entries) = std::fs::read_dir(&folder) else {
            continue;
        };
        for path in entries.map(|entry| entry.expect("a readable folder").path()) {
            let extension = path.extension().and_then(|extension| extension.to_str());
            if path.is_dir() && !path.ends_with("vendor") {
                folders.push(path);
            } else if extension.is_some_and(|own| extensions.contains(&own)) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

impl Crate {
    fn sources(&self) -> Vec<Source> {
        let root = package().join(self.folder);
        let name = |path: &Path| -> String {
            let inside = path.strip_prefix(&root).expect("a file below its folder");
            inside.to_string_lossy().replace('\\', "/")
        };
        files(self.folder, &["rs"])
            .iter()
            .map(|path| (name(path), path))
            .filter(|(name, _)| !name.split('/').any(|part| part.starts_with("tests")))
            .map(|(path, file)| Source::new(self.folder, path, &read(file)))
            .collect()
    }

    /// The room that a module at the crate's root belongs to.
    fn room<'a>(&self, module: &'a str) -> &'a str
    where
        'static: 'a,
    {
        let has_room = self.rooms.iter().any(|(room, _)| *room == module);
        if has_room { module } else { self.name }
    }
}

fn sources() -> Vec<Source> {
    CRATES.iter().flat_map(Crate::sources).collect()
}

fn assert_none(faults: &[String]) {
    assert!(faults.is_empty(), "\n{}\n", faults.join("\n"));
}

#[test]
fn modules_import_only_what_their_layer_may() {
    let mut faults = Vec::new();
    for part in &CRATES {
        let rooms: BTreeMap<_, _> = part.rooms.iter().copied().collect();
        for source in part.sources() {
            let room = part.room(source.module());
            let Some(allowed) = rooms.get(room) else {
                continue;
            };
            let edges = source.edges();
            let edges = edges.iter().map(|edge| part.room(edge));
            let forbidden =
                |edge: &&str| rooms.contains_key(edge) && *edge != room && !allowed.contains(edge);
            let forbidden: BTreeSet<&str> = edges.filter(forbidden).collect();
            faults.extend(
                forbidden
                    .iter()
                    .map(|edge| format!("{} imports {edge}", source.file)),
            );
        }
    }
    assert_none(&faults);
}

#[test]
fn no_files_need_each_other() {
    for part in &CRATES {
        let sources = part.sources();
        let files = Files::new(&sources);
        let circles = files.circles();
        let circles: Vec<String> = circles.iter().map(|circle| circle.join(" ")).collect();
        assert_none(&circles);
    }
}

#[test]
fn only_the_command_line_starts_programs() {
    let sources = sources();
    let main = sources.iter().find(|source| source.file == "src/main.rs");
    let main = &main.expect("a program").code;
    let named: Vec<_> = after_path_starts(main, "greybox_service::")
        .flat_map(first_names)
        .collect();
    assert_eq!(named, ["cli"]);
}

#[test]
fn the_maps_declare_every_room_in_the_order_of_the_table() {
    for part in &CRATES[..2] {
        let map = read(&package().join(part.folder).join("lib.rs"));
        let declared: Vec<&str> = map
            .lines()
            .filter_map(|line| line.split_once("mod ")?.1.strip_suffix(';'))
            .collect();
        let table: Vec<&str> = part.rooms.iter().map(|(room, _)| *room).collect();
        assert_eq!(declared, table);
    }
}

#[test]
fn third_parties_stay_in_their_place() {
    let mut faults = Vec::new();
    for source in sources() {
        for (name, places) in PLACES {
            if source.names_crate(name) && !source.stands_in(places) {
                faults.push(format!("{} uses {name}", source.file));
            }
        }
    }
    assert_none(&faults);
}

#[test]
fn the_library_brings_nothing_of_the_service() {
    let tree = Command::new(env!("CARGO"))
        .args(["tree", "--package=greybox", "--features=excel,parquet"])
        .args([
            "--edges=normal,build",
            "--prefix=none",
            "--format={p}",
            "--offline",
        ])
        .current_dir(package())
        .output()
        .expect("cargo runs");
    assert!(
        tree.status.success(),
        "{}",
        String::from_utf8_lossy(&tree.stderr)
    );
    let tree = String::from_utf8(tree.stdout).expect("text");
    let packages: BTreeSet<&str> = tree
        .lines()
        .filter_map(|line| line.split(' ').next())
        .collect();
    assert!(packages.contains("nalgebra"), "{packages:?}");
    let foreign = SERVICE_ALONE.iter().filter(|name| packages.contains(*name));
    let foreign: Vec<String> = foreign.map(|name| (*name).to_owned()).collect();
    assert_none(&foreign);
    assert!(packages.len() <= 150, "{} packages", packages.len());
}

#[test]
fn the_library_knows_neither_clock_nor_files_nor_network() {
    let mut faults = Vec::new();
    for source in CRATES[1..].iter().flat_map(Crate::sources) {
        for name in OUTSIDE_WORLD
            .iter()
            .filter(|name| source.code.contains(*name))
        {
            faults.push(format!("{} uses {name}", source.file));
        }
    }
    assert_none(&faults);
}

#[test]
fn only_the_settings_read_the_environment() {
    let readers = sources()
        .into_iter()
        .filter(|source| source.code.contains("env::var"));
    let readers: Vec<String> = readers.map(|source| source.file).collect();
    // A sources file names the secrets of a collector by variables too.
    let settings = ["src/config.rs", "src/collect/secret.rs"];
    let are_settings = readers.iter().all(|path| settings.contains(&&**path));
    assert!(are_settings, "{readers:?}");
}

#[test]
fn no_source_panics_on_what_is_not_there() {
    let unwrapping = sources()
        .into_iter()
        .filter(|source| source.code.contains(".unwrap()"));
    let faults: Vec<String> = unwrapping.map(|source| source.file).collect();
    assert_none(&faults);
}

/// Files of this project's own writing.
fn own_files() -> Vec<PathBuf> {
    let folders = ["src", "crates", "tests", "benches"];
    folders
        .iter()
        .flat_map(|folder| files(folder, &["rs", "js", "css", "html", "sql"]))
        .collect()
}

#[test]
fn every_file_says_what_it_is_and_is_read_at_a_sitting() {
    const LONGEST: usize = 500;
    let mut faults = Vec::new();
    for path in own_files() {
        let text = read(&path);
        let is_rust = path.extension().is_some_and(|extension| extension == "rs");
        if is_rust && !text.starts_with("//! ") {
            faults.push(format!("{} does not open with //!", path.display()));
        }
        let lines = text.lines().count();
        if lines > LONGEST {
            faults.push(format!("{} has {lines} lines", path.display()));
        }
    }
    assert_none(&faults);
}

#[test]
fn nothing_is_left_undone_or_bound_to_one_machine() {
    // Each is written in two parts, so that this file itself can be looked through.
    // The word is the field's for what is called credit here: one concept, one word.
    const UNUSED_WORD: &str = concat!("fit", "ness");
    let undone = [
        concat!("TO", "DO"),
        concat!("FIX", "ME"),
        concat!("XX", "X"),
        concat!("unimple", "mented!"),
        concat!("to", "do!"),
        concat!("#[ig", "nore"),
    ];
    let machine = [
        concat!("/ho", "me/"),
        concat!("/Us", "ers/"),
        concat!(":\\Us", "ers\\"),
    ];
    let mut faults = Vec::new();
    for path in own_files() {
        let text = read(&path);
        let lower = text.to_lowercase();
        for found in undone
            .iter()
            .chain(&machine)
            .filter(|word| text.contains(**word))
        {
            faults.push(format!("{} contains {found}", path.display()));
        }
        if lower.contains(UNUSED_WORD) {
            faults.push(format!("{} contains {UNUSED_WORD}", path.display()));
        }
    }
    assert_none(&faults);
}
