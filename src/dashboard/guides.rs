//! The guides are Markdown in `docs/`. The server shows them as pages under `/docs/`, and as they are
//! written under the same address with `.md` behind it.

use std::borrow::Cow;
use std::fmt::Write as _;

use greybox::uncertainty::verdict::Rule;
use pulldown_cmark::{CowStr, Event, Options, Parser, Tag, TagEnd, html};

use serde::Serialize;

use super::attachments;

/// A guide is a text in Markdown with a name and a title.
pub struct Guide {
    /// The address of the guide ends with its name.
    pub name: &'static str,
    /// The navigation shows the title.
    pub title: &'static str,
    /// The text is written in Markdown; chapters that a table holds are left out of it.
    source: &'static str,
}

/// The chapters of the rules of a verdict stand here in the text of a guide.
const RULES: &str = "<!-- rules -->\n";

/// The pictures of rules: a chapter for each rule that has one, with the code of the rule as its heading.
const RULE_PICTURES: &str = include_str!("docs/rule_pictures.md");

impl Guide {
    /// Gives the whole text in Markdown.
    pub fn markdown(&self) -> Cow<'static, str> {
        if !self.source.contains(RULES) {
            return Cow::Borrowed(self.source);
        }
        let chapters = Rule::ALL.iter().map(|rule| chapter(*rule));
        let chapters = chapters.collect::<Vec<_>>().join("\n");
        Cow::Owned(self.source.replace(RULES, &chapters))
    }
}

/// Gives the chapter of a rule with its picture, where the rule has one.
fn chapter(rule: Rule) -> String {
    let mut chapter = rule.entry().chapter();
    let mut pictures = RULE_PICTURES.split("\n## ").skip(1);
    let of_rule = |picture: &'static str| picture.strip_prefix(rule.code())?.strip_prefix("\n\n");
    if let Some(picture) = pictures.find_map(of_rule) {
        write!(chapter, "\n{}\n", picture.trim_end()).expect("writing to a string does not fail");
    }
    chapter
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
pub static GUIDES: [Guide; 14] = [
    guide!("start", "First job"),
    guide!("examples", "Worked examples"),
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

/// Writes the guide as a page.
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
    let mut events = with_pictures(Parser::new_ext(markdown, Options::ENABLE_TABLES));
    for place in 0..events.len() {
        if let Some(text) = heading_at(&events, place)
            && let Event::Start(Tag::Heading { id, .. }) = &mut events[place]
        {
            *id = Some(CowStr::from(anchor(&text)));
        }
    }
    let mut written = String::new();
    html::push_html(&mut written, with_frames(events).into_iter());
    written
}

/// Gives the words of the heading that begins at a place.
fn heading_at(events: &[Event<'_>], place: usize) -> Option<String> {
    let is_heading = matches!(&events[place], Event::Start(Tag::Heading { .. }));
    let words = events[place + 1..].iter();
    let words = words.take_while(|event| !matches!(event, Event::End(TagEnd::Heading(_))));
    let words = words.filter_map(|event| match event {
        Event::Text(text) | Event::Code(text) => Some(&**text),
        _ => None,
    });
    is_heading.then(|| words.collect())
}

/// Puts links to pictures in the place of images: the link shows its picture, and leads to the whole of it.
fn with_pictures<'a>(events: impl Iterator<Item = Event<'a>>) -> Vec<Event<'a>> {
    let mut pictured = Vec::new();
    // The address of the picture whose description is being read, and the description.
    let mut picture: Option<(CowStr<'a>, String)> = None;
    for event in events {
        match (event, &mut picture) {
            (Event::Start(Tag::Image { dest_url, .. }), _) => {
                picture = Some((dest_url, String::new()));
            }
            (Event::End(TagEnd::Image), Some((address, seen))) => {
                pictured.push(Event::InlineHtml(framed_picture(address, seen).into()));
                picture = None;
            }
            (Event::Text(text) | Event::Code(text), Some((_, seen))) => *seen += &text,
            (Event::SoftBreak, Some((_, seen))) => seen.push(' '),
            (event, _) => pictured.push(event),
        }
    }
    pictured
}

/// Writes a picture with its size, so that the text below does not move when the picture comes.
fn framed_picture(address: &str, seen: &str) -> String {
    let seen = seen.replace('&', "&amp;").replace('<', "&lt;");
    let seen = seen.replace('"', "&quot;");
    let size = attachments::size(address).map_or(String::new(), |[width, height]| {
        format!(" width=\"{width}\" height=\"{height}\"")
    });
    format!(
        "<a class=\"shown\" href=\"{address}\">\
         <img src=\"{address}\" alt=\"{seen}\"{size} loading=\"lazy\"></a>"
    )
}

/// Frames tables and examples, which may be wider than the page: each scrolls by itself, and by keyboard.
fn with_frames(events: Vec<Event<'_>>) -> Vec<Event<'_>> {
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
    framed.collect()
}

/// A chapter is a heading of a guide with the words below it, up to the next heading.
#[derive(Serialize)]
pub struct Chapter {
    /// The words of the heading.
    title: String,
    /// The anchor of the heading.
    anchor: String,
    /// The words below the heading, without examples.
    text: String,
}

/// Lists the chapters of a guide.
pub fn chapters(guide: &Guide) -> Vec<Chapter> {
    let markdown = guide.markdown();
    let events: Vec<Event<'_>> = Parser::new_ext(&markdown, Options::ENABLE_TABLES).collect();
    let mut chapters: Vec<Chapter> = Vec::new();
    // The words of a heading, of an example or of a description of a picture are not those below the heading.
    let mut is_apart = false;
    for (place, event) in events.iter().enumerate() {
        if let Some(title) = heading_at(&events, place) {
            chapters.push(Chapter {
                anchor: anchor(&title),
                title,
                text: String::new(),
            });
        }
        let Some(Chapter { text, .. }) = chapters.last_mut() else {
            continue;
        };
        match event {
            Event::Start(Tag::Heading { .. } | Tag::CodeBlock(_) | Tag::Image { .. }) => {
                is_apart = true;
            }
            Event::End(TagEnd::Heading(_) | TagEnd::CodeBlock | TagEnd::Image) => is_apart = false,
            Event::Text(words) | Event::Code(words) if !is_apart => *text += words,
            Event::SoftBreak | Event::End(TagEnd::Paragraph | TagEnd::Item | TagEnd::TableCell) => {
                text.push(' ');
            }
            _ => {}
        }
    }
    chapters
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
    fn every_picture_of_a_rule_stands_in_the_chapter_of_a_rule() {
        let headings = RULE_PICTURES.split("\n## ").skip(1);
        let mut codes: Vec<&str> = headings.filter_map(|part| part.lines().next()).collect();
        let rules = Rule::ALL.iter().map(|rule| rule.code());
        let expected: Vec<&str> = rules.filter(|code| codes.contains(code)).collect();
        codes.sort_unstable_by_key(|code| expected.iter().position(|rule| rule == code));
        assert_eq!(codes, expected);
        for code in codes {
            let picture = format!("](/docs/pictures/rule_{code}.webp)");
            let rule = Rule::ALL.iter().find(|rule| rule.code() == code);
            assert!(chapter(*rule.unwrap()).contains(&picture), "{code}");
        }
    }

    #[test]
    fn every_picture_has_its_size_and_says_what_is_seen() {
        for guide in &GUIDES {
            for picture in page(guide).split("<img ").skip(1) {
                let tag = picture.split('>').next().unwrap();
                assert!(
                    tag.contains(" width=\"") && tag.contains(" height=\""),
                    "{tag}"
                );
                let seen = tag.split(" alt=\"").nth(1).unwrap().split('"').next();
                assert!(seen.unwrap().len() > 40, "{tag}");
            }
        }
    }

    #[test]
    fn the_chapters_of_a_guide_have_the_addresses_of_its_headings() {
        for guide in &GUIDES {
            let page = page(guide);
            let chapters = chapters(guide);
            let headings = ["<h1 id=", "<h2 id=", "<h3 id="].map(|tag| page.matches(tag).count());
            assert_eq!(headings.iter().sum::<usize>(), chapters.len());
            for chapter in chapters {
                let id = format!(" id=\"{}\">", chapter.anchor);
                assert_eq!(page.matches(&id).count(), 1, "{id}");
                assert!(!chapter.title.is_empty(), "{id}");
                assert!(!chapter.text.contains('\n'), "{id}: {}", chapter.text);
            }
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
