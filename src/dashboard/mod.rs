//! This module serves the pages for people, which are embedded in the program.
//!
//! `/` is the dashboard, `/docs` the API reference, `/docs/` the index of the guides, and `/docs/start` and
//! its neighbours are the guides, whose texts, pictures and recordings stand in `docs/`. The pages are files without a build step: plain
//! HTML, CSS and ES modules that talk to the same HTTP interface as every other client. They fetch
//! nothing from elsewhere, and a strict Content-Security-Policy holds them to it.

mod attachments;
mod guides;
mod search;

use std::borrow::Cow;
use std::sync::{LazyLock, OnceLock};

use attachments::{ATTACHMENTS, Attachment};
use axum::Router;
use axum::body::Bytes;
use axum::http::header::{
    CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, ETAG, IF_NONE_MATCH, REFERRER_POLICY,
    X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use guides::{GUIDES, Guide};
use serde_json::Value;
use sha2::{Digest, Sha256};

/// An asset is a file of the pages, or a page that is made from a guide.
struct Asset {
    path: Cow<'static, str>,
    content_type: &'static str,
    policy: &'static str,
    bytes: Bytes,
}

/// The dashboard may load its own files and the API beside it, and nothing inline.
const DASHBOARD_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; \
     img-src 'self'; connect-src 'self'; base-uri 'none'; form-action 'none'; \
     frame-ancestors 'none'";

/// The viewer of the API reference sets style attributes, so styles may be inline there; scripts may
/// not.
const REFERENCE_POLICY: &str = "default-src 'none'; script-src 'self'; \
     style-src 'self' 'unsafe-inline'; img-src 'self' data:; connect-src 'self'; \
     base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const SVG: &str = "image/svg+xml";
const WEBP: &str = "image/webp";
const JSON: &str = "application/json";
const TABLE: &str = "text/csv; charset=utf-8";
const TEXT: &str = "text/plain; charset=utf-8";

fn page(path: &'static str, bytes: &'static [u8], policy: &'static str) -> Asset {
    Asset {
        path: path.into(),
        content_type: HTML,
        policy,
        bytes: Bytes::from_static(bytes),
    }
}

/// Gives a guide as a page, and its text as it is written.
fn guide(guide: &'static Guide) -> [Asset; 2] {
    let shown = Asset {
        path: format!("/docs/{}", guide.name).into(),
        content_type: HTML,
        policy: DASHBOARD_POLICY,
        bytes: guides::page(guide).into(),
    };
    let text = Asset {
        path: format!("/docs/{}.md", guide.name).into(),
        content_type: TEXT,
        policy: DASHBOARD_POLICY,
        bytes: guide.markdown().into_owned().into(),
    };
    [shown, text]
}

/// Gives a picture or a recording of a guide.
fn attached(attachment: &'static Attachment) -> Asset {
    Asset {
        path: attachment.path.into(),
        content_type: content_type(attachment.path),
        policy: DASHBOARD_POLICY,
        bytes: Bytes::from_static(attachment.bytes),
    }
}

/// Embeds the files of each folder of `assets/`, which are served as `/assets/…`.
macro_rules! assets {
    ($($folder:literal: $($file:literal)+;)+) => {
        [$($(Asset {
            path: Cow::Borrowed(concat!("/assets/", $folder, "/", $file)),
            content_type: content_type($file),
            policy: DASHBOARD_POLICY,
            bytes: Bytes::from_static(include_bytes!(concat!("assets/", $folder, "/", $file))),
        }),+),+]
    };
}

/// The type of an asset follows from the end of its name; licences are plain text.
fn content_type(file: &str) -> &'static str {
    match file.rsplit('.').next() {
        Some("css") => CSS,
        Some("js") => SCRIPT,
        Some("svg") => SVG,
        Some("webp") => WEBP,
        Some("csv") => TABLE,
        _ => TEXT,
    }
}

static ASSETS: LazyLock<Vec<Asset>> = LazyLock::new(|| {
    let mut assets = vec![
        page(
            "/",
            include_bytes!("assets/shell/index.html"),
            DASHBOARD_POLICY,
        ),
        page(
            "/docs",
            include_bytes!("assets/docs/reference.html"),
            REFERENCE_POLICY,
        ),
    ];
    assets.push(Asset {
        path: "/docs/".into(),
        content_type: HTML,
        policy: DASHBOARD_POLICY,
        bytes: guides::index().into(),
    });
    assets.extend(embedded());
    assets.extend(GUIDES.iter().flat_map(guide));
    assets.extend(ATTACHMENTS.iter().map(attached));
    assets
});

#[rustfmt::skip]
fn embedded() -> impl IntoIterator<Item = Asset> { assets! {
    "compare": "differences.js" "jobs.js" "kinds.js" "methods.js" "outputs.js";
    "data": "datasets.js" "layout.js" "layouts.js" "lines.js" "mark_form.js" "marking.js" "marks.css" "marks.js" "options.js" "plots.js"
        "preparing.js" "preview.js" "quality.js" "recipe.js" "roles.js" "units.js" "upload.js" "versions.js";
    "docs": "guide.css" "matching.js" "reference.js" "search.js";
    "job": "ancestry.js" "budget.js" "contents.js" "correlation.js" "design.js" "disturbance.js" "disturbance_words.js" "effects.js"
        "feed.js" "heat.js" "influence.js" "job.css" "job.js" "live.js" "moves.js" "naming.js" "plain.js" "posterior.js" "profiles.js"
        "progress.js" "reading.js" "residuals.js" "result.js" "ribbon.js" "selection.js" "tables.js" "time_left.js" "trajectory.js" "unknowns.js" "verdict.js"
        "windows.js";
    "list": "bulk.js" "columns.js" "dropdown.js" "filter.js" "groups.js" "jobs.css" "jobs.js" "layout.js" "rows.js" "start.js" "views.js";
    "model": "description.js" "editor.js" "equation.js" "excitation.js" "language.js" "models.js"
        "parameters.js" "picture.js" "request.js" "signals.js" "simulation.js" "sliders.js" "trial.js";
    "new": "draft.js" "fields.js" "job.css" "job.js" "measurement.js" "model.js" "parameters.js" "preflight.js"
        "recordings.js" "search.js" "trial.js" "version.js";
    "plant": "access.js" "agents.js" "audit.js" "entries.js" "fields.js" "find.js" "head.js" "instants.js" "mapping.js"
        "monitor.js" "monitors.js" "paged.js" "part.js" "places.js" "plan.js" "plant.css" "rules.js" "samples.js" "sources.js"
        "starts.js" "stream.js" "stream_marks.js" "streams.js" "trend.js" "watch.js" "webhooks.js" "windows.js";
    "plot": "axes.js" "clock.js" "group.js" "legend.js" "math.js" "plot.css" "plot.js" "save.js" "theme.js" "units.js"
        "whiskers.js";
    "shell": "api.js" "description.js" "dom.js" "faults.js" "format.js" "icon.svg" "json.js" "main.js" "prepared.js" "session.js"
        "style.css";
    "text": "document.js" "editor.js";
    "vendor": "codemirror-6.43.15.LICENSE" "codemirror-6.43.15.min.js" "rapidoc-9.3.8-min.js"
        "rapidoc-9.3.8.LICENSE" "uplot-1.6.32.LICENSE" "uplot-1.6.32.min.css" "uplot-1.6.32.min.js";
} }

/// The index of the search has this address.
const INDEX: &str = "/docs/index.json";

/// Gives the routes of the pages. Unknown paths are left to the router that they are merged into. The search
/// looks through the description of the API too, which is made when somebody searches.
pub fn router(describe: fn() -> Value) -> Router {
    let pages = ASSETS.iter().fold(Router::new(), |router, asset| {
        let tag = entity_tag(&asset.bytes);
        router.route(
            &asset.path,
            get(move |headers: HeaderMap| std::future::ready(serve(asset, &tag, &headers))),
        )
    });
    let index = move |headers: HeaderMap| {
        let (asset, tag) = indexed(describe);
        std::future::ready(serve(asset, tag, &headers))
    };
    pages.route(INDEX, get(index))
}

/// Gives the index of the search with its entity tag.
fn indexed(describe: fn() -> Value) -> &'static (Asset, HeaderValue) {
    static INDEXED: OnceLock<(Asset, HeaderValue)> = OnceLock::new();
    INDEXED.get_or_init(|| {
        let asset = Asset {
            path: INDEX.into(),
            content_type: JSON,
            policy: DASHBOARD_POLICY,
            bytes: search::index(&describe()).into(),
        };
        let tag = entity_tag(&asset.bytes);
        (asset, tag)
    })
}

/// The entity tag is strong: the content alone decides it.
fn entity_tag(bytes: &[u8]) -> HeaderValue {
    let digits = hex::encode(&Sha256::digest(bytes)[..16]);
    HeaderValue::try_from(format!("\"{digits}\"")).expect("hex digits in quotes are a header value")
}

fn serve(asset: &'static Asset, tag: &HeaderValue, request: &HeaderMap) -> Response {
    let headers = [
        (CONTENT_TYPE, HeaderValue::from_static(asset.content_type)),
        (
            CONTENT_SECURITY_POLICY,
            HeaderValue::from_static(asset.policy),
        ),
        (X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
        (REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
        (CACHE_CONTROL, HeaderValue::from_static("no-cache")),
        (ETAG, tag.clone()),
    ];
    if is_known_to(request, tag) {
        (StatusCode::NOT_MODIFIED, headers).into_response()
    } else {
        (headers, asset.bytes.clone()).into_response()
    }
}

/// Answers whether the client has the file already (RFC 9110, section 13.1.2). A tag that a
/// compressing layer made weak still names the same content.
fn is_known_to(request: &HeaderMap, tag: &HeaderValue) -> bool {
    let same = |candidate: &str| {
        let candidate = candidate.trim();
        candidate == "*"
            || candidate.strip_prefix("W/").unwrap_or(candidate).as_bytes() == tag.as_bytes()
    };
    request
        .get_all(IF_NONE_MATCH)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .any(|value| value.split(',').any(same))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::body::{Body, to_bytes};
    use axum::http::Request;
    use serde_json::json;
    use std::collections::BTreeSet;
    use tower::ServiceExt;

    async fn fetch(path: &str, tag: Option<&HeaderValue>) -> Response {
        let mut request = Request::get(path);
        if let Some(tag) = tag {
            request = request.header(IF_NONE_MATCH, tag);
        }
        static PAGES: LazyLock<Router> = LazyLock::new(|| router(|| json!({})));
        PAGES
            .clone()
            .oneshot(request.body(Body::empty()).unwrap())
            .await
            .unwrap()
    }

    async fn text(path: &str) -> String {
        let body = fetch(path, None).await.into_body();
        let bytes = to_bytes(body, usize::MAX).await.unwrap();
        String::from_utf8_lossy(&bytes).into_owned()
    }

    #[tokio::test]
    async fn a_page_that_the_client_has_is_not_sent_again() {
        let first = fetch("/", None).await;
        assert_eq!(first.status(), StatusCode::OK);
        let tag = &first.headers()[ETAG];
        let again = fetch("/", Some(tag)).await;
        assert_eq!(again.status(), StatusCode::NOT_MODIFIED);
        let weak = HeaderValue::try_from(format!("\"x\", W/{}", tag.to_str().unwrap())).unwrap();
        assert_eq!(
            fetch("/", Some(&weak)).await.status(),
            StatusCode::NOT_MODIFIED
        );
        let stylesheet = fetch("/assets/shell/style.css", Some(tag)).await;
        assert_eq!(stylesheet.status(), StatusCode::OK);
    }

    #[tokio::test]
    async fn every_file_that_a_page_or_module_names_is_served() {
        let mut paths = vec!["/".to_owned(), "/docs".to_owned()];
        // No page names the texts of the guides; clients ask for them by name.
        paths.extend(
            GUIDES
                .iter()
                .map(|guide| format!("/docs/{}.md", guide.name)),
        );
        let mut seen = 0;
        while seen < paths.len() {
            let path = paths[seen].clone();
            seen += 1;
            assert_eq!(fetch(&path, None).await.status(), StatusCode::OK, "{path}");
            let named = named_by(&path).await;
            let new: BTreeSet<String> = named
                .into_iter()
                .filter(|file| !paths.contains(file))
                .collect();
            paths.extend(new);
        }
        assert_eq!(
            seen,
            ASSETS.len() + 1,
            "an asset is embedded that nothing names: {paths:?}"
        );
    }

    fn is_attached(path: &str) -> bool {
        ATTACHMENTS.iter().any(|attachment| attachment.path == path)
    }

    /// Lists the quoted paths in a page (`"/assets/…"`) or a module (`"./….js"`, `"../….js"`).
    async fn named_by(path: &str) -> Vec<String> {
        if path.contains("/vendor/") || path == INDEX || is_attached(path) {
            return Vec::new();
        }
        let (folder, _) = path.rsplit_once('/').unwrap();
        let asset = |piece: &str| {
            if piece.starts_with('.') && piece.ends_with(".js") {
                return Some(module_beside(folder, piece));
            }
            let is_file = piece.starts_with("/assets/") || piece.starts_with("/docs/");
            is_file.then(|| piece.split('#').next().unwrap_or_default().to_owned())
        };
        text(path).await.split('"').filter_map(asset).collect()
    }

    /// Gives the address of a module that a module of the folder imports as `./…` or `../…`.
    fn module_beside(folder: &str, name: &str) -> String {
        let mut parts: Vec<&str> = folder.split('/').collect();
        for part in name.split('/') {
            match part {
                "." => {}
                ".." => drop(parts.pop()),
                part => parts.push(part),
            }
        }
        parts.join("/")
    }

    #[tokio::test]
    async fn pages_have_no_inline_script_and_a_policy_that_forbids_it() {
        for path in ["/", "/docs"] {
            let response = fetch(path, None).await;
            let policy = response.headers()[CONTENT_SECURITY_POLICY]
                .to_str()
                .unwrap();
            assert!(policy.contains("script-src 'self';"), "{policy}");
            let html = text(path).await;
            let mut scripts = html.split("<script").skip(1);
            assert!(
                scripts.all(|tag| tag.contains("src=\"/assets/")),
                "inline script in {path}"
            );
            assert!(
                !html.contains(" style=") && !html.contains(" onclick="),
                "{path}"
            );
        }
    }

    #[tokio::test]
    async fn the_pages_own_files_name_no_other_host() {
        for asset in ASSETS
            .iter()
            .filter(|asset| !asset.path.contains("/vendor/"))
        {
            let text = text(&asset.path).await;
            // These are names in examples, which no host ever has.
            let text = text.replace("http://www.w3.org/", "");
            let text = text.replace("https://mes.plant.example", "");
            let text = text.replace("https://greybox.plant.example", "");
            let text = text.replace("https://login.plant.example", "");
            let text = text.replace("https://telegraf:gbx_…@greybox.plant.example", "");
            assert!(
                !text.contains("http://") && !text.contains("https://"),
                "{}",
                asset.path
            );
        }
    }

    #[tokio::test]
    async fn an_unknown_file_is_not_found() {
        assert_eq!(
            fetch("/assets/nothing.js", None).await.status(),
            StatusCode::NOT_FOUND
        );
    }
}
