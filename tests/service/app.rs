//! A server on a free port with an empty database, and a client that talks to it.

use std::net::Ipv4Addr;

use greybox_service::access::{Scope, Secret};
use greybox_service::app::App;
use greybox_service::config::{DatabaseArguments, Settings};
use greybox_service::store::DatabasePlace;
use greybox_service::store::tokens::{self, NewToken};
use jiff::Timestamp;
use reqwest::header::HeaderMap;
use reqwest::{Method, RequestBuilder, StatusCode};
use serde_json::{Value, json};
use tempfile::TempDir;

use super::cluster;

/// A running server.
pub struct TestApp {
    app: App,
    client: reqwest::Client,
    home: Home,
}

/// Where a server keeps what it knows: in a file, or in PostgreSQL where `GREYBOX_TESTS_ON` says so.
struct Home {
    url: String,
    _folder: TempDir,
}

impl Home {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let on_postgres = std::env::var_os("GREYBOX_TESTS_ON").is_some_and(|on| on == "postgres");
        let url = match on_postgres {
            true => cluster::new_database().expect("PostgreSQL is installed"),
            false => format!("sqlite://{}", folder.path().join("greybox.db").display()),
        };
        Self {
            url,
            _folder: folder,
        }
    }

    fn database(&self) -> DatabasePlace {
        match self.url.strip_prefix("sqlite://") {
            Some(path) => DatabasePlace::File(path.into()),
            None => DatabasePlace::Postgres(Box::new(self.url.parse().unwrap())),
        }
    }
}

/// What the server answered.
pub struct Answer {
    pub status: StatusCode,
    pub headers: HeaderMap,
    pub text: String,
}

impl Answer {
    /// The body as JSON.
    #[track_caller]
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.text).unwrap_or_else(|error| panic!("{error}: {}", self.text))
    }

    /// A header as text, empty when absent.
    pub fn header(&self, name: &str) -> &str {
        let value = self.headers.get(name);
        value.map_or("", |value| value.to_str().unwrap())
    }

    /// The answer, which has this status.
    #[track_caller]
    pub fn expect(self, status: u16) -> Self {
        assert_eq!(self.status, status, "{}", self.text);
        self
    }

    /// The problem document, which has this status and the shape that every problem has.
    #[track_caller]
    pub fn problem(self, status: u16) -> Value {
        let answer = self.expect(status);
        assert_eq!(answer.header("content-type"), "application/problem+json");
        let problem = answer.json();
        assert_eq!(problem["status"], status);
        assert_eq!(problem["request_id"], answer.header("x-request-id"));
        for field in ["type", "title", "detail", "instance"] {
            assert!(
                problem[field].as_str().is_some_and(|text| !text.is_empty()),
                "{field}"
            );
        }
        assert!(problem["errors"].is_array());
        problem
    }
}

impl TestApp {
    /// A server with an empty database that takes bodies of a MiB.
    pub async fn start() -> Self {
        Self::taking_mib(1).await
    }

    /// A server with an empty database that takes bodies of so many MiB.
    pub async fn taking_mib(max_body_mib: u16) -> Self {
        Self::with(|settings| settings.max_body_mib = max_body_mib).await
    }

    /// A server with an empty database and other settings.
    pub async fn with(change: impl FnOnce(&mut Settings)) -> Self {
        Self::at(Home::new(), change).await
    }

    /// A server that asks for tokens, and the secrets of some: name, scope and project of each.
    pub async fn with_tokens<const N: usize>(
        tokens: [(&str, Scope, &str); N],
        change: impl FnOnce(&mut Settings),
    ) -> (Self, [String; N]) {
        let home = Home::new();
        let mut secrets = Vec::new();
        for (name, scope, project) in tokens {
            let expires_at = None;
            secrets.push(make_token(&home, (name, scope, project), expires_at).await);
        }
        let app = Self::at(home, change).await;
        (app, secrets.try_into().unwrap())
    }

    /// A server on a database file that was written elsewhere.
    pub async fn on_file(database: &[u8]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("greybox.db");
        std::fs::write(&path, database).unwrap();
        let home = Home {
            url: format!("sqlite://{}", path.display()),
            _folder: folder,
        };
        Self::at(home, |_settings| ()).await
    }

    async fn at(home: Home, change: impl FnOnce(&mut Settings)) -> Self {
        let mut settings = Settings {
            listen: (Ipv4Addr::LOCALHOST, 0).into(),
            database: DatabaseArguments::of(&home.url),
            max_body_mib: 1,
            ..Settings::default()
        };
        change(&mut settings);
        Self {
            app: App::start(settings).await.unwrap(),
            client: client(),
            home,
        }
    }

    /// Makes one more token and answers its secret.
    pub async fn token(&self, token: (&str, Scope, &str), expires_at: Option<Timestamp>) -> String {
        make_token(&self.home, token, expires_at).await
    }

    /// Makes one more token, which appends to a stream of the project `default`, and answers its secret.
    pub async fn append_token(&self, name: &str, stream: &str) -> String {
        let secret = Secret::new().unwrap();
        let new = NewToken {
            streams: Some(stream.parse().unwrap()),
            ..new_token(&secret, (name, Scope::Append, "default"))
        };
        assert!(tokens::create(&self.database(), new).await.unwrap());
        secret.expose().to_owned()
    }

    /// Where its database is.
    pub fn database(&self) -> DatabasePlace {
        self.home.database()
    }

    /// Where the server listens.
    pub fn address(&self) -> std::net::SocketAddr {
        self.app.local_addr()
    }

    /// A request to the server.
    pub fn request(&self, method: Method, path: &str) -> RequestBuilder {
        let url = format!("http://{}{path}", self.app.local_addr());
        self.client.request(method, url)
    }

    /// Sends a request and reads the whole answer.
    pub async fn send(&self, request: RequestBuilder) -> Answer {
        let response = request.send().await.unwrap();
        Answer {
            status: response.status(),
            headers: response.headers().clone(),
            text: response.text().await.unwrap(),
        }
    }

    pub async fn get(&self, path: &str) -> Answer {
        self.send(self.request(Method::GET, path)).await
    }

    pub async fn post(&self, path: &str) -> Answer {
        self.send(self.request(Method::POST, path)).await
    }

    pub async fn delete(&self, path: &str) -> Answer {
        self.send(self.request(Method::DELETE, path)).await
    }

    pub async fn post_json(&self, path: &str, body: &Value) -> Answer {
        self.send(self.request(Method::POST, path).json(body)).await
    }

    pub async fn post_csv(&self, path: &str, body: impl Into<reqwest::Body>) -> Answer {
        let request = self.request(Method::POST, path).body(body);
        self.send(request.header("content-type", "text/csv")).await
    }

    pub async fn post_yaml(&self, path: &str, body: impl Into<reqwest::Body>) -> Answer {
        let request = self.request(Method::POST, path).body(body);
        self.send(request.header("content-type", "application/yaml"))
            .await
    }

    /// Stores the recording of a drive and answers its identifier.
    pub async fn store_drive(&self) -> String {
        let stored = self.post_csv("/v1/datasets", drive_csv()).await;
        stored.json()["id"]
            .as_str()
            .expect("an identifier")
            .to_owned()
    }

    /// Submits a job and answers its identifier.
    pub async fn submit(&self, job: &Value) -> String {
        let accepted = self.post_json("/v1/jobs", job).await.expect(202);
        accepted.json()["id"].as_str().unwrap().to_owned()
    }

    /// The job after it came to its end.
    pub async fn ended(&self, id: &str) -> Value {
        for _ in 0..20 {
            let job = self
                .get(&format!("/v1/jobs/{id}?wait=30"))
                .await
                .expect(200)
                .json();
            let status = job["status"].as_str().unwrap();
            if ["succeeded", "failed", "cancelled"].contains(&status) {
                return job;
            }
        }
        panic!("the job did not end");
    }

    /// The server after it was stopped and started again.
    pub async fn restarted(self) -> Self {
        self.restarted_with(|_settings| ()).await
    }

    /// The server after it was stopped and started again with other settings.
    pub async fn restarted_with(self, change: impl FnOnce(&mut Settings)) -> Self {
        self.app.shutdown().await;
        Self::at(self.home, change).await
    }

    /// Stops the server in order.
    pub async fn shutdown(self) {
        self.app.shutdown().await;
    }
}

/// A client that shows redirects and does not follow them.
fn client() -> reqwest::Client {
    let client = reqwest::Client::builder().redirect(reqwest::redirect::Policy::none());
    client.build().unwrap()
}

/// A token that does not end: its name, scope and project.
fn new_token(secret: &Secret, (name, scope, project): (&str, Scope, &str)) -> NewToken {
    NewToken {
        name: name.to_owned(),
        digest: secret.digest(),
        scope,
        streams: None,
        project: project.parse().unwrap(),
        expires_at: None,
    }
}

async fn make_token(
    home: &Home,
    token: (&str, Scope, &str),
    expires_at: Option<Timestamp>,
) -> String {
    let secret = Secret::new().unwrap();
    let new = NewToken {
        expires_at,
        ..new_token(&secret, token)
    };
    assert!(tokens::create(&home.database(), new).await.unwrap());
    secret.expose().to_owned()
}

/// A drive of 100 kg with 200 N·s/m of friction, pushed by ±50 N that turn every half second:
/// 4 s at 100 Hz, integrated exactly between the samples.
pub fn drive_csv() -> String {
    const MASS: f64 = 100.0;
    const FRICTION: f64 = 200.0;
    const SAMPLE_TIME: f64 = 0.01;
    let decay = (-FRICTION / MASS * SAMPLE_TIME).exp();
    let (mut position, mut velocity) = (0.0, 0.0);
    let mut text = String::from("time [s],force [N],position [m]\n");
    for k in 0..400 {
        let force = if (k / 50) % 2 == 0 { 50.0 } else { -50.0 };
        let time = f64::from(k) * SAMPLE_TIME;
        text += &format!("{time:.2},{force},{position}\n");
        let terminal = force / FRICTION;
        position +=
            terminal * SAMPLE_TIME + (velocity - terminal) * (1.0 - decay) * MASS / FRICTION;
        velocity = terminal + (velocity - terminal) * decay;
    }
    text
}

/// A small job on the recording of [`drive_csv`].
pub fn drive_job(dataset: &str) -> Value {
    json!({
        "model": "positioning_drive",
        "experiments": [{"dataset": dataset, "initial_state": {"position": 0, "velocity": 0}}],
        "parameters": {
            "mass": {"estimate": {"lower": 10, "upper": 1000}},
            "viscous_friction": {"estimate": {"lower": 1, "upper": 2000}},
            "coulomb_friction": {"value": 0},
            "offset": {"value": 0}
        },
        "method": {"population": 10, "generations": 5},
        "seed": 1
    })
}

/// A job that works until it is stopped.
pub fn endless_job(dataset: &str) -> Value {
    let mut job = drive_job(dataset);
    job["method"] = json!({"population": 10, "generations": 1_000_000,
                           "stagnation_generations": 0, "hill_climbing_interval": 0});
    job
}
