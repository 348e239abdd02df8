//! The guides are Markdown in `docs/`. The server shows them as pages under `/docs/`, and as they are
//! written under the same address with `.md` behind it.

use std::borrow::Cow;
use std::fmt::Write as _;

use greybox::uncertainty::verdict::Rule;
use pulldown_cmark::{CowStr, Event, Options, Parser, Tag, TagEnd, html};

/// A guide is a text in Markdown with a name and a title.
pub struct Guide {
    /// The address of the guide ends with its name.
    pub name: &'static str,
    /// The navigation shows the title.
    title: &'static str,
    /// The text is written in Markdown; chapters that a table holds are left out of it.
    source: &'static str,
}

/// The chapters of the rules of a verdict stand here in the text of a guide.
const RULES: &str = "<!-- rules -->\n";

impl Guide {
    /// Gives the whole text in Markdown.
    pub fn markdown(&self) -> Cow<'static, str> {
        if !self.source.contains(RULES) {
            return Cow::Borrowed(self.source);
        }
        let chapters = Rule::ALL.iter().map(|rule| rule.entry().chapter());
        let chapters = chapters.collect::<Vec<_>>().join("\n");
        Cow::Owned(self.source.replace(RULES, &chapters))
    }
}

macro_rules! guide {
    ($name:literal, $title:literal) => {
        Guide {
            name: $name,
            title: $title,
            source: include_str!(concat!("docs/", $name, ".md")),
        }
    };
}

/// The guides stand in the order of the navigation.
pub static GUIDES: [Guide; 13] = [
    guide!("start", "First job"),
    guide!("import", "Recordings and units"),
    guide!("models", "Models"),
    guide!("equations", "Equations"),
    guide!("jobs", "Jobs"),
    guide!("monitors", "Monitors"),
    guide!("agents", "Collecting agents"),
    guide!("collect", "A collector beside the historian"),
    guide!("designs", "Which experiment next"),
    guide!("selections", "Which windows of a year"),
    guide!("verdicts", "Verdicts"),
    guide!("method", "Method"),
    guide!("running", "Running it for others"),
];

/// Writes the guide as a page without a script.
pub fn page(guide: &Guide) -> String {
    framed(guide.title, Some(guide.name), &guide.markdown())
}

/// Writes the index of the guides as a page: the title of each, with its first paragraph.
pub fn index() -> String {
    let mut text = "# Docs\n\n".to_owned();
    for guide in &GUIDES {
        let paragraphs = guide.source.split("\n\n");
        let first = paragraphs
            .skip(1)
            .find(|text| !text.starts_with(['#', '|', '`', '-', '<']));
        let (name, title, first) = (guide.name, guide.title, first.unwrap_or_default());
        writeln!(text, "## [{title}](/docs/{name})\n\n{first}\n")
            .expect("writing to a string does not fail");
    }
    text += "## [API reference](/docs)\n\nEvery request with its parameters, answers and faults.\n";
    framed("Docs", None, &text)
}

/// Puts a text beside the links to all guides, of which one may be the current one.
fn framed(title: &str, current: Option<&str>, markdown: &str) -> String {
    let mut links = String::new();
    for entry in &GUIDES {
        let current = if Some(entry.name) == current {
            " aria-current=\"page\""
        } else {
            ""
        };
        writeln!(
            links,
            "<a href=\"/docs/{}\"{current}>{}</a>",
            entry.name, entry.title
        )
        .expect("writing to a string does not fail");
    }
    include_str!("assets/docs/guide.html")
        .replace("{title}", title)
        .replace("{links}", &links)
        .replace("{body}", &body(markdown))
}

/// Writes Markdown as HTML; headings can be linked to by their words.
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
    // Tables and examples may be wider than the page: each scrolls by itself, and by keyboard.
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

/// Gives the words of a heading as the anchor of its links.
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
    fn every_rule_of_a_verdict_has_a_chapter_that_its_code_links_to() {
        let mut guides = GUIDES.iter();
        let guide = guides.find(|guide| guide.name == "verdicts").unwrap();
        let page = page(guide);
        for rule in Rule::ALL {
            let heading = format!("<h2 id=\"{rule}\">");
            assert_eq!(page.matches(&heading).count(), 1, "{rule}");
        }
    }

    #[test]
    fn the_index_has_each_guide_with_a_paragraph() {
        let page = index();
        let chapters: Vec<&str> = page.split("<h2").skip(1).collect();
        assert_eq!(chapters.len(), GUIDES.len() + 1);
        assert!(
            chapters
                .iter()
                .all(|chapter| chapter.contains("<a href=\"/docs") && chapter.contains("<p>"))
        );
    }

    #[test]
    fn every_guide_begins_with_its_only_title() {
        for guide in &GUIDES {
            let titles = Parser::new(guide.source).filter(|event| {
                matches!(
                    event,
                    Event::Start(Tag::Heading {
                        level: HeadingLevel::H1,
                        ..
                    })
                )
            });
            assert_eq!(titles.count(), 1, "{}", guide.name);
            assert!(guide.source.starts_with("# "), "{}", guide.name);
        }
    }
}
