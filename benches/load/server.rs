//! The program as a process on a free port, and what the kernel says of it.

use std::fs;
use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use crate::Outcome;
use crate::client::{Connection, get};

/// The program that is measured.
static PROGRAM: OnceLock<String> = OnceLock::new();

/// The database that it works with; nothing for a file in a temporary folder.
static DATABASE: OnceLock<Option<String>> = OnceLock::new();

/// How many servers work with it, where a scenario is one of several.
static NODES: OnceLock<usize> = OnceLock::new();

/// Measures another program than the one that was built with this, another database, or several servers
/// on one.
pub fn choose(program: Option<String>, database: Option<String>, nodes: usize) {
    let built = env!("CARGO_BIN_EXE_greybox").to_owned();
    PROGRAM.get_or_init(|| program.unwrap_or(built));
    DATABASE.get_or_init(|| database);
    NODES.get_or_init(|| nodes);
}

/// The database, by its address.
pub fn database(folder: &Path) -> String {
    let file = || format!("sqlite://{}", folder.join("greybox.db").display());
    DATABASE.get().cloned().flatten().unwrap_or_else(file)
}

/// A server process; ended when dropped.
pub struct Server {
    process: Child,
    pub address: SocketAddr,
    /// From the start of the process until it said that it is ready.
    pub ready_after: Duration,
}

impl Server {
    /// Starts as many as there are to be.
    pub async fn start_all(folder: &Path) -> Outcome<Vec<Self>> {
        let mut servers = Vec::new();
        for _ in 0..NODES.get().copied().unwrap_or(1) {
            servers.push(Self::start(folder, &[]).await?);
        }
        Ok(servers)
    }

    /// Starts the program on the database of a folder and waits until it is ready.
    pub async fn start(folder: &Path, flags: &[&str]) -> Outcome<Self> {
        let started = Instant::now();
        let mut process = Command::new(PROGRAM.get().ok_or("no program was chosen")?)
            .args(["serve", "--listen", "127.0.0.1:0", "--log", "warn"])
            .args(["--database", &database(folder)])
            .args(flags)
            .stdout(Stdio::piped())
            .spawn()?;
        let output = process.stdout.take().ok_or("its output is piped")?;
        let mut server = Self {
            process,
            address: ([127, 0, 0, 1], 0).into(),
            ready_after: Duration::ZERO,
        };
        let mut line = String::new();
        BufReader::new(output).read_line(&mut line)?;
        let address = line.trim().strip_prefix("listening on http://");
        server.address = address.ok_or("it did not say where it listens")?.parse()?;
        let mut connection = server.connect().await?;
        let ready = connection.ask(&get("/readyz", "")).await?;
        if ready.status != 200 {
            return Err("it listens but is not ready".into());
        }
        server.ready_after = started.elapsed();
        Ok(server)
    }

    pub async fn connect(&self) -> Outcome<Connection> {
        Connection::open(self.address).await
    }

    /// Memory that it holds now [KiB].
    pub fn memory_kib(&self) -> Outcome<f64> {
        self.status("VmRSS:")
    }

    /// Memory that it held at the most since [`Self::forget_peak`] [KiB].
    pub fn peak_kib(&self) -> Outcome<f64> {
        self.status("VmHWM:")
    }

    /// Begins to look for the peak anew.
    pub fn forget_peak(&self) -> Outcome {
        Ok(fs::write(self.file("clear_refs"), "5")?)
    }

    /// Processor time that it has used.
    pub fn cpu(&self) -> Outcome<Duration> {
        /// The kernel counts in hundredths of a second on every Linux that we know of.
        const TICK: Duration = Duration::from_millis(10);
        let stat = fs::read_to_string(self.file("stat"))?;
        let (_, fields) = stat.rsplit_once(')').ok_or("no name in its stat")?;
        let times = fields.split_whitespace().skip(11).take(2);
        let ticks: u32 = times.map(|time| time.parse().unwrap_or(0)).sum();
        Ok(TICK * ticks)
    }

    fn status(&self, name: &str) -> Outcome<f64> {
        let status = fs::read_to_string(self.file("status"))?;
        let line = status.lines().find_map(|line| line.strip_prefix(name));
        let number = line.and_then(|line| line.split_whitespace().next());
        Ok(number.ok_or("it has no such status")?.parse()?)
    }

    fn file(&self, name: &str) -> String {
        format!("/proc/{}/{name}", self.process.id())
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // It may have ended already; then there is nothing to end.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
