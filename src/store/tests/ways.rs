//! Ways to a PostgreSQL: with TLS, through a pooler, and one on which connections are lost.

use std::io::ErrorKind;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};
use std::time::Instant;

use tokio::io::copy_bidirectional;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use url::Url;

use super::*;

/// How long something may take that takes no time at all.
const PATIENCE: Duration = Duration::from_secs(60);

/// A new database, and where its server is.
struct Database {
    name: String,
    port: u16,
    folder: String,
}

impl Database {
    /// Nothing where PostgreSQL is not installed.
    fn new() -> Option<Self> {
        let url: Url = cluster::new_database()?.parse().expect("an address");
        let (_, folder) = url.query_pairs().next().expect("a folder");
        Some(Self {
            name: url.path().trim_start_matches('/').to_owned(),
            port: url.port().expect("a port"),
            folder: folder.into_owned(),
        })
    }

    /// The address by way of a host and a port.
    fn at(&self, host: &str, port: u16, parameters: &str) -> String {
        format!(
            "postgres://postgres@{host}:{port}/{}?{parameters}",
            self.name
        )
    }
}

fn settings(address: &str) -> DatabaseSettings {
    DatabaseSettings {
        place: DatabasePlace::of_postgres(address).expect("an address"),
        readers: 2,
        busy_timeout: Duration::from_secs(5),
        beat: Duration::from_millis(50),
        keys: Default::default(),
    }
}

async fn opened(address: &str) -> Result<Store, StoreError> {
    Store::open(&settings(address), Arc::new(|_| ())).await
}

/// How connections are encrypted, whoever they are of.
async fn versions_of_tls(store: &Store) -> Vec<Option<String>> {
    database::query_scalar(
        "select distinct version from pg_stat_ssl join pg_stat_activity using (pid) \
         where datname = current_database() and application_name like 'greybox%'",
    )
    .fetch_all(store.readers())
    .await
    .expect("versions")
}

#[tokio::test]
async fn connections_are_encrypted_where_the_server_can_and_the_server_is_verified_where_that_is_asked()
 {
    let Some(database) = Database::new() else {
        return;
    };
    let authority = format!("{}/authority.pem", database.folder);
    let verified = format!("sslmode=verify-full&sslrootcert={authority}");
    for parameters in ["", "sslmode=require", &verified] {
        let store = opened(&database.at("localhost", database.port, parameters)).await;
        let store = store.expect("a server");
        let versions = versions_of_tls(&store).await;
        assert_eq!(versions, [Some("TLSv1.3".to_owned())], "{parameters}");
        store.close().await;
    }
    let clear = database.at("localhost", database.port, "sslmode=disable");
    let store = opened(&clear).await.expect("a server");
    assert_eq!(versions_of_tls(&store).await, [None]);
    store.close().await;
}

#[tokio::test]
async fn a_server_with_the_certificate_of_another_is_refused() {
    let Some(database) = Database::new() else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let stranger = folder.path().join("stranger.pem");
    let made = rcgen::generate_simple_self_signed(["localhost".to_owned()]);
    std::fs::write(&stranger, made.expect("a certificate").cert.pem()).expect("a file");
    let authority = format!("{}/authority.pem", database.folder);
    for (host, authority) in [
        ("localhost", stranger.to_str().expect("a path")),
        // The certificate is for `localhost`.
        ("127.0.0.1", &authority),
    ] {
        let parameters = format!("sslmode=verify-full&sslrootcert={authority}");
        let address = database.at(host, database.port, &parameters);
        let refused = opened(&address).await.err().expect("a refusal");
        let text = refused.to_string();
        assert!(text.contains("invalid peer certificate"), "{text}");
        assert_eq!(refused.meaning(), Meaning::Unavailable);
    }
}

#[tokio::test]
async fn a_connection_says_which_program_it_is_of_and_what_it_is_for() {
    let Some(database) = Database::new() else {
        return;
    };
    for (parameters, program) in [("", "greybox"), ("application_name=hall-2", "hall-2")] {
        let address = database.at("localhost", database.port, parameters);
        let store = opened(&address).await.expect("a server");
        let name: String = database::query_scalar("select current_setting('application_name')")
            .fetch_one(store.readers())
            .await
            .expect("a name");
        let expected = format!("{program} reads ");
        assert!(name.starts_with(&expected), "{name}");
        store.close().await;
    }
}

/// A PgBouncer of the tests' own; it ends when it is dropped.
struct Pooler {
    process: Child,
    folder: tempfile::TempDir,
    port: u16,
}

impl Pooler {
    /// Nothing where PgBouncer is not installed.
    fn start(database: &Database, mode: &str) -> Option<Self> {
        let folder = tempfile::tempdir().expect("a folder");
        let (home, port) = (folder.path().display(), 6432);
        let configuration = folder.path().join("pgbouncer.ini");
        let text = format!(
            "[databases]\n* = host={} port={} user=postgres\n[pgbouncer]\npool_mode = {mode}\n\
             unix_socket_dir = {home}\nlisten_port = {port}\nauth_type = any\nlogfile = {home}/log\n",
            database.folder, database.port,
        );
        std::fs::write(&configuration, text).expect("a file");
        let mut command = Command::new("pgbouncer");
        command.arg("--quiet").arg(&configuration);
        use std::os::unix::fs::MetadataExt;
        let owner = std::fs::metadata(&database.folder).expect("the server's folder");
        if std::fs::metadata("/proc/self").expect("this process").uid() == 0 {
            // It does not run as root.
            command.uid(owner.uid()).gid(owner.gid());
            std::os::unix::fs::chown(folder.path(), Some(owner.uid()), Some(owner.gid()))
                .expect("its folder");
            let readable = std::os::unix::fs::PermissionsExt::from_mode(0o644);
            std::fs::set_permissions(&configuration, readable).expect("its mode");
        }
        let path = std::env::var("PATH").unwrap_or_default();
        command.env("PATH", format!("{path}:/usr/sbin"));
        let process = match command.stderr(Stdio::null()).spawn() {
            Err(error) if error.kind() == ErrorKind::NotFound => {
                eprintln!("NOT TESTED through PgBouncer: it is not installed");
                return None;
            }
            spawned => spawned.expect("a pooler"),
        };
        let pooler = Self {
            process,
            folder,
            port,
        };
        let socket = pooler.folder.path().join(format!(".s.PGSQL.{port}"));
        let began = Instant::now();
        while !socket.exists() {
            assert!(began.elapsed() < PATIENCE, "PgBouncer does not begin");
        }
        Some(pooler)
    }

    fn address(&self, database: &Database) -> String {
        let parameters = format!("host={}", self.folder.path().display());
        database.at("localhost", self.port, &parameters)
    }
}

impl Drop for Pooler {
    fn drop(&mut self) {
        // It may have ended before.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[tokio::test]
async fn servers_work_through_a_pooler_that_keeps_a_connection_for_each_client() {
    let Some(database) = Database::new() else {
        return;
    };
    let Some(pooler) = Pooler::start(&database, "session") else {
        return;
    };
    let address = pooler.address(&database);
    let writer = opened(&address).await.expect("a server");
    let changes = Arc::default();
    let hearer = open(&settings(&address), &changes).await;
    hears(&writer, &changes).await;
    let limit: String = database::query_scalar("select current_setting('statement_timeout')")
        .fetch_one(hearer.readers())
        .await
        .expect("a setting");
    assert_eq!(limit, "1min");
    hearer.close().await;
    writer.close().await;
}

#[tokio::test]
async fn a_pooler_that_gives_connections_to_one_client_after_the_other_is_refused() {
    let Some(database) = Database::new() else {
        return;
    };
    let Some(pooler) = Pooler::start(&database, "transaction") else {
        return;
    };
    let refused = opened(&pooler.address(&database)).await;
    let refused = refused.err().expect("a refusal");
    assert!(
        matches!(refused, StoreError::SharedSessions { .. }),
        "{refused}"
    );
}

/// Returns when a server has heard of a job that another one wrote after the call.
async fn hears(writer: &Store, changes: &Arc<Mutex<Vec<Change>>>) {
    let began = Instant::now();
    changes.lock().expect("unpoisoned").clear();
    let is_job = |change: &Change| matches!(change, Change::Job(_));
    while !changes.lock().expect("unpoisoned").iter().any(is_job) {
        assert!(began.elapsed() < PATIENCE, "nothing is heard");
        writer.submissions().submit(job(None)).await.expect("a job");
    }
}

/// A way to a port on which connections can be lost: nothing comes through any more, and nobody is told.
struct Way {
    port: u16,
    losses: watch::Sender<()>,
}

impl Way {
    async fn to(port: u16) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let near_port = listener.local_addr().expect("an address").port();
        let losses = watch::Sender::new(());
        let told = losses.clone();
        tokio::spawn(async move {
            loop {
                let (near, _) = listener.accept().await.expect("a connection");
                tokio::spawn(carry(near, port, told.subscribe()));
            }
        });
        Self {
            port: near_port,
            losses,
        }
    }
}

/// Carries what comes both ways until the connection is lost; it then stays open.
async fn carry(mut near: TcpStream, port: u16, mut losses: watch::Receiver<()>) {
    let far = TcpStream::connect(("127.0.0.1", port)).await;
    let mut far = far.expect("a connection");
    tokio::select! {
        // Either end may break off.
        _ = copy_bidirectional(&mut near, &mut far) => {}
        lost = losses.changed() => {
            if lost.is_ok() {
                std::future::pending().await
            }
        }
    }
}

#[tokio::test]
async fn a_server_whose_connections_are_lost_silently_hears_again_and_reads_again() {
    let Some(database) = Database::new() else {
        return;
    };
    let writer = opened(&database.at("localhost", database.port, "")).await;
    let writer = writer.expect("a server");
    let way = Way::to(database.port).await;
    let changes = Arc::default();
    let address = database.at("localhost", way.port, "");
    let hearer = open(&settings(&address), &changes).await;
    hears(&writer, &changes).await;
    way.losses.send(()).expect("connections");
    hears(&writer, &changes).await;
    let page = hearer.jobs().counts().await.expect("a read");
    assert!(!page.is_empty());
    hearer.close().await;
    writer.close().await;
}
