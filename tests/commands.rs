//! The commands as a user types them: files in, files and exit codes out.

#[path = "commands/doctor.rs"]
mod doctor;

use greybox::identification::Outcome;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn greybox(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_greybox"));
    command.args(arguments);
    command
}

fn run(arguments: &[&str]) -> Output {
    greybox(arguments).output().expect("the program starts")
}

/// What a command that succeeds prints.
fn printed(arguments: &[&str]) -> String {
    let output = run(arguments);
    let complaints = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {complaints}");
    String::from_utf8(output.stdout).expect("text")
}

/// What a command that is given something wrong complains about, a line each.
fn complaints(arguments: &[&str]) -> Vec<String> {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    let text = String::from_utf8(output.stderr).expect("text");
    text.lines().map(str::to_owned).collect()
}

fn path<'a>(folder: &'a Path, name: &str, place: &'a mut String) -> &'a str {
    *place = folder
        .join(name)
        .to_str()
        .expect("a path of text")
        .to_owned();
    place
}

fn column(csv_text: &str, name: &str) -> Vec<f64> {
    let mut reader = csv::Reader::from_reader(csv_text.as_bytes());
    let headers = reader.headers().expect("a header").clone();
    let index = headers.iter().position(|header| header == name);
    let index = index.unwrap_or_else(|| panic!("no column {name} in {headers:?}"));
    let number = |row: csv::StringRecord| row[index].parse().expect("a number");
    reader
        .records()
        .map(|row| number(row.expect("a row")))
        .collect()
}

#[test]
fn a_recording_that_is_simulated_again_agrees_to_half_a_code_of_its_sensor() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut place = String::new();
    let recording = path(folder.path(), "d.csv", &mut place);
    printed(&["record", "d", "--seed", "3", "--output", recording]);
    let recorded = std::fs::read_to_string(recording).expect("a recording");
    let parameters = json!({
        "flow_gain": 1.03 * 8.91e-8, "spool_natural_frequency": 376.991_118_430_775_2,
        "dead_band": 0.02, "valve_offset": 0.01, "coulomb_friction": 100,
    });
    let mut place = String::new();
    let given = path(folder.path(), "parameters.json", &mut place);
    std::fs::write(given, parameters.to_string()).expect("a file");
    let simulated = printed(&["simulate", recording, given]);
    let (measured, simulated) = (
        column(&recorded, "position [m]"),
        column(&simulated, "position [m]"),
    );
    assert_eq!((measured.len(), simulated.len()), (12_000, 12_000));
    let apart = measured.iter().zip(&simulated).map(|(a, b)| (a - b).abs());
    assert!(apart.fold(0.0, f64::max) <= 0.5 * 0.14 / 4095.0 * (1.0 + 1e-6));
}

/// Ten seconds of recording A and a search too short to find anything: only the way matters.
fn short_job() -> Value {
    json!({
        "name": "short",
        "model": "single_rod_servo",
        "experiments": [{"window": {"from_s": 0, "to_s": 3}}],
        "outputs": {"position": {"noise_std": 9.9e-6}},
        "method": {"population": 6, "generations": 3, "refine": false},
        "seed": 5,
    })
}

#[test]
fn an_estimation_writes_its_result_and_its_history() {
    let folder = tempfile::tempdir().expect("a folder");
    let [mut a, mut b, mut c, mut d, mut e] = [const { String::new() }; 5];
    let recording = path(folder.path(), "a.csv", &mut a);
    let job = path(folder.path(), "job.json", &mut b);
    let result = path(folder.path(), "result.json", &mut c);
    let history = path(folder.path(), "history.csv", &mut d);
    let candidates = path(folder.path(), "candidates.csv", &mut e);
    printed(&["record", "a", "--output", recording]);
    let mut document = short_job();
    // So that every simulation is a candidate's.
    document["method"]["hill_climbing_interval"] = json!(0);
    std::fs::write(job, document.to_string()).expect("a file");
    let command = [
        "estimate",
        recording,
        job,
        "--output",
        result,
        "--history",
        history,
        "--candidates",
        candidates,
    ];
    let shown = printed(&command);
    for name in [
        "mass (M)",
        "damping (B)",
        "stiffness (Ks)",
        "bulk_modulus (Km)",
        "trust ",
    ] {
        assert!(shown.contains(name), "{shown}");
    }
    let text = std::fs::read(result).expect("a result");
    let outcome: Outcome = serde_json::from_slice(&text).expect("a result document");
    assert_eq!(
        (outcome.job.as_str(), outcome.search.generations),
        ("short", 3)
    );
    assert_eq!(outcome.parameters.len(), 4);
    let history = std::fs::read_to_string(history).expect("a history");
    assert_eq!(column(&history, "generation"), [1.0, 2.0, 3.0]);
    let candidates = std::fs::read_to_string(candidates).expect("candidates");
    let simulated = column(&candidates, "cost");
    assert_eq!(simulated.len() as u64, outcome.search.distinct_evaluations);
    let costs = column(&history, "best_cost");
    let lowest = simulated.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(costs.last(), Some(&lowest));
    assert!(costs.is_sorted_by(|a, b| a >= b), "{costs:?}");
    assert_eq!(
        column(&history, "mass").last(),
        Some(&outcome.parameters[0].estimate.estimate)
    );
}

#[test]
fn a_comparison_runs_every_method_with_every_seed() {
    let folder = tempfile::tempdir().expect("a folder");
    let [mut a, mut b, mut c] = [const { String::new() }; 3];
    let recording = path(folder.path(), "a.csv", &mut a);
    let job = path(folder.path(), "job.json", &mut b);
    let runs = path(folder.path(), "runs.json", &mut c);
    printed(&["record", "a", "--output", recording]);
    let mut document = short_job();
    document["method"] = json!({"population": 6, "generations": 3, "refine_candidates": 1});
    std::fs::write(job, document.to_string()).expect("a file");
    let command = ["compare", recording, job, "--seeds", "2", "--output", runs];
    let shown = printed(&command);
    let text = std::fs::read(runs).expect("the runs");
    let runs: Vec<Value> = serde_json::from_slice(&text).expect("the runs");
    let methods = [
        "icra_genetic",
        "differential_evolution",
        "cma_es",
        "multistart_lm",
    ];
    for method in methods {
        assert!(shown.contains(method), "{shown}");
        let seeds = runs.iter().filter(|run| run["method"] == method);
        let seeds: Vec<u64> = seeds.filter_map(|run| run["seed"].as_u64()).collect();
        assert_eq!(seeds, [1, 2], "{method}");
    }
    // The search from another seed goes another way.
    assert_ne!(runs[0]["evaluations"], Value::Null);
    assert_ne!(runs[0]["estimates"], runs[1]["estimates"]);

    let unknown = ["compare", recording, job, "--methods", "guessing"];
    let complaint = complaints(&unknown).join("\n");
    assert!(complaint.contains("guessing"), "{complaint}");
    document["method"]["population"] = json!(3);
    std::fs::write(job, document.to_string()).expect("a file");
    let complaint = complaints(&["compare", recording, job]).join("\n");
    assert!(complaint.contains("cma_es"), "{complaint}");
    assert!(complaint.contains("at least 4"), "{complaint}");
}

/// A lag whose input and output are the reference and the position of recording A.
const LAG: &str = "\
name: lag
inputs:
  reference: {symbol: u, unit: m}
parameters:
  time: {symbol: T, unit: s, default: 0.2, lower: 0.01, upper: 10, scale: log, unknown: true}
  spare: {unit: s, default: 1}
states:
  x: {unit: m, derivative: (u - x)/T, initial: 0}
outputs:
  position: {unit: m, expression: x}
";

#[test]
fn a_model_in_a_file_is_simulated_and_estimated() {
    let folder = tempfile::tempdir().expect("a folder");
    let [mut a, mut b, mut c, mut d] = [const { String::new() }; 4];
    let recording = path(folder.path(), "steps.csv", &mut a);
    let model = path(folder.path(), "lag.yaml", &mut b);
    let given = path(folder.path(), "parameters.yml", &mut c);
    let job = path(folder.path(), "job.yaml", &mut d);
    let steps = (0..200).map(|k| format!("{},{}\n", f64::from(k) * 0.01, (k / 50) % 2));
    let text = "time [s],reference [m]\n".to_owned() + &steps.collect::<String>();
    std::fs::write(recording, text).expect("a file");
    std::fs::write(model, LAG).expect("a file");
    std::fs::write(given, "time: 0.5 # s\n").expect("a file");
    let output = run(&["simulate", recording, given, "--model", model]);
    let note = String::from_utf8(output.stderr).expect("text");
    let said = format!("note: {model}: /parameters/spare: ");
    assert!(note.starts_with(&said), "{note}");
    let simulated = String::from_utf8(output.stdout).expect("text");
    // The input is held at 1 from 0.5 s to 1 s, and the state started at 0.
    let position = column(&simulated, "position [m]");
    let expected = 1.0 - f64::exp(-0.5 / 0.5);
    assert!((position[100] - expected).abs() < 1e-7, "{}", position[100]);

    let both: Vec<String> = position
        .iter()
        .enumerate()
        .map(|(k, x)| format!("{},{},{x}\n", k as f64 * 0.01, (k / 50) % 2))
        .collect();
    let text = "time [s],reference [m],position [m]\n".to_owned() + &both.concat();
    std::fs::write(recording, text).expect("a file");
    std::fs::write(job, "method: {population: 6, generations: 3}\nseed: 5\n").expect("a file");
    let result = folder.path().join("result.json");
    let result = result.to_str().expect("a path of text");
    printed(&[
        "estimate", recording, job, "--model", model, "--output", result,
    ]);
    let text = std::fs::read(result).expect("a result");
    let outcome: Outcome = serde_json::from_slice(&text).expect("a result document");
    assert!(outcome.model.starts_with("lag@"), "{}", outcome.model);
    let time = outcome.parameters[0].estimate.estimate;
    assert!((time - 0.5).abs() < 1e-5, "{time}");
}

#[test]
fn every_fault_of_a_model_in_a_file_is_named_with_its_place() {
    let folder = tempfile::tempdir().expect("a folder");
    let [mut a, mut b] = [const { String::new() }; 2];
    let recording = path(folder.path(), "steps.csv", &mut a);
    let model = path(folder.path(), "lag.yaml", &mut b);
    std::fs::write(recording, "time [s],reference [m]\n0,1\n0.01,1\n").expect("a file");
    let wrong = LAG.replace("(u - x)/T", "(v - x)/(T");
    std::fs::write(model, wrong.replace("expression: x", "expression: y")).expect("a file");
    let complaints = complaints(&["simulate", recording, "--model", model]);
    assert_eq!(complaints.len(), 2, "{complaints:?}");
    let place = format!("error: {model}: /states/x/derivative: line 1, column 11: ");
    assert!(complaints[0].starts_with(&place), "{complaints:?}");
    std::fs::write(model, "name: [lag\n").expect("a file");
    let output = run(&["simulate", recording, "--model", model]);
    let complaint = String::from_utf8(output.stderr).expect("text");
    assert!(complaint.contains("line 2 column 1"), "{complaint}");
    let output = run(&["simulate", recording, "--model", "lagg"]);
    let complaint = String::from_utf8(output.stderr).expect("text");
    assert!(complaint.contains("positioning_drive"), "{complaint}");
}

#[test]
fn every_fault_of_a_job_is_named_with_its_place() {
    let folder = tempfile::tempdir().expect("a folder");
    let [mut a, mut b] = [const { String::new() }; 2];
    let recording = path(folder.path(), "a.csv", &mut a);
    let job = path(folder.path(), "job.json", &mut b);
    printed(&["record", "a", "--output", recording]);
    let mut document = short_job();
    document["method"]["population"] = json!(1);
    document["parameters"] = json!({"mass": {"estimate": {"lower": 120, "upper": 20}}});
    std::fs::write(job, document.to_string()).expect("a file");
    let complaints = complaints(&["estimate", recording, job]);
    assert_eq!(complaints.len(), 2, "{complaints:?}");
    for pointer in ["/method/population", "/parameters/mass/estimate"] {
        let place = format!("error: {job}: {pointer}");
        assert!(
            complaints.iter().any(|line| line.starts_with(&place)),
            "{complaints:?}"
        );
    }
}

#[test]
fn what_cannot_be_read_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let [mut a, mut b] = [const { String::new() }; 2];
    let recording = path(folder.path(), "bad.csv", &mut a);
    let absent = path(folder.path(), "absent.json", &mut b);
    std::fs::write(recording, "time [s],reference [m]\n0,1\n0.01,1..2\n").expect("a file");
    let complaint = complaints(&["simulate", recording]).join("\n");
    assert!(
        complaint.contains("row") || complaint.contains("line"),
        "{complaint}"
    );
    let complaint = complaints(&["estimate", absent, absent]).join("\n");
    assert!(
        complaint.starts_with(&format!("error: {absent}: ")),
        "{complaint}"
    );
    std::fs::write(recording, "time [s],reference [m]\n0,0.07\n0.01,0.07\n").expect("a file");
    std::fs::write(absent, r#"{"mass": -1, "mas": 2, "damping": "much"}"#).expect("a file");
    let faults = complaints(&["simulate", recording, absent]);
    assert_eq!(faults.len(), 3, "{faults:?}");
}

#[cfg(unix)]
#[test]
fn a_server_says_where_it_listens_is_healthy_and_ends_when_it_is_asked_to() {
    let folder = tempfile::tempdir().expect("a folder");
    let database = format!("sqlite://{}", folder.path().join("jobs.db").display());
    let mut server = greybox(&["serve", "--listen", "127.0.0.1:0", "--database", &database])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts");
    let mut line = String::new();
    let output = server.stdout.take().expect("its output");
    BufReader::new(output).read_line(&mut line).expect("a line");
    let url = line
        .trim_end()
        .strip_prefix("listening on ")
        .expect("where it listens");
    assert_eq!(printed(&["health", url]), "ready\n");
    let asked = Command::new("kill").arg(server.id().to_string()).status();
    assert!(asked.expect("a signal").success());
    assert_eq!(server.wait().expect("an end").code(), Some(0));
    let gone = run(&["health", url]);
    assert_eq!(gone.status.code(), Some(1));
}

#[test]
fn shells_and_manuals_are_told_the_commands() {
    let folder = tempfile::tempdir().expect("a folder");
    let script = printed(&["completions", "bash"]);
    assert!(script.contains("estimate") && script.contains("--candidates"));
    let pages = folder.path().join("man");
    printed(&["man", "--output", pages.to_str().expect("text")]);
    let page = std::fs::read_to_string(pages.join("greybox-estimate.1")).expect("a page");
    assert!(page.contains("\\-\\-signal"), "{page}");
}

#[test]
fn a_job_without_a_document_is_said_on_the_command_line() {
    let complaint = complaints(&["estimate", "a.csv"]).join("\n");
    assert!(complaint.contains("<JOB>"), "{complaint}");
    let complaint = complaints(&["estimate", "a.csv", "--model", "x", "--set", "mass"]).join("\n");
    assert!(complaint.contains("mass=50..70"), "{complaint}");
}

#[test]
fn tokens_are_made_shown_once_listed_and_revoked() {
    let folder = tempfile::tempdir().expect("a folder");
    let database = format!("sqlite://{}", folder.path().join("a.db").display());
    let token = |arguments: &[&str]| {
        let place: [&str; 2] = ["--database", &database];
        run(&[&["token"], arguments, &place[..]].concat())
    };
    let create = [
        "create",
        "--name",
        "mes",
        "--scope",
        "submit",
        "--project",
        "hall-2",
    ];
    let made = token(&create);
    let secret = String::from_utf8(made.stdout).expect("text");
    assert!(
        made.status.success() && secret.starts_with("gbx_"),
        "{secret}"
    );
    let again = token(&create);
    assert_eq!(again.status.code(), Some(2), "the name is taken");
    let list = || String::from_utf8(token(&["list"]).stdout).expect("text");
    let listed = list();
    for word in ["mes", "submit", "hall-2", "valid"] {
        assert!(listed.contains(word), "{word} in {listed}");
    }
    assert!(!listed.contains(secret.trim()), "{listed}");
    assert!(token(&["revoke", "mes"]).status.success());
    assert!(list().contains("revoked"));
    assert_eq!(token(&["revoke", "mes"]).status.code(), Some(2));
    // Its name is free again.
    assert!(token(&create).status.success());
    for wrong in [
        ["create", "--name", "a b", "--scope", "read"],
        ["create", "--name", "a", "--scope", "write"],
    ] {
        assert_eq!(token(&wrong).status.code(), Some(2), "{wrong:?}");
    }
}

/// A server with too few files would take connections and end each at once.
#[cfg(unix)]
#[test]
fn a_server_that_may_open_too_few_files_does_not_start_and_says_how_many_it_needs() {
    let folder = tempfile::tempdir().expect("a folder");
    let database = format!("sqlite://{}", folder.path().join("jobs.db").display());
    let refused = Command::new("sh")
        .args(["-c", "ulimit -n 128; exec \"$0\" \"$@\""])
        .arg(env!("CARGO_BIN_EXE_greybox"))
        .args(["serve", "--listen", "127.0.0.1:0", "--database", &database])
        .output()
        .expect("a shell");
    let complaint = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(1), "{complaint}");
    assert!(
        complaint.contains("allows 128 open files, and a server needs 129"),
        "{complaint}"
    );
}
