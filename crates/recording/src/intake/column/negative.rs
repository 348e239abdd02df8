//! Negative numbers without a minus before them, as accountants and their programs write them.

use crate::intake::options::Decimal;
use crate::intake::value;

/// How a negative number is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NegativeForm {
    /// `-1.5`.
    Minus,
    /// `(1.5)`.
    Parentheses,
    /// `1.5-`.
    MinusBehind,
}

/// The negative numbers of a column.
#[derive(Debug, Default)]
pub(super) struct Negatives {
    form: Option<NegativeForm>,
    count: usize,
}

impl Negatives {
    /// Counts a negative number; false where those before it are written another way.
    pub(super) fn take(&mut self, form: NegativeForm) -> bool {
        let is_same = *self.form.get_or_insert(form) == form;
        self.count += usize::from(is_same);
        is_same
    }

    /// How many numbers have no minus before them, which among texts may be no numbers.
    pub(super) fn without_minus(&self) -> usize {
        match self.form {
            None | Some(NegativeForm::Minus) => 0,
            Some(NegativeForm::Parentheses | NegativeForm::MinusBehind) => self.count,
        }
    }

    /// A sentence on negative numbers without a minus before them.
    pub(super) fn assumption(&self) -> Option<String> {
        let count = self.count;
        match self.form? {
            NegativeForm::Minus => None,
            NegativeForm::Parentheses => Some(format!(
                "{count} samples are in parentheses: they were read as negative"
            )),
            NegativeForm::MinusBehind => Some(format!(
                "{count} samples have a minus behind them: they were read as negative"
            )),
        }
    }
}

/// The number that parentheses or a minus behind it make negative.
pub(super) fn number(text: &str, decimal: Option<Decimal>) -> Option<(f64, NegativeForm)> {
    let parted = text
        .strip_prefix('(')
        .and_then(|text| text.strip_suffix(')'));
    let (digits, form) = match parted {
        Some(digits) => (digits, NegativeForm::Parentheses),
        None => (text.strip_suffix(['-', '−'])?, NegativeForm::MinusBehind),
    };
    let digits = digits.trim();
    let is_unsigned = digits.starts_with(|c: char| c.is_numeric() || ".,".contains(c));
    let number = value::number(digits, decimal).filter(|_| is_unsigned)?;
    Some((-number, form))
}
