//! The guides: Markdown in `docs/`, written once, shown as pages under `/docs/` and as they are with
//! `.md` behind their names.

use std::fmt::Write as _;

use pulldown_cmark::{CowStr, Event, Options, Parser, Tag, TagEnd, html};

/// A guide.
pub struct Guide {
    /// Its name in the address.
    pub name: &'static str,
    /// What it is called in the navigation.
    title: &'static str,
    /// Its text.
    pub markdown: &'static str,
}

macro_rules! guide {
    ($name:literal, $title:literal) => {
        Guide {
            name: $name,
            title: $title,
            markdown: include_str!(concat!("docs/", $name, ".md")),
        }
    };
}

/// All guides, in the order of the navigation.
pub static GUIDES: [Guide; 10] = [
    guide!("start", "First job"),
    guide!("import", "Recordings and units"),
    guide!("models", "Models"),
    guide!("equations", "Equations"),
    guide!("jobs", "Jobs"),
    guide!("monitors", "Monitors"),
    guide!("designs", "Which experiment next"),
    guide!("verdicts", "Verdicts"),
    guide!("method", "Method"),
    guide!("running", "Running it for others"),
];

/// The guide as a page without a script.
pub fn page(guide: &Guide) -> String {
    let mut links = String::new();
    for other in &GUIDES {
        let current = if other.name == guide.name {
            " aria-current=\"page\""
        } else {
            ""
        };
        writeln!(
            links,
            "<a href=\"/docs/{}\"{current}>{}</a>",
            other.name, other.title
        )
        .expect("writing to a string does not fail");
    }
    include_str!("assets/guide.html")
        .replace("{title}", guide.title)
        .replace("{links}", &links)
        .replace("{body}", &body(guide.markdown))
}

/// Markdown as HTML; headings can be linked to by their words.
fn body(markdown: &str) -> String {
    let options = Options::ENABLE_TABLES;
    let mut events: Vec<Event<'_>> = Parser::new_ext(markdown, options).collect();
    for place in 0..events.len() {
        if !matches!(&events[place], Event::Start(Tag::Heading { .. })) {
            continue;
        }
        let words = events[place + 1..].iter();
        let words = words.take_while(|event| !matches!(event, Event::End(TagEnd::Heading(_))));
        let text: String = words
            .filter_map(|event| match event {
                Event::Text(text) | Event::Code(text) => Some(&**text),
                _ => None,
            })
            .collect();
        if let Event::Start(Tag::Heading { id, .. }) = &mut events[place] {
            *id = Some(CowStr::from(anchor(&text)));
        }
    }
    // What may be wider than the page scrolls by itself, and can be reached by keyboard.
    let mut frames = 0;
    let framed = events.into_iter().flat_map(|event| match &event {
        Event::Start(Tag::Table(_) | Tag::CodeBlock(_)) => {
            let (class, what) = match &event {
                Event::Start(Tag::Table(_)) => ("scroll", "table"),
                _ => ("code", "example"),
            };
            frames += 1;
            let frame = format!(
                "<div class=\"{class}\" tabindex=\"0\" role=\"region\" \
                 aria-label=\"{what} {frames}\">"
            );
            vec![Event::Html(frame.into()), event]
        }
        Event::End(TagEnd::Table | TagEnd::CodeBlock) => {
            vec![event, Event::Html("</div>".into())]
        }
        _ => vec![event],
    });
    let mut written = String::new();
    html::push_html(&mut written, framed);
    written
}

/// What a heading is linked to by.
fn anchor(text: &str) -> String {
    let lower = text.to_lowercase();
    let words: Vec<&str> = lower
        .split(|character: char| !character.is_alphanumeric() && character != '_')
        .filter(|word| !word.is_empty())
        .collect();
    words.join("-")
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulldown_cmark::HeadingLevel;

    #[test]
    fn headings_are_linked_to_by_their_words() {
        let html = body("## What is `at_bound`?\n\n| a | b |\n|---|---|\n| 1 | 2 |\n");
        assert!(html.contains("<h2 id=\"what-is-at_bound\">"), "{html}");
        assert!(html.contains("<td>1</td>"), "{html}");
    }

    #[test]
    fn every_guide_begins_with_its_only_title() {
        for guide in &GUIDES {
            let titles = Parser::new(guide.markdown).filter(|event| {
                matches!(
                    event,
                    Event::Start(Tag::Heading {
                        level: HeadingLevel::H1,
                        ..
                    })
                )
            });
            assert_eq!(titles.count(), 1, "{}", guide.name);
            assert!(guide.markdown.starts_with("# "), "{}", guide.name);
        }
    }
}
