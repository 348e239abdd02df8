//! A problem as a page, for a browser that goes to a place which answers with one.

use greybox::report::escape;

/// What the page may load: nothing but its own style.
pub(super) const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; \
                                 form-action 'none'; frame-ancestors 'none'";

const STYLE: &str = ":root{color-scheme:light dark;font:1rem/1.5 system-ui,sans-serif}\
                     main{max-width:40rem;margin:10vh auto;padding:0 1rem}\
                     h1{font-size:1.5rem}small{opacity:.75}";

/// The page of a problem: what kind of problem, what is wrong in sentences, and the name of the request.
pub(super) fn page(
    title: &str,
    detail: &str,
    faults: impl Iterator<Item = String>,
    request_id: &str,
) -> String {
    let mut page = format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width\"><title>{title} · greybox</title>\
         <style>{STYLE}</style></head><body><main><h1>{title}</h1><p>{}.</p>",
        escape(&sentence(detail)),
        title = escape(title),
    );
    let faults: Vec<String> = faults
        .map(|fault| format!("<li>{}</li>", escape(&fault)))
        .collect();
    // The detail says a single fault already.
    if faults.len() > 1 {
        page += &format!("<ul>{}</ul>", faults.concat());
    }
    page += &format!(
        "<p><a href=\"/\">To the page of this server</a></p><p><small>Request {}</small></p></main></body></html>",
        escape(request_id)
    );
    page
}

/// A text that begins as a sentence does.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(char::to_uppercase);
    first.into_iter().flatten().chain(letters).collect()
}
