//! The program as a process: started on a free port, asked over HTTP, killed or asked to end.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use reqwest::{Client, RequestBuilder, StatusCode};
use serde_json::Value;

/// Nothing here takes so long unless it hangs.
pub const PATIENCE: Duration = Duration::from_secs(300);

/// How a server is started.
#[derive(Clone, Copy)]
pub struct Options {
    pub threads: usize,
    pub slice_s: f64,
    /// On PostgreSQL.
    pub node_beat_s: f64,
}

impl Options {
    pub const fn new(threads: usize, slice_s: f64) -> Self {
        Self {
            threads,
            slice_s,
            node_beat_s: 1.0,
        }
    }
}

/// The address of the database in a folder.
pub fn file(folder: &Path) -> String {
    format!("sqlite://{}", folder.join("greybox.db").display())
}

/// A server process; killed when dropped.
pub struct Server {
    process: Child,
    pub url: String,
    client: Client,
}

impl Server {
    /// Starts the program on a database and waits until it listens.
    pub fn start(folder: &Path, options: Options) -> Self {
        let program = Command::new(env!("CARGO_BIN_EXE_greybox"));
        Self::start_by(program, folder, options)
    }

    /// Starts the program so that it delivers events to this machine.
    pub fn start_delivering(folder: &Path, options: Options) -> Self {
        let mut program = Command::new(env!("CARGO_BIN_EXE_greybox"));
        program.env("GREYBOX_WEBHOOK_TO", "127.0.0.1");
        Self::start_by(program, folder, options)
    }

    /// Starts the program so that it sends its spans to a collector, which the authorities of a file vouch for.
    pub fn start_traced(
        folder: &Path,
        options: Options,
        collector: &str,
        authorities: Option<&Path>,
    ) -> Self {
        let mut program = Command::new(env!("CARGO_BIN_EXE_greybox"));
        program.env("GREYBOX_OTLP_ENDPOINT", collector);
        if let Some(file) = authorities {
            program.env("GREYBOX_OTLP_CA", file);
        }
        Self::start_by(program, folder, options)
    }

    /// Starts the program with a log of every request that nobody reads.
    pub fn start_unread(folder: &Path, options: Options) -> Self {
        let mut program = Command::new(env!("CARGO_BIN_EXE_greybox"));
        program.env("GREYBOX_LOG", "info").stderr(Stdio::piped());
        Self::start_by(program, folder, options)
    }

    /// Starts the program without a log, so that its files may be limited.
    #[cfg(target_os = "linux")]
    pub fn start_limitable(folder: &Path, options: Options) -> Self {
        let mut program = Command::new(env!("CARGO_BIN_EXE_greybox"));
        // It may be a file, and then grows no more either.
        program.stderr(Stdio::null());
        Self::start_by(program, folder, options)
    }

    /// Starts the program with so many bytes of address space; nothing where the system has no `prlimit`.
    #[cfg(target_os = "linux")]
    pub fn start_with_memory(folder: &Path, options: Options, bytes: u64) -> Option<Self> {
        let version = Command::new("prlimit").arg("--version").output();
        version
            .is_ok_and(|version| version.status.success())
            .then(|| {
                let mut program = Command::new("prlimit");
                program.arg(format!("--as={bytes}"));
                program.arg(env!("CARGO_BIN_EXE_greybox"));
                Self::start_by(program, folder, options)
            })
    }

    /// Sets how large files may grow, as a full disk does; says whether that could be done.
    #[cfg(target_os = "linux")]
    pub fn limit_files(&self, bytes: &str) -> bool {
        let id = self.process.id().to_string();
        let limit = format!("--fsize={bytes}:");
        let set = Command::new("prlimit")
            .args(["--pid", &id, &limit])
            .status();
        set.is_ok_and(|status| status.success())
    }

    /// The most memory that the process had since it began or since [`Self::forget_memory`] `[bytes]`.
    #[cfg(target_os = "linux")]
    pub fn most_memory(&self) -> u64 {
        let path = format!("/proc/{}/status", self.process.id());
        let status = std::fs::read_to_string(path).expect("a live process");
        let mut lines = status.lines();
        let most = lines.find_map(|line| line.strip_prefix("VmHWM:"));
        let kib = most.and_then(|most| most.trim().strip_suffix(" kB"));
        let kib: u64 = kib.and_then(|kib| kib.parse().ok()).expect("a size in kB");
        kib << 10
    }

    /// Has [`Self::most_memory`] begin with what the process has now; without the right to it, with
    /// what the process had at the most.
    #[cfg(target_os = "linux")]
    pub fn forget_memory(&self) {
        let path = format!("/proc/{}/clear_refs", self.process.id());
        if let Err(error) = std::fs::write(path, "5") {
            eprintln!("the most memory since the start is taken for the rest: {error}");
        }
    }

    /// Starts the program on the database of an address.
    pub fn start_on(database: &str, options: Options) -> Self {
        let program = Command::new(env!("CARGO_BIN_EXE_greybox"));
        Self::start_with(program, database, options)
    }

    fn start_by(program: Command, folder: &Path, options: Options) -> Self {
        Self::start_with(program, &file(folder), options)
    }

    fn start_with(mut program: Command, database: &str, options: Options) -> Self {
        if program.get_envs().all(|(name, _)| name != "GREYBOX_LOG") {
            program.env("GREYBOX_LOG", "warn");
        }
        let mut process = program
            .args(["serve", "--listen", "127.0.0.1:0"])
            .args(["--database", database])
            .args(["--threads", &options.threads.to_string()])
            .args(["--slice-s", &options.slice_s.to_string()])
            .args(["--node-beat-s", &options.node_beat_s.to_string()])
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let output = process.stdout.take().expect("its output is piped");
        let mut line = String::new();
        BufReader::new(output)
            .read_line(&mut line)
            .expect("the program says where it listens");
        let url = line.trim().strip_prefix("listening on ");
        Self {
            url: url.unwrap_or_else(|| panic!("it said: {line}")).to_owned(),
            process,
            client: Client::new(),
        }
    }

    /// Kills the process as a power cut would.
    pub fn kill(mut self) {
        self.process.kill().expect("a live process");
        self.process.wait().expect("a dead process");
    }

    /// Asks the process to end (SIGTERM) and says how it ended and how long that took.
    pub fn terminate(mut self) -> (ExitStatus, Duration) {
        let asked = Instant::now();
        let id = self.process.id().to_string();
        let sent = Command::new("kill").args(["-TERM", &id]).status();
        assert!(sent.expect("the kill command").success());
        let status = self.process.wait().expect("an ended process");
        (status, asked.elapsed())
    }

    /// Has the process stand still, or go on.
    pub fn stand_still(&self, still: bool) {
        let signal = if still { "-STOP" } else { "-CONT" };
        let id = self.process.id().to_string();
        let sent = Command::new("kill").args([signal, &id]).status();
        assert!(sent.expect("the kill command").success());
    }

    /// Whether the process has ended.
    pub fn has_ended(&mut self) -> bool {
        self.process.try_wait().expect("its state").is_some()
    }

    pub fn get(&self, path: &str) -> RequestBuilder {
        self.client.get(format!("{}{path}", self.url))
    }

    pub fn post(&self, path: &str) -> RequestBuilder {
        self.client.post(format!("{}{path}", self.url))
    }

    /// The JSON of a path that is there.
    pub async fn show(&self, path: &str) -> Value {
        let (status, body) = answer(self.get(path)).await.expect("an answer");
        assert_eq!(status, StatusCode::OK, "{body}");
        body
    }

    /// Stores a recording and returns its identifier.
    pub async fn store(&self, recording: &Value) -> String {
        let request = self.post("/v1/datasets").json(recording);
        let (status, body) = answer(request).await.expect("an answer");
        assert!(status.is_success(), "{body}");
        text(&body["id"])
    }

    /// Submits a job under a key and returns its identifier; an error when the server went down.
    pub async fn submit(&self, job: &Value, key: &str) -> Result<String, reqwest::Error> {
        let request = self
            .post("/v1/jobs")
            .header("idempotency-key", key)
            .json(job);
        let (status, body) = answer(request).await?;
        assert_eq!(status, StatusCode::ACCEPTED, "{body}");
        Ok(text(&body["id"]))
    }

    /// The job when it has come to its end.
    pub async fn ended(&self, job: &str) -> Value {
        let ended = ["succeeded", "failed", "cancelled"];
        let asked = Instant::now();
        while asked.elapsed() < PATIENCE {
            let shown = self.show(&format!("/v1/jobs/{job}?wait=20")).await;
            if ended.iter().any(|status| shown["status"] == *status) {
                return shown;
            }
        }
        panic!("{job} did not end");
    }

    /// The job when it is in a state.
    pub async fn in_state(&self, job: &str, status: &str) -> Value {
        let asked = Instant::now();
        while asked.elapsed() < PATIENCE {
            let shown = self.show(&format!("/v1/jobs/{job}?wait=20")).await;
            if shown["status"] == status {
                return shown;
            }
        }
        panic!("{job} did not become {status}");
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // It may have ended before.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// The status and the JSON of an answer.
pub async fn answer(request: RequestBuilder) -> Result<(StatusCode, Value), reqwest::Error> {
    let answer = request.send().await?;
    Ok((answer.status(), answer.json().await?))
}

/// A text in a document.
#[track_caller]
pub fn text(value: &Value) -> String {
    value.as_str().expect("a text").to_owned()
}
