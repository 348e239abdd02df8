//! Sessions of people at the page: a token becomes a cookie, which other sites cannot use.

use greybox_service::access::Scope;
use greybox_service::config::Settings;
use greybox_service::store::tokens;
use reqwest::{Method, RequestBuilder};
use serde_json::{Value, json};

use crate::app::{Answer, TestApp, drive_csv};

/// A session as a browser has it.
struct Browser {
    cookie: String,
    csrf_token: String,
}

async fn sign_in(app: &TestApp, token: &str) -> Answer {
    app.post_json("/v1/session", &json!({"token": token})).await
}

impl Browser {
    async fn signed_in(app: &TestApp, token: &str) -> Self {
        let answer = sign_in(app, token).await.expect(200);
        let cookie = answer.header("set-cookie").split(';').next();
        Self {
            cookie: cookie.expect("a cookie").to_owned(),
            csrf_token: answer.json()["csrf_token"].as_str().unwrap().to_owned(),
        }
    }

    /// What any page can make a browser ask.
    fn asks(&self, app: &TestApp, method: Method, path: &str) -> RequestBuilder {
        app.request(method, path).header("cookie", &self.cookie)
    }

    /// What only a page of the server can.
    fn changes(&self, app: &TestApp, method: Method, path: &str) -> RequestBuilder {
        let request = self.asks(app, method, path);
        request.header("x-csrf-token", &self.csrf_token)
    }

    async fn get(&self, app: &TestApp, path: &str) -> Answer {
        app.send(self.asks(app, Method::GET, path)).await
    }
}

fn with_drive(request: RequestBuilder) -> RequestBuilder {
    let request = request.header("content-type", "text/csv");
    request.body(drive_csv())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_may_do_what_its_token_may_also_after_a_restart() {
    let (app, [operator]) =
        TestApp::with_tokens([("op", Scope::Submit, "hall-2")], |_settings| ()).await;
    app.get("/v1/session").await.problem(401);
    let answer = sign_in(&app, &operator).await.expect(200);
    let cookie = answer.header("set-cookie").to_owned();
    for part in ["HttpOnly", "SameSite=Strict", "Path=/", "Max-Age=43200"] {
        assert!(cookie.contains(part), "{cookie}");
    }
    assert!(!cookie.contains("Secure"), "{cookie}");
    assert!(!cookie.contains(&operator[4..]), "{cookie}");
    assert_eq!(answer.header("cache-control"), "no-store");

    let browser = Browser::signed_in(&app, &operator).await;
    let app = app.restarted().await;
    let shown = browser.get(&app, "/v1/session").await.expect(200).json();
    assert_eq!(shown["who"], "token op");
    assert_eq!(shown["project"], "hall-2");
    assert_eq!(shown["scope"], "submit");
    assert_eq!(shown["csrf_token"], json!(browser.csrf_token));
    let store = browser.changes(&app, Method::POST, "/v1/datasets");
    let stored = app.send(with_drive(store)).await.expect(201).json();
    let path = format!("/v1/datasets/{}", stored["id"].as_str().unwrap());
    browser.get(&app, &path).await.expect(200);
    browser.get(&app, "/v1/audit").await.problem(403);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_another_site_has_a_browser_ask_changes_nothing_and_is_written_down() {
    let tokens = [
        ("op", Scope::Submit, "default"),
        ("it", Scope::Admin, "default"),
    ];
    let (app, [operator, admin]) = TestApp::with_tokens(tokens, |_settings| ()).await;
    let browser = Browser::signed_in(&app, &operator).await;
    let other = Browser::signed_in(&app, &operator).await;
    let store = || browser.asks(&app, Method::POST, "/v1/datasets");
    let forged = [
        store(),
        store().header("x-csrf-token", ""),
        store().header("x-csrf-token", &other.csrf_token),
        browser
            .changes(&app, Method::POST, "/v1/datasets")
            .header("origin", "http://attacker.example"),
        browser.asks(&app, Method::DELETE, "/v1/session"),
    ];
    let n_forged = forged.len();
    for request in forged {
        app.send(with_drive(request)).await.problem(403);
    }
    // A page of another site cannot sign its reader in either.
    let foreign = app.request(Method::POST, "/v1/session");
    let foreign = foreign.header("origin", "http://attacker.example");
    app.send(foreign.json(&json!({"token": operator})))
        .await
        .problem(403);
    let as_text = app.request(Method::POST, "/v1/session");
    let as_text = as_text.header("content-type", "text/plain");
    app.send(as_text.body(json!({"token": operator}).to_string()))
        .await
        .problem(415);
    let audit = app.request(Method::GET, "/v1/audit").bearer_auth(&admin);
    let audit = app.send(audit).await.expect(200).json();
    let refused = audit["items"].as_array().unwrap().iter();
    let refused = refused.filter(|entry| entry["status"] == 403).count();
    assert_eq!(refused, n_forged + 1);
    browser.get(&app, "/v1/jobs").await.expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_ends_by_signing_out_and_with_its_token() {
    let often = |settings: &mut Settings| settings.requests_per_second = 1e6;
    let tokens = [("op", Scope::Read, "default")];
    let (app, [operator]) = TestApp::with_tokens(tokens, often).await;
    let browser = Browser::signed_in(&app, &operator).await;
    let other = Browser::signed_in(&app, &operator).await;
    let out = browser.changes(&app, Method::DELETE, "/v1/session");
    let out = app.send(out).await.expect(204);
    assert!(out.header("set-cookie").contains("Max-Age=0"));
    browser.get(&app, "/v1/jobs").await.problem(401);
    other.get(&app, "/v1/jobs").await.expect(200);
    // The cookie is no token, and the token no cookie.
    let secret = other.cookie.split_once('=').unwrap().1;
    let bearer = app.request(Method::GET, "/v1/jobs").bearer_auth(secret);
    app.send(bearer).await.problem(401);
    let token = app.request(Method::GET, "/v1/jobs");
    let token = token.header("cookie", format!("greybox_session={operator}"));
    app.send(token).await.problem(401);
    let own = app.request(Method::DELETE, "/v1/session");
    app.send(own.bearer_auth(&operator)).await.problem(409);
    assert!(tokens::revoke(&app.database(), "op").await.unwrap());
    other.get(&app, "/v1/jobs").await.problem(401);
    sign_in(&app, &operator).await.problem(401);
}

#[tokio::test(flavor = "multi_thread")]
async fn guesses_are_counted_and_written_down() {
    let (app, [admin]) =
        TestApp::with_tokens([("it", Scope::Admin, "default")], |_settings| ()).await;
    let guess = format!("gbx_{}", "0".repeat(64));
    let mut refused = 0;
    let problem = loop {
        let answer = sign_in(&app, &guess).await;
        refused += 1;
        if answer.status != 401 {
            assert!(answer.header("retry-after").parse::<u32>().unwrap() >= 1);
            break answer.problem(429);
        }
        // The eleventh comes too soon; a slow machine may let one more through.
        assert!(refused < 60, "guesses are not counted");
    };
    assert_eq!(problem["type"], "/problems/too-many-requests");
    sign_in(&app, &admin).await.problem(429);
    let audit = app.request(Method::GET, "/v1/audit").bearer_auth(&admin);
    let audit = app.send(audit).await.expect(200).json();
    let entries = audit["items"].as_array().unwrap();
    let of_sign_in = |entry: &&Value| entry["path"] == "/v1/session" && entry["who"] == "unknown";
    assert_eq!(entries.iter().filter(of_sign_in).count(), refused + 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_asks_nobody_says_so() {
    let app = TestApp::start().await;
    let shown = app.get("/v1/session").await.expect(200).json();
    assert_eq!(shown["who"], "local");
    assert_eq!(shown["csrf_token"], Value::Null);
    app.delete("/v1/session").await.problem(409);
    sign_in(&app, "x").await.problem(401);
    app.post_json("/v1/session", &json!({"tokens": 1}))
        .await
        .problem(422);
}
