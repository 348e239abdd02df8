//! Rows of several things in one list: a field of words that tells apart rows of one time, or takes turns.

use super::super::super::error::at_pointer;
use super::super::leaf::JsonLeaf;
use super::naming::is_name_field;
use greybox_numerics::parsing::Fault;
use std::cmp::Ordering;
use std::collections::HashSet;

/// A field of more different words tells no signals apart.
const MOST_WORDS: usize = 1000;

/// The field that the places of lists without names are looked at as.
pub(super) const PLACE: &str = "";

/// The fields of words of a list of rows, in the order in which they came.
#[derive(Default)]
pub(super) struct MixedRows {
    fields: Vec<WordField>,
}

/// A field of words by now.
struct WordField {
    scope: String,
    key: String,
    words: HashSet<String>,
    last: String,
    time: Option<JsonLeaf>,
    /// The words at the last time.
    at_time: Vec<String>,
    rows: usize,
    /// Rows with another word than the row before.
    changes: usize,
    /// Rows with the time of the row before and another word.
    shared: usize,
    /// Rows with an earlier time than the row before, and those of them with another word.
    falls: usize,
    falls_at_change: usize,
    /// Rows with a later time than the row before, and those of them with another word.
    rises: usize,
    rises_at_change: usize,
    /// A word came twice at one time.
    repeats: bool,
}

impl MixedRows {
    /// Looks at a word of a row of a list; `scope` is the name of the list.
    pub(super) fn observe(&mut self, scope: &str, [key, word]: [&str; 2], time: &JsonLeaf) {
        let mut fields = self.fields.iter_mut();
        match fields.find(|field| field.key == key && field.scope == scope) {
            Some(field) => field.observe(word, time),
            None => {
                let mut field = WordField::new(scope, key);
                field.observe(word, time);
                self.fields.push(field);
            }
        }
    }

    /// The fault that asks where a field tells rows apart.
    pub(super) fn question(&self) -> Option<Fault> {
        let mut fields = self.fields.iter();
        let key = &fields.find(|field| field.tells_apart())?.key;
        let detail = match key.as_str() {
            PLACE => "lists of one signal have samples of the same times: give the object of each a name of its own, \
                      such as \"name\": \"PT\""
                .to_owned(),
            key => format!(
                "rows of several things stand in one list and differ by `{key}`: say tag={key}, and each number is a \
                 signal of what `{key}` names, or ignore={key}"
            ),
        };
        Some(Fault {
            parameter: (key != PLACE).then(|| "tag".into()),
            ..at_pointer(String::new(), "layout_unclear", detail)
        })
    }
}

impl WordField {
    fn new(scope: &str, key: &str) -> Self {
        Self {
            scope: scope.to_owned(),
            key: key.to_owned(),
            words: HashSet::new(),
            last: String::new(),
            time: None,
            at_time: Vec::new(),
            rows: 0,
            changes: 0,
            shared: 0,
            falls: 0,
            falls_at_change: 0,
            rises: 0,
            rises_at_change: 0,
            repeats: false,
        }
    }

    fn observe(&mut self, word: &str, time: &JsonLeaf) {
        let is_change = self.rows > 0 && self.last != word;
        let order = self.time.as_ref().and_then(|before| compared(before, time));
        self.changes += usize::from(is_change);
        match order {
            Some(Ordering::Equal) => {
                self.shared += usize::from(is_change);
                self.repeats |= self.at_time.iter().any(|earlier| earlier == word);
            }
            order => {
                let (falls, rises) = (
                    order == Some(Ordering::Greater),
                    order == Some(Ordering::Less),
                );
                self.falls += usize::from(falls);
                self.falls_at_change += usize::from(falls && is_change);
                self.rises += usize::from(rises);
                self.rises_at_change += usize::from(rises && is_change);
                self.at_time.clear();
            }
        }
        if self.at_time.len() < MOST_WORDS {
            self.at_time.push(word.to_owned());
        }
        if self.words.len() <= MOST_WORDS && !self.words.contains(word) {
            self.words.insert(word.to_owned());
        }
        if self.last != word {
            word.clone_into(&mut self.last);
        }
        self.time = Some(time.clone());
        self.rows += 1;
    }

    /// Whether rows of one time differ by the word, blocks of rows begin again with another word, or the words of
    /// a field that names things take turns.
    fn tells_apart(&self) -> bool {
        let words = self.words.len();
        let is_place = self.key == PLACE;
        let names = is_place || is_name_field(&self.key);
        // A word of its own in each row numbers the rows, where they are not of one time.
        let are_few = match names {
            true => words < self.rows || self.shared + 1 == self.rows,
            false => 2 * words <= self.rows,
        };
        if !(2..=MOST_WORDS).contains(&words) || !are_few || self.repeats {
            return false;
        }
        let begin_again = self.falls > 0 && self.falls == self.falls_at_change;
        let end_again = self.rises > 0 && self.rises == self.rises_at_change;
        let are_blocks =
            begin_again && self.falls < self.rises || end_again && self.rises < self.falls;
        let takes_turns = names && self.changes >= words;
        // Lists that follow each other may share a sample, and a state may change within the step of the clock.
        let shares = match (is_place, names) {
            (true, _) => 2 * self.shared + 1 >= self.rows,
            (false, true) => self.shared > 0,
            (false, false) => 4 * self.shared >= self.rows,
        };
        shares || are_blocks || takes_turns
    }
}

/// How the time of a row follows that of the row before, where both are written alike.
fn compared(before: &JsonLeaf, time: &JsonLeaf) -> Option<Ordering> {
    let number = |leaf: &JsonLeaf| match leaf {
        JsonLeaf::Integer(number) => Some(*number as f64),
        JsonLeaf::Number(number) => Some(*number),
        _ => None,
    };
    match (before, time) {
        (JsonLeaf::Text(before), JsonLeaf::Text(time)) => Some(before.cmp(time)),
        _ => number(before)?.partial_cmp(&number(time)?),
    }
}
