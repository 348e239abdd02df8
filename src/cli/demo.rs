//! `greybox demo`: a server, a recording whose true parameters are known, its job, and what came
//! of it. All of it goes over HTTP, as any client would do it.

use super::client::Client;
use super::error::CommandError;
use super::progress::{self, Progress};
use super::record::Letter;
use super::telemetry::Telemetry;
use super::{files, serve, table};
use crate::app::App;
use crate::config::Settings;
use clap::Args;
use greybox::demo::{self, Demo};
use greybox::identification::Outcome;
use serde_json::{Value, json};
use std::io::IsTerminal;
use std::process::{Command, Stdio};

/// The seed of the recording.
const SEED: u64 = 1;

/// What `demo` is given.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Which recording
    #[arg(long, default_value = "a")]
    recording: Letter,

    /// Leave the server running until ctrl-c, also where no terminal watches
    #[arg(long)]
    keep: bool,

    /// Do not open the page in a browser
    #[arg(long)]
    no_open: bool,

    #[command(flatten)]
    settings: Settings,
}

/// Runs the demonstration.
pub fn demo(arguments: Arguments) -> Result<(), CommandError> {
    let mut settings = arguments.settings;
    if settings.log == Settings::default().log {
        // The live line and a log would write over each other.
        "warn".clone_into(&mut settings.log);
    }
    let telemetry = Telemetry::begin(&settings)?;
    let shown = serve::block_on(async {
        let app = start(settings).await?;
        let base = format!("http://{}", app.local_addr());
        let watched = std::io::stdout().is_terminal();
        let browser = Browser(watched && !arguments.no_open);
        let demonstration = demonstrate(&base, arguments.recording.into(), browser);
        let shown = tokio::select! {
            shown = demonstration => shown,
            _ = app.wait_for_signal() => Err(CommandError::failed(
                "interrupted; the job goes on when a server is started on this database",
            )),
        };
        if shown.is_ok() && (arguments.keep || watched) {
            println!("\n{base} serves until ctrl-c");
            app.wait_for_signal().await.map_err(CommandError::failed)?;
        }
        app.shutdown().await;
        shown
    });
    telemetry.end();
    shown
}

/// A server at the address of the settings or, where that is taken and nobody asked for it, at a
/// free port.
async fn start(settings: Settings) -> Result<App, CommandError> {
    let is_default = settings.listen == Settings::default().listen;
    let is_taken = std::net::TcpListener::bind(settings.listen).is_err();
    let mut settings = settings;
    if is_default && is_taken {
        settings.listen.set_port(0);
    }
    serve::start(settings).await
}

/// Whether the page shall be opened for whoever watches.
struct Browser(bool);

impl Browser {
    /// Opens the page, where there is a program for that; the address has been printed in any case.
    fn open(&self, address: &str) {
        let (program, before): (_, &[&str]) = match std::env::consts::OS {
            "macos" => ("open", &[]),
            "windows" => ("cmd", &["/C", "start", ""]),
            _ => ("xdg-open", &[]),
        };
        if self.0 {
            let mut command = Command::new(program);
            command.args(before).arg(address);
            command
                .stdin(Stdio::null())
                .stdout(Stdio::null())
                .stderr(Stdio::null());
            drop(command.spawn());
        }
    }
}

async fn demonstrate(base: &str, demo: Demo, browser: Browser) -> Result<(), CommandError> {
    let client = Client::new(base)?;
    let recording = demo::recording(demo, SEED);
    let name = recording.name.as_deref().unwrap_or_default();
    let dataset = client.store(name, files::csv(&recording)).await?;
    println!("stored {name}: {} samples", dataset["samples"]);
    let mut document = demo::job(demo);
    document["experiments"][0]["dataset"] = dataset["id"].clone();
    let job = client.submit(&document).await?;
    let id = job["id"].as_str().unwrap_or_default();
    println!("submitted {id}");
    let page = client.url(&format!("/#/jobs/{id}"));
    println!("watch it at {page}\n");
    browser.open(&page);
    follow(&client, &job).await?;
    let result = client.get(&format!("/v1/jobs/{id}/result")).await?;
    let outcome: Outcome = serde_json::from_value(result).map_err(CommandError::failed)?;
    println!(
        "\n{}",
        table::of(&outcome, Some(&demo::true_parameters(demo)))
    );
    Ok(())
}

/// Shows the job's events until it has ended.
async fn follow(client: &Client, job: &Value) -> Result<(), CommandError> {
    let id = job["id"].as_str().unwrap_or_default();
    let generations = job["spec"]["method"]["generations"].as_u64().unwrap_or(1);
    let mut events = client.events(&format!("/v1/jobs/{id}/events")).await?;
    let mut progress = Progress::new();
    while let Some(event) = events.next().await? {
        match event.name.as_str() {
            "finding" => show_finding(&event.data),
            "generation" => show_generation(&mut progress, &event.data, generations),
            "refinement" => show_refinement(&mut progress, &event.data),
            "posterior" => show_posterior(&mut progress, &event.data),
            "end" => {
                progress.finish();
                return ended(client, id, &event.data["status"]).await;
            }
            _ => {}
        }
    }
    Err(CommandError::failed("the events ended before the job did"))
}

fn show_finding(finding: &Value) {
    let detail = finding["detail"].as_str().unwrap_or_default();
    eprintln!("note: {detail}");
}

fn show_generation(progress: &mut Progress, data: &Value, generations: u64) {
    let generation = data["generation"].as_u64().unwrap_or_default();
    let best = data["best"].as_object().into_iter().flatten();
    let best = best.filter_map(|(name, value)| Some((name.as_str(), value.as_f64()?)));
    let numbers = [data["best_cost"].as_f64(), data["best_credit"].as_f64()];
    let text = progress::generation([generation, generations], numbers, best);
    progress.update(generation as f64 / generations.max(1) as f64, text);
}

fn show_refinement(progress: &mut Progress, data: &Value) {
    if let (Some(iteration), Some(cost)) = (data["iteration"].as_u64(), data["cost"].as_f64()) {
        progress.update(1.0, progress::refinement(iteration, cost));
    }
}

fn show_posterior(progress: &mut Progress, data: &Value) {
    let counts = ["generation", "generations"].map(|field| data[field].as_u64().unwrap_or(0));
    progress.update(1.0, progress::posterior(counts, data["r_hat"].as_f64()));
}

async fn ended(client: &Client, id: &str, status: &Value) -> Result<(), CommandError> {
    if *status == json!("succeeded") {
        return Ok(());
    }
    let job = client.get(&format!("/v1/jobs/{id}")).await?;
    let why = job["error"]["detail"].as_str().unwrap_or_default();
    let status = status.as_str().unwrap_or_default();
    Err(CommandError::failed(format!("the job {status}: {why}")))
}
