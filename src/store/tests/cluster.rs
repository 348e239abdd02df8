//! A PostgreSQL of the tests' own, from the system's package; it ends and goes with the tests. It listens on a socket
//! in its folder and on the loopback interface, there with TLS: its certificate is for `localhost`, and the
//! authority that signed it is `authority.pem` in the folder.

use std::io::Write;
use std::net::{Ipv4Addr, TcpListener};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use rcgen::{BasicConstraints, CertificateParams, CertifiedIssuer, IsCa, KeyPair};

/// How long it may take to begin.
const PATIENCE: Duration = Duration::from_secs(60);

/// Ends the server and removes its folder when its input ends: when the process of the tests does.
const KEEPER: &str = "\"$0/postgres\" -D \"$1/data\" -k \"$1\" -p \"$2\" -c listen_addresses=127.0.0.1 \
                      -c fsync=off -c max_connections=400 -c ssl=on -c ssl_cert_file=\"$1/server.pem\" \
                      -c ssl_key_file=\"$1/server.key\" >\"$1/log\" 2>&1 & \
                      read _; kill -QUIT $!; wait; rm -rf \"$1\"";

struct Cluster {
    programs: PathBuf,
    folder: PathBuf,
    port: String,
    /// Its input is open for as long as this process lives.
    _keeper: Child,
}

/// The address of a new, empty database; nothing where PostgreSQL is not installed.
pub(super) fn new_database() -> Option<String> {
    static CLUSTER: OnceLock<Option<Cluster>> = OnceLock::new();
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let cluster = CLUSTER.get_or_init(Cluster::start).as_ref()?;
    let name = format!("test_{}", NEXT.fetch_add(1, Ordering::Relaxed));
    let made = Command::new(cluster.programs.join("createdb"))
        .args(["--username=postgres", "--port", &cluster.port, "--host"])
        .arg(&cluster.folder)
        .arg(&name)
        .status();
    assert!(made.expect("createdb").success(), "createdb failed");
    let (folder, port) = (cluster.folder.display(), &cluster.port);
    Some(format!(
        "postgres://postgres@localhost:{port}/{name}?host={folder}"
    ))
}

impl Cluster {
    fn start() -> Option<Self> {
        let Some(programs) = programs() else {
            let mut told = std::io::stderr().lock();
            writeln!(told, "NOT TESTED on PostgreSQL: it is not installed").expect("a message");
            return None;
        };
        let folder = tempfile::tempdir().expect("a folder").keep();
        let user = user();
        if let Some((id, group)) = user {
            std::os::unix::fs::chown(&folder, Some(id), Some(group)).expect("its folder");
        }
        let run = |program: &Path| {
            let mut command = Command::new(program);
            if let Some((id, group)) = user {
                command.uid(id).gid(group);
            }
            command.current_dir(&folder);
            command
        };
        let made = run(&programs.join("initdb"))
            .args([
                "--username=postgres",
                "--auth=trust",
                "--no-sync",
                "--encoding=UTF8",
            ])
            .args(["--locale=C", "-D"])
            .arg(folder.join("data"))
            .stdout(Stdio::null())
            .status();
        assert!(made.expect("initdb").success(), "initdb failed");
        certify(&folder, user);
        let port = free_port();
        let keeper = run(Path::new("/bin/sh"))
            .args(["-c", KEEPER])
            .arg(&programs)
            .arg(&folder)
            .arg(&port)
            .stdin(Stdio::piped())
            .spawn()
            .expect("a shell");
        let began = Instant::now();
        let answers = || {
            let mut asked = Command::new(programs.join("pg_isready"));
            let asked = asked.args(["--quiet", "--port", &port, "--host"]);
            let status = asked.arg(&folder).status();
            status.expect("pg_isready").success()
        };
        while !answers() {
            assert!(began.elapsed() < PATIENCE, "PostgreSQL does not begin");
        }
        Some(Self {
            programs,
            folder,
            port,
            _keeper: keeper,
        })
    }
}

/// A port that nobody listens on and that the system gives to no connection.
fn free_port() -> String {
    let first = 10_000 + std::process::id() % 10_000;
    let ports = (first..20_000).chain(10_000..first).map(|port| port as u16);
    let mut free = ports.filter(|port| TcpListener::bind((Ipv4Addr::LOCALHOST, *port)).is_ok());
    free.next().expect("a free port").to_string()
}

/// Makes an authority, and a certificate of the server with its key.
fn certify(folder: &Path, user: Option<(u32, u32)>) {
    let mut authority = CertificateParams::default();
    authority.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    let key = || KeyPair::generate().expect("a key");
    let authority = CertifiedIssuer::self_signed(authority, key()).expect("an authority");
    let server = CertificateParams::new(["localhost".to_owned()]).expect("parameters");
    let server_key = key();
    let server = server.signed_by(&server_key, &authority);
    for (name, text) in [
        ("authority.pem", authority.pem()),
        ("server.pem", server.expect("a certificate").pem()),
        ("server.key", server_key.serialize_pem()),
    ] {
        let path = folder.join(name);
        std::fs::write(&path, text).expect("a file");
        let private = std::os::unix::fs::PermissionsExt::from_mode(0o600);
        std::fs::set_permissions(&path, private).expect("its mode");
        if let Some((id, group)) = user {
            std::os::unix::fs::chown(&path, Some(id), Some(group)).expect("its owner");
        }
    }
}

/// Where the server's programs are.
fn programs() -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let of_path = std::env::split_paths(&path).collect::<Vec<_>>();
    let of_packages = std::fs::read_dir("/usr/lib/postgresql")
        .into_iter()
        .flatten();
    let of_packages = of_packages
        .flatten()
        .map(|version| version.path().join("bin"));
    let mut all = of_path.into_iter().chain(of_packages);
    let needed = ["initdb", "postgres", "createdb", "pg_isready"];
    all.find(|folder| needed.iter().all(|one| folder.join(one).exists()))
}

/// The user and group that it runs as: it does not run as root, so then those of `nobody`.
fn user() -> Option<(u32, u32)> {
    use std::os::unix::fs::MetadataExt;
    let own = std::fs::metadata("/proc/self").expect("this process").uid();
    (own == 0).then_some((65534, 65534))
}
