//! Who may ask what: tokens, scopes, projects, people behind a proxy, and the log of it.

use greybox_service::access::Scope;
use greybox_service::app::App;
use greybox_service::config::{DatabaseArguments, Settings};
use greybox_service::store::tokens;
use jiff::{SignedDuration, Timestamp};
use reqwest::{Method, RequestBuilder};
use serde_json::Value;

use crate::app::{Answer, TestApp, drive_csv, drive_job, endless_job};
use crate::events::Stream;
use crate::monitors::{Plant, monitor};

/// A caller with a token.
struct Caller<'a> {
    app: &'a TestApp,
    secret: &'a str,
}

impl Caller<'_> {
    fn request(&self, method: Method, path: &str) -> RequestBuilder {
        self.app.request(method, path).bearer_auth(self.secret)
    }

    async fn get(&self, path: &str) -> Answer {
        self.app.send(self.request(Method::GET, path)).await
    }

    async fn delete(&self, path: &str) -> Answer {
        self.app.send(self.request(Method::DELETE, path)).await
    }

    async fn post(&self, path: &str, body: &Value) -> Answer {
        let request = self.request(Method::POST, path).json(body);
        self.app.send(request).await
    }

    async fn store_drive(&self) -> Answer {
        let request = self.request(Method::POST, "/v1/datasets");
        let request = request.header("content-type", "text/csv").body(drive_csv());
        self.app.send(request).await
    }
}

fn text(value: &Value) -> String {
    value.as_str().expect("a text").to_owned()
}

#[tokio::test(flavor = "multi_thread")]
async fn who_brings_no_token_that_counts_is_refused_and_written_down() {
    let (app, [admin]) =
        TestApp::with_tokens([("it", Scope::Admin, "default")], |_settings| ()).await;
    let hour = SignedDuration::from_hours(1);
    let expired = app.token(
        ("old", Scope::Admin, "default"),
        Some(Timestamp::now() - hour),
    );
    let expired = expired.await;
    let revoked = app.token(("lost", Scope::Admin, "default"), None).await;
    assert!(tokens::revoke(&app.database(), "lost").await.unwrap());
    let guessed = format!("gbx_{}", "0".repeat(64));
    let get = || app.request(Method::GET, "/v1/jobs");
    let attempts = [
        get(),
        get().bearer_auth(&expired),
        get().bearer_auth(&revoked),
        get().bearer_auth(&guessed),
        get().bearer_auth("x"),
        get().basic_auth("it", Some(&admin)),
    ];
    let n_attempts = attempts.len();
    for attempt in attempts {
        let answer = app.send(attempt).await;
        assert!(answer.header("www-authenticate").starts_with("Bearer"));
        let problem = answer.problem(401);
        assert_eq!(problem["type"], "/problems/unauthorised");
    }
    // What shows nothing of anybody is for all.
    for path in ["/livez", "/readyz", "/version", "/openapi.json", "/"] {
        app.get(path).await.expect(200);
    }
    app.get("/metrics").await.problem(401);
    let it = Caller {
        app: &app,
        secret: &admin,
    };
    it.get("/metrics").await.expect(200);
    let log = it.get("/v1/audit").await.expect(200).json();
    let refused = log["items"].as_array().unwrap().iter();
    let refused: Vec<&Value> = refused.filter(|entry| entry["status"] == 401).collect();
    assert_eq!(refused.len(), n_attempts + 1);
    // A token that has ended is named; who brings nothing is unknown.
    let of = |who: &str| refused.iter().filter(|entry| entry["who"] == who).count();
    let named = ["token old", "token lost", "unknown"].map(of);
    assert_eq!(named, [1, 1, n_attempts - 1]);
    let log = it
        .request(Method::GET, "/v1/audit")
        .header("accept", "text/csv");
    let log = app.send(log).await.expect(200);
    assert!(
        log.text
            .starts_with("id,at,who,project,address,method,path,status")
    );
    assert!(!log.text.contains(&guessed));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_scope_is_what_it_allows() {
    let tokens = [
        ("screen", Scope::Read, "default"),
        ("mes", Scope::Submit, "default"),
        ("it", Scope::Admin, "default"),
    ];
    let (app, [read, submit, admin]) = TestApp::with_tokens(tokens, |_settings| ()).await;
    let [screen, mes, it] = [&read, &submit, &admin].map(|secret| Caller { app: &app, secret });
    let problem = screen.store_drive().await.problem(403);
    assert_eq!(problem["type"], "/problems/forbidden");
    let dataset = text(&mes.store_drive().await.expect(201).json()["id"]);
    screen
        .get(&format!("/v1/datasets/{dataset}"))
        .await
        .expect(200);
    screen
        .delete(&format!("/v1/datasets/{dataset}"))
        .await
        .problem(403);
    mes.get("/v1/audit").await.problem(403);
    mes.delete(&format!("/v1/datasets/{dataset}"))
        .await
        .expect(204);
    let log = it.get("/v1/audit?limit=500").await.expect(200).json();
    let told: Vec<(String, String, u64)> = log["items"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|entry| entry["method"] != "COMMAND")
        .map(|entry| {
            let status = entry["status"].as_u64().unwrap();
            (text(&entry["who"]), text(&entry["method"]), status)
        })
        .collect();
    let expected = [
        ("token mes", "DELETE", 204),
        ("token mes", "GET", 403),
        ("token screen", "DELETE", 403),
        ("token mes", "POST", 201),
        ("token screen", "POST", 403),
    ];
    let expected =
        expected.map(|(who, method, status)| (who.to_owned(), method.to_owned(), status));
    assert_eq!(told, expected);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_project_sees_nothing_of_another() {
    let tokens = [("a", Scope::Admin, "hall-a"), ("b", Scope::Admin, "hall-b")];
    let (app, [a, b]) = TestApp::with_tokens(tokens, |_settings| ()).await;
    let [a, b] = [&a, &b].map(|secret| Caller { app: &app, secret });
    let dataset = text(&a.store_drive().await.expect(201).json()["id"]);
    let key = |caller: &Caller<'_>, job: &Value| {
        let request = caller.request(Method::POST, "/v1/jobs").json(job);
        request.header("idempotency-key", "run-1")
    };
    let job = app.send(key(&a, &drive_job(&dataset))).await.expect(202);
    let job = text(&job.json()["id"]);
    let model = serde_json::json!({
        "name": "lag",
        "inputs": {"u": {"unit": "V"}},
        "parameters": {"time": {"symbol": "T", "unit": "s", "default": 1, "lower": 0.1,
                                "upper": 10, "scale": "log", "unknown": true}},
        "states": {"y": {"unit": "V", "derivative": "(u - y)/T", "initial": 0}},
        "outputs": {"y_measured": {"unit": "V", "expression": "y"}}
    });
    let model_name = text(&a.post("/v1/models", &model).await.expect(201).json()["name"]);

    for path in [
        format!("/v1/datasets/{dataset}"),
        format!("/v1/datasets/{dataset}/samples"),
        format!("/v1/jobs/{job}"),
        format!("/v1/jobs/{job}/events"),
        format!("/v1/jobs/{job}/result"),
        format!("/v1/jobs/{job}/trajectory"),
    ] {
        let problem = b.get(&path).await.problem(403);
        assert_eq!(problem["type"], "/problems/forbidden", "{path}");
    }
    for path in ["/v1/jobs", "/v1/datasets", "/v1/comparisons", "/v1/audit"] {
        let listed = b.get(path).await.expect(200).json();
        let foreign = listed["items"].as_array().unwrap().iter();
        let foreign = foreign.filter(|item| item["project"] != "hall-b");
        assert_eq!(foreign.count(), 0, "{path}: {listed}");
    }
    b.post(&format!("/v1/jobs/{job}/cancel"), &Value::Null)
        .await
        .problem(403);
    b.delete(&format!("/v1/jobs/{job}")).await.problem(403);
    b.get(&format!("/v1/models/{model_name}"))
        .await
        .problem(404);
    b.delete(&format!("/v1/models/{model_name}"))
        .await
        .problem(404);
    let problem = b.post("/v1/jobs", &drive_job(&dataset)).await.problem(422);
    assert_eq!(problem["errors"][0]["code"], "unknown_dataset");
    let simulation = serde_json::json!({"model": "positioning_drive", "dataset": dataset});
    b.post("/v1/simulations", &simulation).await.problem(422);

    // What is the same is another thing in another project.
    let own = text(&b.store_drive().await.expect(201).json()["id"]);
    assert_ne!(own, dataset);
    let own_job = app.send(key(&b, &drive_job(&own))).await.expect(202);
    assert_eq!(own_job.header("idempotent-replayed"), "");
    assert_ne!(text(&own_job.json()["id"]), job);
    b.post("/v1/models", &model).await.expect(201);
    a.get(&format!("/v1/jobs/{job}?wait=0")).await.expect(200);
    b.delete(&format!("/v1/models/{model_name}"))
        .await
        .expect(204);
    a.get(&format!("/v1/models/{model_name}")).await.expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_watched_belongs_to_its_project() {
    let tokens = [
        ("a", Scope::Submit, "default"),
        ("b", Scope::Submit, "hall-b"),
    ];
    let often = |settings: &mut Settings| settings.requests_per_second = 1e6;
    let (app, [a, b]) = TestApp::with_tokens(tokens, often).await;
    let [a, b] = [&a, &b].map(|secret| Caller { app: &app, secret });
    let mut plant = Plant::new();
    let window = plant.window(0, 1.0, 1.0);
    // One name is two streams.
    a.post("/v1/streams/lag", &window).await.expect(201);
    a.get("/v1/streams/lag").await.expect(200);
    b.get("/v1/streams/lag").await.problem(404);
    let problem = b.post("/v1/monitors", &monitor()).await.problem(422);
    assert_eq!(problem["errors"][0]["code"], "unknown_stream");
    b.post("/v1/streams/lag", &window).await.expect(201);
    b.post("/v1/streams/lag", &plant.window(1, 1.0, 1.0))
        .await
        .expect(200);
    let shown = b.get("/v1/streams/lag").await.expect(200).json();
    let (name, samples) = (&shown["name"], &shown["samples"]);
    assert_eq!((name, samples), (&"lag".into(), &400.into()));
    let other = a.get("/v1/streams/lag").await.expect(200).json();
    assert_eq!(other["samples"], 200);

    let made = b.post("/v1/monitors", &monitor()).await.expect(201).json();
    assert_eq!(made["stream"], "lag");
    let path = format!("/v1/monitors/{}", text(&made["id"]));
    for path in [
        path.clone(),
        format!("{path}/windows"),
        format!("{path}/alarms"),
        format!("{path}/events"),
    ] {
        a.get(&path).await.problem(403);
    }
    a.delete(&path).await.problem(403);
    let none = a.get("/v1/monitors").await.expect(200).json();
    assert_eq!(none["items"].as_array().unwrap().len(), 0);
    let own = b.get("/v1/monitors").await.expect(200).json();
    assert_eq!(own["items"].as_array().unwrap().len(), 1);

    // The job of its first window and its recording are of the same project.
    let job = loop {
        let windows = b.get(&format!("{path}/windows")).await.expect(200).json();
        let last = windows["items"].as_array().unwrap().last().cloned();
        match last.filter(|window| window["job"].is_string()) {
            Some(window) => break text(&window["job"]),
            None => tokio::task::yield_now().await,
        }
    };
    let shown = b.get(&format!("/v1/jobs/{job}")).await.expect(200).json();
    let dataset = text(&shown["spec"]["experiments"][0]["dataset"]);
    a.get(&format!("/v1/jobs/{job}")).await.problem(403);
    a.get(&format!("/v1/datasets/{dataset}")).await.problem(403);
    b.get(&format!("/v1/datasets/{dataset}")).await.expect(200);

    a.delete("/v1/streams/lag").await.expect(204);
    b.get("/v1/streams/lag").await.expect(200);
    b.delete("/v1/streams/lag").await.problem(409);
    b.delete(&path).await.expect(204);
    b.delete("/v1/streams/lag").await.expect(204);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_proxy_that_is_trusted_says_who_a_person_is() {
    let set = |settings: &mut Settings, proxy: &str| {
        settings.trusted_proxies = vec![proxy.to_owned()];
        settings.roles = vec!["operators=submit:hall-a".parse().unwrap()];
    };
    let person = |app: &TestApp, groups: &str| {
        let request = app.request(Method::GET, "/v1/jobs");
        let request = request.header("x-forwarded-user", "alice");
        request.header("x-forwarded-groups", groups)
    };
    let app = TestApp::with(|settings| set(settings, "127.0.0.1")).await;
    app.send(person(&app, "staff, operators")).await.expect(200);
    app.send(person(&app, "staff")).await.problem(403);
    app.get("/v1/jobs").await.problem(401);
    let twice = person(&app, "operators").header("x-forwarded-user", "bob");
    app.send(twice).await.problem(401);
    app.shutdown().await;

    let app = TestApp::with(|settings| set(settings, "10.0.0.0/8")).await;
    app.send(person(&app, "operators")).await.problem(401);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_ends_with_the_token_that_it_was_opened_with() {
    let tokens = [
        ("mes", Scope::Submit, "default"),
        ("screen", Scope::Read, "default"),
    ];
    let (app, [mes, screen]) = TestApp::with_tokens(tokens, |_settings| ()).await;
    let [mes, screen] = [&mes, &screen].map(|secret| Caller { app: &app, secret });
    let dataset = text(&mes.store_drive().await.expect(201).json()["id"]);
    let job = mes
        .post("/v1/jobs", &endless_job(&dataset))
        .await
        .expect(202);
    let job = text(&job.json()["id"]);
    let events = format!("/v1/jobs/{job}/events");
    let ends = Stream::of(screen.request(Method::GET, &events)).await;
    let mut goes_on = Stream::of(mes.request(Method::GET, &events)).await;
    assert!(tokens::revoke(&app.database(), "screen").await.unwrap());
    let seen = ends.rest().await;
    assert!(seen.iter().all(|event| event.name != "end"));
    let last = seen.last().map_or(0, |event| event.id);
    while goes_on.next().await.expect("the job goes on").id <= last {}
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_first_token_closes_a_server_and_its_end_does_not_open_it() {
    let app = TestApp::start().await;
    app.get("/v1/jobs").await.expect(200);
    let secret = app.token(("mes", Scope::Read, "default"), None).await;
    let with_token = || app.request(Method::GET, "/v1/jobs").bearer_auth(&secret);
    // What the database says is believed for a second.
    while app.get("/v1/jobs").await.status == 200 {}
    app.send(with_token()).await.expect(200);
    assert!(tokens::revoke(&app.database(), "mes").await.unwrap());
    app.send(with_token()).await.problem(401);
    app.get("/v1/jobs").await.problem(401);
}

#[tokio::test]
async fn a_server_that_others_would_reach_without_a_token_does_not_start() {
    let folder = tempfile::tempdir().unwrap();
    let settings = Settings {
        listen: "0.0.0.0:0".parse().unwrap(),
        database: DatabaseArguments::of(format!(
            "sqlite://{}",
            folder.path().join("a.db").display()
        )),
        ..Settings::default()
    };
    let refused = App::start(settings).await.err().expect("a refusal");
    let told = refused.to_string();
    assert!(told.contains("greybox token create"), "{told}");
    assert!(told.contains("127.0.0.1"), "{told}");
}
