//! The pages that the server shows to people, embedded in the program.
//!
//! `/` is the dashboard, `/docs` the API reference, and `/docs/start` and its neighbours are the
//! guides, whose texts stand in `docs/`. The pages are files without a build step: plain
//! HTML, CSS and ES modules that talk to the same HTTP interface as every other client. They fetch
//! nothing from elsewhere, and a strict Content-Security-Policy holds them to it.

mod guides;

use std::borrow::Cow;
use std::sync::LazyLock;

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
use sha2::{Digest, Sha256};

/// A file of the pages.
struct Asset {
    path: Cow<'static, str>,
    content_type: &'static str,
    policy: &'static str,
    bytes: Bytes,
}

/// What the dashboard may load: its own files and the API beside it, nothing inline.
const DASHBOARD_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; \
     img-src 'self'; connect-src 'self'; base-uri 'none'; form-action 'none'; \
     frame-ancestors 'none'";

/// What the API reference may load. Its viewer sets style attributes, so styles may be inline;
/// scripts may not.
const REFERENCE_POLICY: &str = "default-src 'none'; script-src 'self'; \
     style-src 'self' 'unsafe-inline'; img-src 'self' data:; connect-src 'self'; \
     base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const SVG: &str = "image/svg+xml";
const TEXT: &str = "text/plain; charset=utf-8";

fn page(path: &'static str, bytes: &'static [u8], policy: &'static str) -> Asset {
    Asset {
        path: path.into(),
        content_type: HTML,
        policy,
        bytes: Bytes::from_static(bytes),
    }
}

/// A guide as a page, and its text as it is written.
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
        bytes: Bytes::from_static(guide.markdown.as_bytes()),
    };
    [shown, text]
}

/// The file of that name in `assets/`, served as `/assets/…`.
macro_rules! asset {
    ($name:literal, $content_type:expr) => {
        Asset {
            path: Cow::Borrowed(concat!("/assets/", $name)),
            content_type: $content_type,
            policy: DASHBOARD_POLICY,
            bytes: Bytes::from_static(include_bytes!(concat!("assets/", $name))),
        }
    };
}

static ASSETS: LazyLock<Vec<Asset>> = LazyLock::new(|| {
    let mut assets = embedded();
    assets.extend(GUIDES.iter().flat_map(guide));
    assets
});

#[rustfmt::skip]
fn embedded() -> Vec<Asset> { vec![
    page("/", include_bytes!("assets/index.html"), DASHBOARD_POLICY),
    page(
        "/docs",
        include_bytes!("assets/docs.html"),
        REFERENCE_POLICY,
    ),
    asset!("guide.css", CSS),
    asset!("models.js", SCRIPT),
    asset!("model_editor.js", SCRIPT),
    asset!("model_language.js", SCRIPT),
    asset!("model_trial.js", SCRIPT),
    asset!("model_picture.js", SCRIPT),
    asset!("excitation.js", SCRIPT),
    asset!("document_text.js", SCRIPT),
    asset!("editor.js", SCRIPT),
    asset!("style.css", CSS),
    asset!("icon.svg", SVG),
    asset!("main.js", SCRIPT),
    asset!("api.js", SCRIPT),
    asset!("dom.js", SCRIPT),
    asset!("format.js", SCRIPT),
    asset!("axes.js", SCRIPT),
    asset!("plot.js", SCRIPT),
    asset!("plot.css", CSS),
    asset!("plot_group.js", SCRIPT),
    asset!("plot_save.js", SCRIPT),
    asset!("plot_math.js", SCRIPT),
    asset!("try_model.js", SCRIPT),
    asset!("job_live.js", SCRIPT),
    asset!("plot_theme.js", SCRIPT),
    asset!("units.js", SCRIPT),
    asset!("session.js", SCRIPT),
    asset!("jobs.js", SCRIPT),
    asset!("jobs.css", CSS),
    asset!("job_filter.js", SCRIPT),
    asset!("job_rows.js", SCRIPT),
    asset!("compare.js", SCRIPT),
    asset!("compare_diff.js", SCRIPT),
    asset!("comparisons.js", SCRIPT),
    asset!("job.js", SCRIPT),
    asset!("job_design.js", SCRIPT),
    asset!("job_feed.js", SCRIPT),
    asset!("job_progress.js", SCRIPT),
    asset!("job_result.js", SCRIPT),
    asset!("job_tables.js", SCRIPT),
    asset!("job_profiles.js", SCRIPT),
    asset!("job_residuals.js", SCRIPT),
    asset!("heat.js", SCRIPT),
    asset!("verdict.js", SCRIPT),
    asset!("job_trajectory.js", SCRIPT),
    asset!("datasets.js", SCRIPT),
    asset!("upload.js", SCRIPT),
    asset!("equation.js", SCRIPT),
    asset!("new_job.js", SCRIPT),
    asset!("new_job.css", CSS),
    asset!("new_model.js", SCRIPT),
    asset!("new_parameters.js", SCRIPT),
    asset!("new_recordings.js", SCRIPT),
    asset!("job_draft.js", SCRIPT),
    asset!("preflight.js", SCRIPT),
    asset!("docs.js", SCRIPT),
    asset!("vendor/uplot-1.6.32.min.js", SCRIPT),
    asset!("vendor/uplot-1.6.32.min.css", CSS),
    asset!("vendor/uplot-1.6.32.LICENSE", TEXT),
    asset!("vendor/codemirror-6.43.15.min.js", SCRIPT),
    asset!("vendor/codemirror-6.43.15.LICENSE", TEXT),
    asset!("vendor/rapidoc-9.3.8-min.js", SCRIPT),
    asset!("vendor/rapidoc-9.3.8.LICENSE", TEXT),
] }

/// The routes of the pages. Unknown paths are left to the router that this one is merged into.
pub fn router() -> Router {
    ASSETS.iter().fold(Router::new(), |router, asset| {
        let tag = entity_tag(&asset.bytes);
        router.route(
            &asset.path,
            get(move |headers: HeaderMap| std::future::ready(serve(asset, &tag, &headers))),
        )
    })
}

/// A strong entity tag: the content and nothing else decides it.
fn entity_tag(bytes: &[u8]) -> HeaderValue {
    let digest = Sha256::digest(bytes);
    let hex: String = digest
        .iter()
        .take(16)
        .map(|byte| format!("{byte:02x}"))
        .collect();
    HeaderValue::try_from(format!("\"{hex}\"")).expect("hex digits in quotes are a header value")
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

/// Whether the client has the file already (RFC 9110, section 13.1.2). A tag that a compressing
/// layer made weak still names the same content.
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
    use std::collections::BTreeSet;
    use tower::ServiceExt;

    async fn fetch(path: &str, known: Option<&HeaderValue>) -> Response {
        let mut request = Request::get(path);
        if let Some(tag) = known {
            request = request.header(IF_NONE_MATCH, tag);
        }
        router()
            .oneshot(request.body(Body::empty()).unwrap())
            .await
            .unwrap()
    }

    async fn text(path: &str) -> String {
        let body = fetch(path, None).await.into_body();
        String::from_utf8(to_bytes(body, usize::MAX).await.unwrap().to_vec()).unwrap()
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
        let other = fetch("/assets/style.css", Some(tag)).await;
        assert_eq!(other.status(), StatusCode::OK);
    }

    #[tokio::test]
    async fn every_file_that_a_page_or_module_names_is_served() {
        let mut paths = vec!["/".to_owned(), "/docs".to_owned()];
        // Texts are there for whoever asks for them by name.
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
            ASSETS.len(),
            "an asset is embedded that nothing names: {paths:?}"
        );
    }

    /// The quoted paths in a page (`"/assets/…"`) or a module (`"./….js"`) of ours.
    async fn named_by(path: &str) -> Vec<String> {
        if path.contains("/vendor/") {
            return Vec::new();
        }
        let asset = |piece: &str| match piece.strip_prefix("./") {
            Some(module) if module.ends_with(".js") => Some(format!("/assets/{module}")),
            _ => {
                let is_file = piece.starts_with("/assets/") || piece.starts_with("/docs/");
                is_file.then(|| piece.split('#').next().unwrap_or_default().to_owned())
            }
        };
        text(path).await.split('"').filter_map(asset).collect()
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
            // Names that are never given to a host stand in examples.
            let text = text.replace("http://www.w3.org/", "");
            let text = text.replace("https://mes.plant.example", "");
            let text = text.replace("https://greybox.plant.example", "");
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
