//! Signing in at an identity provider: who comes back from there has a session, and nobody else has.

mod provider;

use greybox_service::access::Scope;
use greybox_service::config::Settings;
use reqwest::{Method, RequestBuilder};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::app::{Answer, TestApp};
use provider::{CLIENT, Provider, SECRET};

/// A provider, and what a server has to be told of it.
struct Plant {
    provider: Provider,
    folder: TempDir,
}

impl Plant {
    async fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("secret"), format!("{SECRET}\n")).unwrap();
        Self {
            provider: Provider::start().await,
            folder,
        }
    }

    fn settings(&self, settings: &mut Settings) {
        settings.oidc.oidc_issuer = Some(self.provider.issuer.clone());
        settings.oidc.oidc_client_id = Some(CLIENT.to_owned());
        settings.oidc.oidc_client_secret_file = Some(self.folder.path().join("secret"));
        settings.oidc.public_url = Some("https://greybox.plant.example".to_owned());
        settings.roles = vec!["operators=submit:hall-2".parse().unwrap()];
        settings.requests_per_second = 1e6;
    }

    async fn server(&self) -> TestApp {
        TestApp::with(|settings| self.settings(settings)).await
    }

    /// What a browser comes back with that goes to the provider, where a person signs in.
    async fn signed_in(&self, app: &TestApp, claims: &Value) -> Back {
        let left = app.get("/v1/session/provider").await.expect(303);
        Back {
            path: self.provider.sign_in(left.header("location"), claims),
            cookie: cookie_of(&left, "greybox_sign_in"),
        }
    }
}

/// The way back from the provider.
struct Back {
    path: String,
    cookie: String,
}

impl Back {
    async fn arrives(&self, app: &TestApp) -> Answer {
        app.send(with_cookie(app, Method::GET, &self.path, &self.cookie))
            .await
    }
}

fn with_cookie(app: &TestApp, method: Method, path: &str, cookie: &str) -> RequestBuilder {
    app.request(method, path).header("cookie", cookie)
}

/// The cookie of a name that an answer has a browser keep, as the browser sends it.
#[track_caller]
fn cookie_of(answer: &Answer, name: &str) -> String {
    let cookies = answer.headers.get_all("set-cookie").iter();
    let mut cookies = cookies.map(|cookie| cookie.to_str().unwrap());
    let cookie = cookies.find(|cookie| cookie.starts_with(&format!("{name}=gbx_")));
    let cookie = cookie.unwrap_or_else(|| panic!("no cookie {name}"));
    for part in ["HttpOnly", "Secure"] {
        assert!(cookie.contains(part), "{cookie}");
    }
    cookie.split(';').next().unwrap().to_owned()
}

fn ada() -> Value {
    json!({"preferred_username": "ada", "groups": ["fitters", "operators"]})
}

async fn shown(app: &TestApp, cookie: &str) -> Answer {
    app.send(with_cookie(app, Method::GET, "/v1/session", cookie))
        .await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_person_who_signs_in_may_do_what_a_group_may_also_after_a_restart() {
    let plant = Plant::new().await;
    let app = plant.server().await;
    let refused = app.get("/v1/session").await;
    let way_in = refused.header("link").to_owned();
    assert_eq!(way_in, "</v1/session/provider>; rel=\"sign-in\"");
    refused.problem(401);

    let back = plant.signed_in(&app, &ada()).await;
    let arrived = back.arrives(&app).await.expect(303);
    assert_eq!(arrived.header("location"), "/");
    let cookie = cookie_of(&arrived, "greybox_session");
    let session = shown(&app, &cookie).await.expect(200).json();
    assert_eq!(session["who"], "person ada");
    assert_eq!(session["project"], "hall-2");
    assert_eq!(session["scope"], "submit");
    // A session's cookie alone changes nothing.
    let submit = || with_cookie(&app, Method::DELETE, "/v1/session", &cookie);
    app.send(submit()).await.problem(403);
    // Who comes a second time with the same code has nothing.
    back.arrives(&app).await.problem(502);

    let app = app
        .restarted_with(|settings| plant.settings(settings))
        .await;
    shown(&app, &cookie).await.expect(200);
    let csrf_token = session["csrf_token"].as_str().unwrap();
    let out = with_cookie(&app, Method::DELETE, "/v1/session", &cookie);
    app.send(out.header("x-csrf-token", csrf_token))
        .await
        .expect(204);
    shown(&app, &cookie).await.problem(401);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_role_that_is_taken_away_is_gone_for_sessions_too() {
    let plant = Plant::new().await;
    let app = plant.server().await;
    let arrived = plant.signed_in(&app, &ada()).await.arrives(&app).await;
    let cookie = cookie_of(&arrived, "greybox_session");
    let app = app
        .restarted_with(|settings| {
            plant.settings(settings);
            settings.roles = vec!["fitters=read:hall-3".parse().unwrap()];
        })
        .await;
    let session = shown(&app, &cookie).await.expect(200).json();
    assert_eq!(
        (&session["scope"], &session["project"]),
        (&json!("read"), &json!("hall-3"))
    );
    let app = app
        .restarted_with(|settings| {
            plant.settings(settings);
            settings.roles.clear();
        })
        .await;
    shown(&app, &cookie).await.problem(403);
    // A server that knows no provider any more knows none of its people.
    app.token(("op", Scope::Read, "default"), None).await;
    let app = app.restarted().await;
    shown(&app, &cookie).await.problem(401);
    app.get("/v1/session/provider").await.problem(404);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_way_back_belongs_to_one_attempt_of_one_browser() {
    let plant = Plant::new().await;
    let app = plant.server().await;
    let mine = plant.signed_in(&app, &ada()).await;
    let theirs = plant.signed_in(&app, &ada()).await;
    let session = mine.cookie.replace("greybox_sign_in", "greybox_session");
    let (with_code, rest) = mine.path.split_once("&state=").unwrap();
    let (_, state_and_issuer) = rest.split_once('&').unwrap();
    let no_state = format!("{with_code}&{state_and_issuer}");
    let another_issuer = mine
        .path
        .replace("plant&", "mine&")
        .replace("%2Fplant", "%2Fmine");
    let denied = mine.path.replace(
        "code=",
        "error=access_denied&error_description=No%3Cb%3E&x=",
    );
    let no_code = mine.path.replace("code=", "x=");
    for (path, cookie) in [
        // A stranger's link that signs its reader in as the stranger.
        (&mine.path, &theirs.cookie),
        (&theirs.path, &mine.cookie),
        (&mine.path, &session),
        (&no_state, &mine.cookie),
        (&another_issuer, &mine.cookie),
        (&denied, &mine.cookie),
        (&no_code, &mine.cookie),
    ] {
        let arrived = app.send(with_cookie(&app, Method::GET, path, cookie)).await;
        assert!(arrived.headers.get("set-cookie").is_none(), "{path}");
        arrived.problem(403);
    }
    app.get(&mine.path).await.problem(403);
    assert_eq!(plant.provider.codes_brought(), 0);
    let browser = with_cookie(&app, Method::GET, &denied, &mine.cookie);
    let page = app.send(browser.header("accept", "text/html")).await;
    assert_eq!(page.header("content-type"), "text/html; charset=utf-8");
    assert!(
        page.text.contains("access_denied: No&lt;b&gt;"),
        "{}",
        page.text
    );
    mine.arrives(&app).await.expect(303);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_token_that_is_not_believed_begins_no_session() {
    let plant = Plant::new().await;
    let app = plant.server().await;
    let unsigned = |token: String| {
        let (rest, _signature) = token.rsplit_once('.').unwrap();
        let (_header, claims) = rest.split_once('.').unwrap();
        // {"alg":"none"}
        format!("eyJhbGciOiJub25lIn0.{claims}.")
    };
    let changed = |token: String| token.replacen('.', ".e30", 1);
    let as_it_is = |token: String| token;
    let mut arrived = Vec::new();
    for (claims, forged) in [
        (
            json!({"nonce": "another"}),
            as_it_is as fn(String) -> String,
        ),
        (json!({"aud": "another"}), as_it_is),
        (json!({"iss": "https://another.example"}), as_it_is),
        (json!({"exp": 1_700_000_000}), as_it_is),
        (json!({}), unsigned),
        (json!({}), changed),
    ] {
        plant.provider.forge(forged);
        let answer = plant.signed_in(&app, &claims).await.arrives(&app).await;
        assert!(answer.headers.get("set-cookie").is_none(), "{claims}");
        let detail = answer.problem(502)["detail"].as_str().unwrap().to_owned();
        assert!(detail.contains("the ID token is not believed"), "{detail}");
        arrived.push(detail);
    }
    arrived.dedup();
    assert!(arrived.len() >= 5, "{arrived:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_provider_may_change_its_keys_and_tell_groups_apart_from_the_token() {
    let plant = Plant::new().await;
    let app = plant.server().await;
    plant
        .signed_in(&app, &ada())
        .await
        .arrives(&app)
        .await
        .expect(303);
    plant.provider.change_keys();
    plant
        .signed_in(&app, &ada())
        .await
        .arrives(&app)
        .await
        .expect(303);

    let no_groups = json!({"preferred_username": "ada"});
    plant
        .provider
        .say(json!({"sub": "7", "groups": "operators"}));
    let arrived = plant.signed_in(&app, &no_groups).await.arrives(&app).await;
    let cookie = cookie_of(&arrived.expect(303), "greybox_session");
    let session = shown(&app, &cookie).await.expect(200).json();
    assert_eq!(session["who"], "person ada");
    plant
        .provider
        .say(json!({"sub": "8", "groups": "operators"}));
    let of_another = plant.signed_in(&app, &no_groups).await;
    of_another.arrives(&app).await.problem(502);
}

#[tokio::test(flavor = "multi_thread")]
async fn who_has_no_role_is_refused_by_name_and_both_are_written_down() {
    let plant = Plant::new().await;
    let app = plant.server().await;
    let admin = app.token(("it", Scope::Admin, "hall-2"), None).await;
    let eve = json!({"preferred_username": "eve", "groups": ["guests"]});
    plant
        .signed_in(&app, &eve)
        .await
        .arrives(&app)
        .await
        .problem(403);
    plant
        .signed_in(&app, &ada())
        .await
        .arrives(&app)
        .await
        .expect(303);
    let entries = async |token: &str| {
        let audit = app.request(Method::GET, "/v1/audit").bearer_auth(token);
        let audit = app.send(audit).await.expect(200).json();
        let items = audit["items"].as_array().unwrap().iter();
        let entry = |item: &Value| format!("{} {} {}", item["who"], item["path"], item["status"]);
        items.map(entry).collect::<Vec<_>>()
    };
    let of = |who: &str, status: u16| format!("\"person {who}\" \"/v1/session/callback\" {status}");
    assert!(entries(&admin).await.contains(&of("ada", 303)));
    let everywhere = app.token(("all", Scope::Admin, "default"), None).await;
    assert!(entries(&everywhere).await.contains(&of("eve", 403)));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_provider_that_does_not_answer_is_named_and_tokens_work_all_the_same() {
    let app = TestApp::with(|settings| {
        settings.oidc.oidc_issuer = Some("http://127.0.0.1:1".to_owned());
        settings.oidc.oidc_client_id = Some(CLIENT.to_owned());
        settings.oidc.public_url = Some("http://127.0.0.1:8080".to_owned());
    })
    .await;
    let problem = app.get("/v1/session/provider").await.problem(502);
    let detail = problem["detail"].as_str().unwrap();
    assert!(
        detail.contains("http://127.0.0.1:1/.well-known/openid-configuration"),
        "{detail}"
    );
    let token = app.token(("op", Scope::Read, "default"), None).await;
    let jobs = app.request(Method::GET, "/v1/jobs").bearer_auth(token);
    app.send(jobs).await.expect(200);
}
