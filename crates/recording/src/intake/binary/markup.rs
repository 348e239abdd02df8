//! The markup of a workbook's parts, gone through before the library reads them.
//!
//! The library holds each tag, each text between two tags and each cell whole; of a workbook it also
//! holds the shared strings, the styles and the names. A [`Scan`] goes through the parts as they are
//! unpacked and counts what the library would hold. Only well-formed markup passes, so that the scan
//! sees the same cells as the library.

/// The longest text of a cell, and the longest tag or comment `[bytes]`: the 32 767 characters that
/// Excel writes into a cell, each of up to 10 bytes where it is escaped (`&#x10FFFF;`).
pub(super) const LONGEST_BYTES: usize = 32_767 * 10;
/// Tags within each other, at the most.
const MOST_DEPTH: usize = 64;
/// How character data begins.
const DATA: &[u8] = b"![CDATA[";
/// What precedes the number of shared strings, for which the library makes room at once.
const STRINGS_COUNT: &[u8] = b"uniqueCount";
/// Bytes that an empty shared string takes with its place in the table.
const STRING_BYTES: u64 = 72;
/// Bytes that the place of a shared string takes.
const PLACE_BYTES: u64 = 24;
/// Bytes that a style takes, beside the names that it repeats.
const STYLE_BYTES: u64 = 1024;
/// Bytes that a font, a fill, a name or a relationship takes, beside its text …
const ENTRY_BYTES: u64 = 512;
/// … and copies of its text.
const ENTRY_COPIES: u64 = 4;

/// Elements that the library keeps as entries of a list.
const ENTRIES: [&[u8]; 7] = [
    b"font",
    b"fill",
    b"border",
    b"numFmt",
    b"sheet",
    b"Relationship",
    b"definedName",
];

/// Why a workbook is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Excess {
    /// A cell, a tag or a comment is too long.
    Long,
    /// The markup is not what a workbook has, e.g. `tags that do not match`.
    Unsound(&'static str),
}

/// What of the markup is being gone through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MarkupState {
    Text,
    /// A tag outside of quotes.
    Tag,
    /// A tag's value within such quotes.
    Quoted(u8),
    Comment,
    Data,
    Instruction,
}

/// What the library keeps of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ElementKind {
    /// Nothing once its text was used.
    Cell,
    SharedString,
    Style,
    Entry,
}

/// An element that the library holds whole.
#[derive(Clone, Copy, Debug)]
struct Item {
    kind: ElementKind,
    /// The tags around it.
    depth: usize,
    /// The bytes of the text so far.
    bytes: usize,
}

/// The parts of a workbook as far as they were gone through.
pub(super) struct Scan {
    state: MarkupState,
    /// The tag, comment or instruction that is being read, without its `<`.
    tag: Vec<u8>,
    /// Bytes of the text since the last tag.
    text: usize,
    /// The names of the open tags, one behind the other, and where each begins.
    names: Vec<u8>,
    begins: Vec<usize>,
    item: Option<Item>,
    /// Bytes of the longest entry, which styles may repeat.
    longest_entry: u64,
    /// Bytes that the library will hold of all parts.
    pub(super) held: u64,
}

impl Scan {
    pub(super) fn new() -> Self {
        Self {
            state: MarkupState::Text,
            tag: Vec::new(),
            text: 0,
            names: Vec::new(),
            begins: Vec::new(),
            item: None,
            longest_entry: 0,
            held: 0,
        }
    }

    /// Goes through the next bytes of a part.
    pub(super) fn take(&mut self, bytes: &[u8]) -> Result<(), Excess> {
        if bytes.contains(&0) {
            return Err(Excess::Unsound("a part that is not UTF-8"));
        }
        let mut rest = bytes;
        while let Some(first) = rest.first() {
            if self.state == MarkupState::Text && *first != b'<' {
                let length = rest.iter().position(|byte| *byte == b'<');
                let (text, after) = rest.split_at(length.unwrap_or(rest.len()));
                self.text += text.len();
                self.grow(text.len())?;
                rest = after;
                continue;
            }
            self.byte(*first)?;
            rest = &rest[1..];
        }
        Ok(())
    }

    /// Ends a part.
    pub(super) fn end_part(&mut self) -> Result<(), Excess> {
        let is_whole = self.state == MarkupState::Text && self.begins.is_empty();
        self.text = 0;
        match is_whole {
            true => Ok(()),
            false => Err(Excess::Unsound("a part that breaks off")),
        }
    }

    fn byte(&mut self, byte: u8) -> Result<(), Excess> {
        if self.state == MarkupState::Text {
            self.state = MarkupState::Tag;
            self.text = 0;
            self.tag.clear();
            return self.grow(1);
        }
        if byte != b'>' || matches!(self.state, MarkupState::Quoted(_)) {
            return self.push(byte);
        }
        let is_end = match self.state {
            MarkupState::Comment => self.tag.ends_with(b"--"),
            MarkupState::Data => self.tag.ends_with(b"]]"),
            MarkupState::Instruction => self.tag.ends_with(b"?"),
            _ => true,
        };
        // Readers differ on where such a short one ends.
        let is_short = self.tag.len() < 8 && self.state == MarkupState::Comment || self.tag == b"?";
        match (is_end, is_short) {
            (_, true) => Err(Excess::Unsound("a comment or an instruction of nothing")),
            (false, _) => self.push(byte),
            (true, false) => self.end_tag(),
        }
    }

    /// Adds a byte to the tag.
    fn push(&mut self, byte: u8) -> Result<(), Excess> {
        self.state = match (self.state, byte) {
            (MarkupState::Tag, b'"' | b'\'') if self.tag.first() != Some(&b'!') => {
                MarkupState::Quoted(byte)
            }
            (MarkupState::Quoted(quote), _) if quote == byte => MarkupState::Tag,
            (state, _) => state,
        };
        self.tag.push(byte);
        if self.state == MarkupState::Tag && matches!(self.tag[0], b'!' | b'?') {
            self.state = match self.tag.as_slice() {
                b"?" => MarkupState::Instruction,
                b"!--" => MarkupState::Comment,
                tag if tag == DATA => MarkupState::Data,
                tag if b"!--".starts_with(tag) || DATA.starts_with(tag) => MarkupState::Tag,
                _ => return Err(Excess::Unsound("a declaration")),
            };
        }
        self.grow(1)
    }

    /// Counts bytes of a text or a tag.
    fn grow(&mut self, bytes: usize) -> Result<(), Excess> {
        if let Some(item) = &mut self.item {
            item.bytes += bytes;
        }
        let item = self.item.map_or(0, |item| item.bytes);
        match self.tag.len().max(self.text).max(item) > LONGEST_BYTES {
            true => Err(Excess::Long),
            false => Ok(()),
        }
    }

    fn end_tag(&mut self) -> Result<(), Excess> {
        let state = std::mem::replace(&mut self.state, MarkupState::Text);
        if state != MarkupState::Tag {
            self.tag.clear();
            return Ok(());
        }
        let tag = std::mem::take(&mut self.tag);
        let ended = match tag.split_first() {
            Some((b'/', name)) => self.close(name),
            Some((b'!', _)) | None => Err(Excess::Unsound("a declaration")),
            Some(_) => self.open(&tag),
        };
        self.tag = tag;
        self.tag.clear();
        ended
    }

    fn open(&mut self, tag: &[u8]) -> Result<(), Excess> {
        let end = tag.iter().position(|byte| b" \t\r\n/".contains(byte));
        let name = &tag[..end.unwrap_or(tag.len())];
        if self.begins.len() == MOST_DEPTH {
            return Err(Excess::Unsound("tags within each other, more than 64"));
        }
        if let Some(kind) = ElementKind::of(name) {
            self.begin_item(kind, tag.len());
        }
        if local(name) == b"sst" {
            self.keep(places(tag).saturating_mul(PLACE_BYTES));
        }
        self.begins.push(self.names.len());
        self.names.extend_from_slice(name);
        match tag.ends_with(b"/") {
            true => self.close(name),
            false => Ok(()),
        }
    }

    fn close(&mut self, name: &[u8]) -> Result<(), Excess> {
        let begin = self.begins.pop();
        let begin = begin.filter(|begin| self.names[*begin..] == *name.trim_ascii_end());
        let begin = begin.ok_or(Excess::Unsound("tags that do not match"))?;
        self.names.truncate(begin);
        if let Some(item) = self.item.filter(|item| item.depth == self.begins.len()) {
            self.end_item(item);
        }
        Ok(())
    }

    /// Begins an element that the library holds, within another one or not.
    fn begin_item(&mut self, kind: ElementKind, bytes: usize) {
        self.keep(match kind {
            ElementKind::Cell => 0,
            ElementKind::SharedString => STRING_BYTES,
            ElementKind::Style => STYLE_BYTES + 2 * self.longest_entry,
            ElementKind::Entry => ENTRY_BYTES,
        });
        match &mut self.item {
            Some(around) if kind != ElementKind::Cell => around.kind = ElementKind::Entry,
            Some(_) => {}
            None => {
                let depth = self.begins.len();
                self.item = Some(Item { kind, depth, bytes });
            }
        }
    }

    /// Ends the outermost element that the library holds.
    fn end_item(&mut self, item: Item) {
        let bytes = item.bytes as u64;
        self.keep(match item.kind {
            ElementKind::Cell => 0,
            ElementKind::SharedString => bytes,
            ElementKind::Style | ElementKind::Entry => ENTRY_COPIES * bytes,
        });
        if item.kind == ElementKind::Entry {
            self.longest_entry = self.longest_entry.max(bytes);
        }
        self.item = None;
    }

    /// Counts bytes that the library holds until the workbook is read.
    fn keep(&mut self, bytes: u64) {
        self.held = self.held.saturating_add(bytes);
    }
}

impl ElementKind {
    /// What the library keeps of an element of that name, with or without a prefix.
    fn of(name: &[u8]) -> Option<Self> {
        match local(name) {
            b"c" => Some(Self::Cell),
            b"si" => Some(Self::SharedString),
            b"xf" => Some(Self::Style),
            local => ENTRIES.contains(&local).then_some(Self::Entry),
        }
    }
}

/// A name without its prefix.
fn local(name: &[u8]) -> &[u8] {
    name.rsplit(|byte| *byte == b':').next().unwrap_or(name)
}

/// The places of shared strings that a tag asks for; 0 where it asks for none.
fn places(tag: &[u8]) -> u64 {
    let mut most = 0;
    let mut rest = tag;
    let find = |rest: &[u8]| {
        let mut windows = rest.windows(STRINGS_COUNT.len());
        windows.position(|window| window == STRINGS_COUNT)
    };
    while let Some(place) = find(rest) {
        rest = &rest[place + STRINGS_COUNT.len()..];
        let digits = rest.iter().skip_while(|byte| !byte.is_ascii_digit());
        let digits = digits.take_while(|byte| byte.is_ascii_digit());
        let count = digits.fold(0_u64, |count, digit| {
            let digit = u64::from(digit - b'0');
            count.saturating_mul(10).saturating_add(digit)
        });
        most = most.max(count);
    }
    most
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a part is told, in pieces of any size.
    fn scanned(part: &str) -> Result<u64, Excess> {
        let whole = taken(part.as_bytes(), part.len().max(1));
        assert_eq!(taken(part.as_bytes(), 1), whole, "byte by byte");
        whole
    }

    fn taken(part: &[u8], size: usize) -> Result<u64, Excess> {
        let mut scan = Scan::new();
        for piece in part.chunks(size) {
            scan.take(piece)?;
        }
        scan.end_part()?;
        Ok(scan.held)
    }

    const LONG: usize = LONGEST_BYTES + 1;

    #[test]
    fn a_cell_is_as_long_as_all_that_stands_in_it() {
        let a = "a".repeat(LONGEST_BYTES / 2);
        let two = format!("<x><c><v>{a}</v></c><c><v>{a}</v></c></x>");
        assert_eq!(scanned(&two), Ok(0));
        let runs = format!("<c><is><r><t>{a}</t></r><r><t>{a}</t></r></is></c>");
        assert_eq!(scanned(&runs), Err(Excess::Long));
        let within = format!("<c><v>{a}<c></c>{a}</v></c>");
        assert_eq!(scanned(&within), Err(Excess::Long));
    }

    #[test]
    fn nothing_hides_a_long_text_from_the_scan() {
        for part in [
            format!("<v>{}</v>", "a".repeat(LONG)),
            format!("<!--{}-->", "<".repeat(LONG)),
            format!("<c><![CDATA[{}]]></c>", "<".repeat(LONG)),
            format!("<?{}?>", "<".repeat(LONG)),
            format!("<v a=\"{}\"/>", "><".repeat(LONG)),
            format!("<v a='\"' b='{}'/>", ">".repeat(LONG)),
        ] {
            assert_eq!(scanned(&part), Err(Excess::Long), "{}", &part[..12]);
        }
    }

    #[test]
    fn markup_on_which_readers_differ_is_refused() {
        for part in [
            "<!DOCTYPE a>",
            "<a></b>",
            "<a>",
            "</a>",
            "<c><v></c></v>",
            "<!--->-->",
            "<?>",
            "<a",
            "<\0a>",
            "<>",
        ] {
            let refused = matches!(scanned(part), Err(Excess::Unsound(_)));
            assert!(refused, "{part:?} passed");
        }
    }

    #[test]
    fn what_the_library_keeps_is_counted() {
        assert_eq!(scanned("<a><!-- of a > b --><b c='>'/> d <?e?></a>"), Ok(0));
        let strings = "<sst uniqueCount=\"7\"><si><t>ab</t></si><si/></sst>";
        let held = scanned(strings).expect("sound markup");
        assert!((2 * 72 + 7 * 24..400).contains(&held), "{held}");
        let claim = scanned("<sst uniqueCount = '40000000000'/>").expect("sound markup");
        assert!(claim > 1 << 39, "{claim}");
        let font = format!("<font><name val='{}'/></font>", "a".repeat(30_000));
        let styles = format!("<s>{font}{}</s>", "<xf/>".repeat(1000));
        assert!(scanned(&styles).expect("sound markup") > 30_000_000);
        let hidden = format!("<c>{}</c>", "<xf/>".repeat(1000));
        assert!(scanned(&hidden).expect("sound markup") > 1_000_000);
    }
}
