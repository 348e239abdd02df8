//! Equations as MathML, with the look that the page gives them.
//!
//! A tree has no brackets, so the printer sets those that its operators need: a fraction bar, a root
//! and an exponent hold their parts together without any.

use super::function;
use super::name::{NameParts, greek};
use super::syntax::{Expression, Operator, Syntax, parse};
use std::fmt::Write as _;

/// Letters of the widest line of an equation that a page takes at the most.
const WIDEST: f64 = 72.0;

// How tightly parts hold together that are no operators, as [`Operator::binding`] has it of operators: a part that is
// looser than its place needs brackets.
const LOOSEST: u8 = 0;
const NOT: u8 = 5;
const MINUS: u8 = 13;
const SCIENTIFIC: u8 = 14;
const ATOM: u8 = 20;

/// An equation that is typeset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TypesetEquation<'t> {
    /// The contents of `math` elements between which a line may be broken; none where the equation is too wide for a
    /// page.
    pub pieces: Vec<String>,
    /// The equation as text, for readers who do not see it.
    pub text: &'t str,
    /// The words behind the equation, as in `, once a sample, held`.
    pub words: &'t str,
}

/// Typesets a line `name = expression` or `name' = expression`, with words behind it or not. Answers nothing where
/// the line is no equation of the language.
#[must_use]
pub fn equation(line: &str) -> Option<TypesetEquation<'_>> {
    let (left, right) = line.split_once(" = ")?;
    let (tree, length) = leading(right)?;
    let words = &right[length..];
    let text = &line[..line.len() - words.len()];
    let bare = left.trim_end_matches('\'');
    let Syntax::Name(name) = parse(bare).ok()?.kind else {
        return None;
    };
    let primes = left.len() - bare.len();
    let mut pieces = terms(&tree);
    let left = derivative(&name, primes);
    let first = format!("{}<mo>=</mo>{}", left.mathml, pieces[0].mathml);
    pieces[0].width += left.width + 2.0;
    pieces[0].mathml = first;
    let widths = pieces.iter().map(|piece| piece.width);
    let is_too_wide = widths.clone().any(|width| width > WIDEST);
    let fits_a_line = widths.sum::<f64>() <= WIDEST;
    let pieces = pieces.into_iter().map(|piece| piece.mathml);
    let pieces = match (is_too_wide, fits_a_line) {
        (true, _) => Vec::new(),
        (false, true) => vec![pieces.collect()],
        (false, false) => pieces.collect(),
    };
    Some(TypesetEquation {
        pieces,
        text,
        words,
    })
}

/// The expression that a text begins with, and its length; behind it may stand a comma and words.
fn leading(text: &str) -> Option<(Expression, usize)> {
    let fault = match parse(text) {
        Ok(tree) => return Some((tree, text.len())),
        Err(fault) => fault,
    };
    let comma = fault.span.start;
    let words = text.get(comma..)?.strip_prefix(", ")?;
    let is_of_words = |c: char| c.is_alphabetic() || " ,".contains(c);
    let tree = words
        .chars()
        .all(is_of_words)
        .then(|| parse(&text[..comma]));
    Some((tree?.ok()?, comma))
}

/// The terms of a sum as they stand one behind the other, each with the sign before it.
fn terms(tree: &Expression) -> Vec<Typeset> {
    let Some((operator, [left, right])) = sum(tree) else {
        return vec![typeset(tree)];
    };
    let mut drawn = match sum(left) {
        Some(_) => terms(left),
        None => vec![within(left, operator.binding().0)],
    };
    let last = right_of(operator, right);
    drawn.push(Typeset {
        mathml: format!("{}{}", sign(operator, " form=\"infix\""), last.mathml),
        width: last.width + 2.0,
        ..last
    });
    drawn
}

fn sum(tree: &Expression) -> Option<(Operator, &[Expression; 2])> {
    match &tree.kind {
        Syntax::Binary(operator @ (Operator::Add | Operator::Subtract), sides) => {
            Some((*operator, sides))
        }
        _ => None,
    }
}

/// A part of an equation as MathML.
struct Typeset {
    mathml: String,
    /// How tightly the part holds together.
    binding: u8,
    /// The width in letters, roughly.
    width: f64,
    /// Whether the part is taller than a line, so that brackets around it grow.
    is_tall: bool,
}

impl Typeset {
    fn new(mathml: String, binding: u8, width: f64) -> Typeset {
        Typeset {
            mathml,
            binding,
            width,
            is_tall: false,
        }
    }

    fn bracketed(self) -> Typeset {
        let stretchy = self.is_tall;
        let mathml = format!(
            "<mrow><mo stretchy=\"{stretchy}\">(</mo>{}<mo stretchy=\"{stretchy}\">)</mo></mrow>",
            self.mathml
        );
        Typeset {
            mathml,
            binding: ATOM,
            width: self.width + 2.0,
            ..self
        }
    }
}

/// A part in a place that needs it to hold together at least as tightly as `least`.
fn within(tree: &Expression, least: u8) -> Typeset {
    let part = typeset(tree);
    match part.binding < least {
        true => part.bracketed(),
        false => part,
    }
}

/// The right operand; a minus does not stand behind another sign.
fn right_of(operator: Operator, tree: &Expression) -> Typeset {
    let (_, least) = operator.binding();
    let part = within(tree, least);
    match part.binding == MINUS {
        true => part.bracketed(),
        false => part,
    }
}

fn typeset(tree: &Expression) -> Typeset {
    match &tree.kind {
        Syntax::Number(value) => number(*value),
        Syntax::Name(name) => derivative(name, 0),
        Syntax::Negative(inner) => prefixed("−", inner, MINUS),
        Syntax::Not(inner) => prefixed("not", inner, NOT),
        Syntax::Binary(operator, sides) => binary(*operator, sides),
        Syntax::Call(name, arguments) => call(name, arguments),
    }
}

fn prefixed(sign: &str, inner: &Expression, binding: u8) -> Typeset {
    let inner = within(inner, binding);
    Typeset {
        mathml: format!(
            "<mrow><mo form=\"prefix\">{sign}</mo>{}</mrow>",
            inner.mathml
        ),
        binding,
        width: inner.width + sign.chars().count() as f64 + 0.5,
        ..inner
    }
}

/// A number as people write it: `1e-9` is 10 to the power of −9.
fn number(value: f64) -> Typeset {
    let plain = value.to_string();
    let (mantissa, exponent) = match value == 0.0 || (1e-4..1e7).contains(&value.abs()) {
        true => (plain, None),
        false => {
            let parts = format!("{value:e}");
            let (mantissa, exponent) = parts.split_once('e').unwrap_or((&plain, "0"));
            (mantissa.to_owned(), Some(exponent.replace('-', "−")))
        }
    };
    let width = mantissa.len() as f64;
    let Some(exponent) = exponent else {
        return Typeset::new(format!("<mn>{mantissa}</mn>"), ATOM, width);
    };
    let ten = format!("<msup><mn>10</mn><mn>{exponent}</mn></msup>");
    let mathml = match mantissa == "1" {
        true => ten,
        false => format!("<mrow><mn>{mantissa}</mn><mo>×</mo>{ten}</mrow>"),
    };
    Typeset::new(mathml, SCIENTIFIC, width + 5.0)
}

/// A name, with as many dots above it as `primes` says.
fn derivative(name: &str, primes: usize) -> Typeset {
    let NameParts { base, index } = NameParts::of(name);
    let width = base.chars().count() as f64 + 0.7 * index.chars().count() as f64;
    let base = format!("<mi>{base}</mi>");
    let base = match primes {
        0 => base,
        1 => format!("<mover>{base}<mo>˙</mo></mover>"),
        2 => format!("<mover>{base}<mo>¨</mo></mover>"),
        _ => format!("<msup>{base}<mo>{}</mo></msup>", "′".repeat(primes)),
    };
    Typeset::new(indexed(base, &index), ATOM, width)
}

fn indexed(base: String, index: &str) -> String {
    let is_number = index.chars().all(|c| c.is_ascii_digit());
    match (index, is_number) {
        ("", _) => base,
        (_, true) => format!("<msub>{base}<mn>{index}</mn></msub>"),
        (_, false) => format!("<msub>{base}<mtext>{index}</mtext></msub>"),
    }
}

fn binary(operator: Operator, sides: &[Expression; 2]) -> Typeset {
    let [left, right] = sides;
    match operator {
        Operator::Divide => fraction(left, right),
        Operator::Power => power(left, right),
        _ => infix(operator, left, right),
    }
}

fn infix(operator: Operator, left: &Expression, right: &Expression) -> Typeset {
    let (binding, above) = operator.binding();
    // A comparison of a comparison would be read as a range.
    let least = match operator.binding() == Operator::Less.binding() {
        true => above,
        false => binding,
    };
    let (left, right) = (within(left, least), right_of(operator, right));
    Typeset {
        mathml: format!(
            "<mrow>{}{}{}</mrow>",
            left.mathml,
            sign(operator, ""),
            right.mathml
        ),
        binding,
        width: left.width + right.width + 2.0,
        is_tall: left.is_tall || right.is_tall,
    }
}

fn power(base: &Expression, exponent: &Expression) -> Typeset {
    let (binding, _) = Operator::Power.binding();
    // A fraction holds together by itself, but not below an exponent.
    let base = match base.kind {
        Syntax::Binary(..) => typeset(base).bracketed(),
        _ => within(base, binding),
    };
    let exponent = typeset(exponent);
    Typeset {
        mathml: format!("<msup>{}{}</msup>", base.mathml, row(&exponent)),
        binding,
        width: base.width + 0.7 * exponent.width,
        is_tall: base.is_tall || exponent.is_tall,
    }
}

fn fraction(above: &Expression, below: &Expression) -> Typeset {
    let (above, below) = (typeset(above), typeset(below));
    Typeset {
        mathml: format!("<mfrac>{}{}</mfrac>", row(&above), row(&below)),
        binding: ATOM,
        width: above.width.max(below.width) + 0.5,
        is_tall: true,
    }
}

/// A part as one element, as an element with a fixed number of parts needs it.
fn row(part: &Typeset) -> String {
    format!("<mrow>{}</mrow>", part.mathml)
}

fn sign(operator: Operator, attributes: &str) -> String {
    let symbol = match operator {
        Operator::Subtract => "−",
        Operator::Multiply => "·",
        Operator::LessOrEqual => "≤",
        Operator::GreaterOrEqual => "≥",
        Operator::Less => "&lt;",
        Operator::Greater => "&gt;",
        operator => operator.symbol(),
    };
    format!("<mo{attributes}>{symbol}</mo>")
}

fn call(name: &str, arguments: &[Expression]) -> Typeset {
    match (name, arguments) {
        ("sqrt", [inner]) => {
            let inner = typeset(inner);
            Typeset {
                mathml: format!("<msqrt>{}</msqrt>", inner.mathml),
                binding: ATOM,
                width: inner.width + 1.5,
                ..inner
            }
        }
        ("abs", [inner]) => {
            let inner = typeset(inner);
            let bar = |form: &str| {
                let stretchy = inner.is_tall;
                format!("<mo form=\"{form}\" stretchy=\"{stretchy}\">|</mo>")
            };
            let (open, close) = (bar("prefix"), bar("postfix"));
            Typeset {
                mathml: format!("<mrow>{open}{}{close}</mrow>", inner.mathml),
                binding: ATOM,
                width: inner.width + 2.0,
                ..inner
            }
        }
        ("if", [_, _, _]) => cases(arguments),
        _ => function_call(name, arguments),
    }
}

fn function_call(name: &str, arguments: &[Expression]) -> Typeset {
    let arguments: Vec<Typeset> = arguments.iter().map(typeset).collect();
    let parts: Vec<&str> = arguments.iter().map(|part| part.mathml.as_str()).collect();
    let widths = arguments.iter().map(|part| part.width + 1.0);
    let inner = Typeset {
        mathml: parts.join("<mo>,</mo>"),
        binding: LOOSEST,
        width: widths.sum(),
        is_tall: arguments.iter().any(|part| part.is_tall),
    };
    let inner = inner.bracketed();
    // A short name that the language does not have is that of a table, and may have an index.
    let is_word = function::find(name).is_some() || name.chars().count() > 4;
    let head = match is_word {
        true => format!("<mi>{}</mi>", greek(name).unwrap_or(name)),
        false => derivative(name, 0).mathml,
    };
    Typeset {
        mathml: format!("<mrow>{head}{}</mrow>", inner.mathml),
        width: inner.width + name.chars().count() as f64,
        ..inner
    }
}

/// The cases of an `if`, one below the other; an `if` in the last place gives more of them.
fn cases(arguments: &[Expression]) -> Typeset {
    let mut rows = String::new();
    let mut width: f64 = 0.0;
    let mut rest = arguments;
    while let [condition, then, otherwise] = rest {
        let (value, condition) = (typeset(then), typeset(condition));
        push_case(
            &mut rows,
            &value,
            &format!("<mtext>if\u{a0}</mtext>{}", condition.mathml),
        );
        width = width.max(value.width + condition.width + 5.0);
        rest = match &otherwise.kind {
            Syntax::Call(name, next) if name == "if" && next.len() == 3 => next,
            _ => {
                let value = typeset(otherwise);
                push_case(&mut rows, &value, "<mtext>otherwise</mtext>");
                width = width.max(value.width + 11.0);
                &[]
            }
        };
    }
    Typeset {
        mathml: format!(
            "<mrow><mo stretchy=\"true\" form=\"prefix\">{{</mo><mtable>{rows}</mtable></mrow>"
        ),
        binding: LOOSEST,
        width: width + 1.0,
        is_tall: true,
    }
}

fn push_case(rows: &mut String, value: &Typeset, when: &str) {
    let value = &value.mathml;
    write!(rows, "<mtr><mtd>{value}</mtd><mtd>{when}</mtd></mtr>")
        .expect("writing to a string does not fail");
}

#[cfg(test)]
mod tests;
