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

/// Each module in the order in which a job travels, and the modules that it may import.
#[rustfmt::skip]
const LAYERS: &[(&str, &[&str])] = &[
    // The command line starts servers, runs the method without one, and looks after the database of
    // one that does not run.
    ("cli", &["app", "config", "api", "access", "delivery", "store", "span", "identification", "job", "parsing", "estimation", "uncertainty", "demo", "model", "simulation", "language", "intake", "recording"]),
    // The composition root; only the command line imports it.
    ("app", &["config", "api", "dashboard", "delivery", "job", "store", "event", "monitor", "worker", "model"]),
    // Settings are handed to the parts as the parts' own types.
    ("config", &["api", "access", "delivery", "store", "worker"]),
    // Simulation stands behind `/v1/simulations` only.
    ("api", &["access", "dashboard", "delivery", "report", "event", "span", "monitor", "store", "job", "intake", "recording", "model", "simulation", "parsing"]),
    // Names of projects, scopes and secrets: nothing of ours.
    ("access", &[]),
    ("dashboard", &[]),
    // A report for the file has the equations.
    ("report", &["job", "recording", "model"]),
    // The settings of the method and the forms of its results are part of a job; a problem is
    // assembled, and looked over beforehand, from the statistics of its recordings.
    ("job", &["estimation", "uncertainty", "model", "simulation", "recording", "parsing", "numerics"]),
    ("store", &["access", "job", "recording"]),
    ("delivery", &["access", "event", "store", "job"]),
    ("event", &["access", "store", "job"]),
    // What a collector is told: requests and slices.
    ("span", &["access", "job"]),
    // A window of a stream becomes a job that is read as any other.
    ("monitor", &["access", "event", "store", "job", "model", "parsing", "recording", "numerics"]),
    ("worker", &["access", "event", "span", "store", "identification", "job", "estimation", "model", "recording"]),
    // What a program asks for is what a client asks for: a specification, and the problem that is
    // assembled from it.
    ("identification", &["job", "uncertainty", "estimation", "model", "intake", "recording", "parsing"]),
    ("estimation", &["credit", "genetic", "model", "simulation", "recording", "numerics"]),
    ("credit", &["numerics"]),
    ("genetic", &["numerics"]),
    ("uncertainty", &["estimation", "model", "simulation", "recording", "numerics"]),
    // Recordings that the program makes are simulated ones.
    ("demo", &["model", "simulation", "recording", "numerics"]),
    // A model may be a document that a user wrote.
    ("model", &["simulation", "language", "parsing", "numerics"]),
    // The program of a document is made from the graph of its equations.
    ("simulation", &["language", "numerics"]),
    ("language", &["numerics"]),
    ("intake", &["recording", "parsing", "numerics"]),
    ("recording", &["numerics"]),
    ("parsing", &[]),
    ("numerics", &[]),
];

/// The half that knows files, clocks and the network.
const SERVICE: &[&str] = &[
    "cli",
    "app",
    "api",
    "access",
    "dashboard",
    "store",
    "delivery",
    "event",
    "span",
    "monitor",
    "worker",
];

/// The half that is synchronous and seeded.
#[rustfmt::skip]
const METHOD: &[&str] = &[
    "identification", "estimation", "credit", "genetic", "uncertainty", "demo", "model", "simulation", "language", "intake", "recording", "parsing", "numerics",
];

/// What the method half does without.
#[rustfmt::skip]
const OUTSIDE_WORLD: &[&str] = &[
    "std::env", "std::fs", "std::net", "std::process", "std::time", "std::io::std", "Timestamp::now",
];

/// Where each third party may be used: modules or files.
#[rustfmt::skip]
const PLACES: &[(&str, &[&str])] = &[
    // Settings name headers, and spans come from them.
    ("axum", &["api", "dashboard", "app", "config", "span.rs"]),
    ("hyper", &["app", "cli", "delivery"]),
    ("hyper_util", &["app", "cli", "delivery"]),
    ("url", &["delivery"]),
    ("rustls", &["app", "cli", "delivery"]),
    ("tokio_rustls", &["app", "cli", "delivery"]),
    ("rustls_native_certs", &["delivery"]),
    ("hmac", &["delivery"]),
    ("base64", &["delivery"]),
    ("tokio_io_timeout", &["app"]),
    ("http_body", &["api"]),
    // A command reads the answer of a server over TLS.
    ("http_body_util", &["cli"]),
    ("ipnet", &["api", "app", "config", "delivery"]),
    ("getrandom", &["access", "delivery"]),
    // Connections are files.
    ("rlimit", &["app"]),
    ("tower", &["api", "dashboard", "app"]),
    ("tower_http", &["api", "dashboard", "app"]),
    ("utoipa_axum", &["api"]),
    ("sqlx", &["store", "worker"]),
    ("riverqueue", &["store", "worker"]),
    ("tokio", SERVICE),
    ("tokio_stream", SERVICE),
    ("tokio_util", SERVICE),
    ("futures_util", SERVICE),
    ("tracing", SERVICE),
    ("tracing_subscriber", &["cli"]),
    ("tracing_appender", &["cli/telemetry.rs"]),
    ("metrics", &["api", "app", "delivery", "store", "worker"]),
    ("metrics_exporter_prometheus", &["api", "app"]),
    ("reqwest", &["cli"]),
    // Spans are made in one place and sent from another.
    ("opentelemetry", &["span.rs", "cli/telemetry.rs"]),
    ("opentelemetry_otlp", &["cli/telemetry.rs"]),
    ("opentelemetry_sdk", &["cli/telemetry.rs"]),
    ("tracing_opentelemetry", &["span.rs", "cli/telemetry.rs"]),
    // Where samples are put aside on their way into the database.
    ("tempfile", &["store"]),
    // Settings are flags as well as variables.
    ("clap", &["cli", "config"]),
    ("clap_complete", &["cli"]),
    ("clap_mangen", &["cli"]),
    // The guides are Markdown.
    ("pulldown_cmark", &["dashboard"]),
    ("directories", &["config"]),
    ("indicatif", &["cli"]),
    ("comfy_table", &["cli"]),
    // Texts of plants come in the encodings of their country, and tables in files that are no text.
    ("encoding_rs", &["intake"]),
    ("calamine", &["intake/binary/excel.rs"]),
    ("zip", &["intake/binary/workbook.rs"]),
    ("parquet", &["intake/binary/mod.rs", "intake/binary/parquet"]),
    ("zmij", &["intake/binary/mod.rs"]),
    // "Did you mean" belongs to the reading of documents and of queries.
    ("strsim", &["parsing", "api"]),
    ("saphyr_parser", &["parsing"]),
    ("nalgebra", &["numerics", "uncertainty"]),
    ("rand", &["numerics/rng.rs"]),
    ("rand_chacha", &["numerics/rng.rs"]),
    // The pool is the process's: whoever starts the process sizes it.
    (
        "rayon",
        &["simulation/batch.rs", "estimation/refinement.rs", "estimation/search.rs", "uncertainty", "app", "cli"],
    ),
];

/// What may be used anywhere: the forms of data, errors and identifiers, and mathematics whose
/// bits are the same on every machine. `utoipa` is among them because its derives stand on the
/// types that clients see, wherever those are: a second set of types for the documentation would
/// say everything twice.
#[rustfmt::skip]
const ANYWHERE: &[&str] = &[
    "serde", "serde_json", "thiserror", "utoipa", "uuid", "jiff", "csv", "sha2", "libm", "bytes",
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

fn sources() -> Vec<Source> {
    let root = package().join("src");
    let name = |path: &Path| -> String {
        let inside = path.strip_prefix(&root).expect("a file below src");
        inside.to_string_lossy().replace('\\', "/")
    };
    files("src", &["rs"])
        .iter()
        .map(|path| (name(path), path))
        .filter(|(name, _)| !name.split('/').any(|part| part.starts_with("tests")))
        .map(|(path, file)| Source::new(path, &read(file)))
        .collect()
}

fn assert_none(faults: &[String]) {
    assert!(faults.is_empty(), "\n{}\n", faults.join("\n"));
}

#[test]
fn modules_import_only_what_their_layer_may() {
    let layers: BTreeMap<_, _> = LAYERS.iter().copied().collect();
    let mut faults = Vec::new();
    for source in sources() {
        let module = source.module();
        if matches!(module, "lib" | "main") {
            continue;
        }
        let allowed = layers.get(module).copied().unwrap_or_default();
        for edge in source.edges() {
            let known = layers.contains_key(edge.as_str());
            if known && edge != module && !allowed.contains(&edge.as_str()) {
                faults.push(format!("src/{} imports {edge}", source.path));
            }
        }
    }
    assert_none(&faults);
}

#[test]
fn no_files_need_each_other() {
    let sources = sources();
    let files = Files::new(&sources);
    let circles = files.circles();
    let circles: Vec<String> = circles.iter().map(|own| own.join(" ")).collect();
    assert_none(&circles);
}

#[test]
fn only_the_command_line_starts_programs() {
    let sources = sources();
    let main = sources.iter().find(|source| source.path == "main.rs");
    let main = &main.expect("a program").code;
    let named: Vec<_> = after_path_starts(main, "greybox::")
        .flat_map(first_names)
        .collect();
    assert_eq!(named, ["cli"]);
}

#[test]
fn the_map_declares_every_module_in_the_order_of_the_table() {
    let map = read(&package().join("src/lib.rs"));
    let declared: Vec<&str> = map
        .lines()
        .filter_map(|line| line.split_once("mod ")?.1.strip_suffix(';'))
        .collect();
    let table: Vec<&str> = LAYERS.iter().map(|(module, _)| *module).collect();
    assert_eq!(declared, table);
}

#[test]
fn third_parties_stay_in_their_place() {
    let mut faults = Vec::new();
    for source in sources() {
        for (name, places) in PLACES {
            if source.names_crate(name) && !source.stands_in(places) {
                faults.push(format!("src/{} uses {name}", source.path));
            }
        }
    }
    assert_none(&faults);
}

#[test]
fn every_dependency_has_a_place() {
    let manifest = read(&package().join("Cargo.toml"));
    let section = manifest
        .split("\n[")
        .find_map(|section| section.strip_prefix("dependencies]"));
    let declared: BTreeSet<String> = section
        .expect("dependencies")
        .lines()
        .filter_map(|line| Some(line.split_once(" = ")?.0.replace('-', "_")))
        .collect();
    let placed = PLACES.iter().map(|(name, _)| name).chain(ANYWHERE);
    assert_eq!(declared, placed.map(|name| (*name).to_owned()).collect());
}

#[test]
fn the_method_knows_neither_clock_nor_files_nor_network() {
    let mut faults = Vec::new();
    for source in sources().iter().filter(|source| source.stands_in(METHOD)) {
        for name in OUTSIDE_WORLD
            .iter()
            .filter(|name| source.code.contains(*name))
        {
            faults.push(format!("src/{} uses {name}", source.path));
        }
    }
    assert_none(&faults);
}

#[test]
fn only_the_settings_read_the_environment() {
    let readers = sources()
        .into_iter()
        .filter(|source| source.code.contains("env::var"));
    let readers: Vec<String> = readers.map(|source| source.path).collect();
    assert!(
        readers.iter().all(|path| path == "config.rs"),
        "{readers:?}"
    );
}

#[test]
fn no_source_panics_on_what_is_not_there() {
    let unwrapping = sources()
        .into_iter()
        .filter(|source| source.code.contains(".unwrap()"));
    let faults: Vec<String> = unwrapping.map(|source| source.path).collect();
    assert_none(&faults);
}

/// Files of this project's own writing.
fn own_files() -> Vec<PathBuf> {
    let folders = ["src", "tests", "benches"];
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
