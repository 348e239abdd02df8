//! The text of an expression to its words.

use std::fmt;

/// Where something stands in the text of an expression, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TextSpan {
    /// The first byte.
    pub start: usize,
    /// Behind the last byte.
    pub end: usize,
}

impl TextSpan {
    /// The line and the column of the start, both from 1, in characters.
    #[must_use]
    pub fn place(self, text: &str) -> (u64, u64) {
        let before = text.get(..self.start).unwrap_or(text);
        let line = before.matches('\n').count() as u64 + 1;
        let column = before.chars().rev().take_while(|c| *c != '\n').count() as u64 + 1;
        (line, column)
    }

    /// From here to the end of another.
    #[must_use]
    pub fn to(self, end: TextSpan) -> TextSpan {
        TextSpan {
            start: self.start,
            end: end.end,
        }
    }
}

/// What stands between two operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operator {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
    And,
    Or,
}

impl Operator {
    /// The operator as an author writes it.
    #[must_use]
    pub fn symbol(self) -> &'static str {
        match self {
            Operator::Add => "+",
            Operator::Subtract => "-",
            Operator::Multiply => "*",
            Operator::Divide => "/",
            Operator::Power => "^",
            Operator::Less => "<",
            Operator::LessOrEqual => "<=",
            Operator::Greater => ">",
            Operator::GreaterOrEqual => ">=",
            Operator::And => "and",
            Operator::Or => "or",
        }
    }

    /// How tightly it binds its left and its right operand.
    #[must_use]
    pub fn binding(self) -> (u8, u8) {
        match self {
            Operator::Or => (1, 2),
            Operator::And => (3, 4),
            Operator::Less
            | Operator::LessOrEqual
            | Operator::Greater
            | Operator::GreaterOrEqual => (7, 8),
            Operator::Add | Operator::Subtract => (9, 10),
            Operator::Multiply | Operator::Divide => (11, 12),
            Operator::Power => (16, 15),
        }
    }
}

/// Why a text is no expression.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SyntaxError {
    /// Where.
    pub span: TextSpan,
    /// What is wrong, as a sentence.
    pub detail: String,
}

/// A word of an expression.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Token<'t> {
    Number(f64),
    Name(&'t str),
    Operator(Operator),
    Not,
    Open,
    Close,
    Comma,
    End,
}

impl fmt::Display for Token<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Token::Number(value) => write!(formatter, "the number {value}"),
            Token::Name(name) => {
                let name: String = name.chars().take(40).collect();
                write!(formatter, "the name `{name}`")
            }
            Token::Operator(operator) => write!(formatter, "`{}`", operator.symbol()),
            Token::Not => formatter.write_str("`not`"),
            Token::Open => formatter.write_str("`(`"),
            Token::Close => formatter.write_str("`)`"),
            Token::Comma => formatter.write_str("`,`"),
            Token::End => formatter.write_str("the end"),
        }
    }
}

/// The words of a text, the last of them its end.
pub fn tokens(text: &str) -> Result<Vec<(Token<'_>, TextSpan)>, SyntaxError> {
    let mut tokens = Vec::new();
    let mut at = 0;
    while let Some(first) = text[at..].chars().next() {
        if first.is_whitespace() {
            at += first.len_utf8();
            continue;
        }
        let rest = &text[at..];
        let (token, length) = if first.is_ascii_digit() || first == '.' {
            number(rest, at)?
        } else if first.is_alphabetic() || first == '_' {
            let is_part = |c: char| c.is_alphanumeric() || c == '_';
            let length = rest.find(|c| !is_part(c)).unwrap_or(rest.len());
            (word(&rest[..length]), length)
        } else {
            symbol(rest, at)?
        };
        let span = TextSpan {
            start: at,
            end: at + length,
        };
        tokens.push((token, span));
        at += length;
    }
    let end = TextSpan { start: at, end: at };
    tokens.push((Token::End, end));
    Ok(tokens)
}

fn word(name: &str) -> Token<'_> {
    match name {
        "and" => Token::Operator(Operator::And),
        "or" => Token::Operator(Operator::Or),
        "not" => Token::Not,
        _ => Token::Name(name),
    }
}

fn number(rest: &str, at: usize) -> Result<(Token<'_>, usize), SyntaxError> {
    let bytes = rest.as_bytes();
    let digits = |from: usize| {
        let count = bytes[from..].iter().take_while(|b| b.is_ascii_digit());
        from + count.count()
    };
    let mut end = digits(0);
    if bytes.get(end) == Some(&b'.') {
        end = digits(end + 1);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let signed = matches!(bytes.get(end + 1), Some(b'+' | b'-'));
        let exponent = end + 1 + usize::from(signed);
        let last = digits(exponent);
        if last > exponent {
            end = last;
        }
    }
    let value = rest[..end].parse::<f64>().ok().filter(|v| v.is_finite());
    let value = value.ok_or_else(|| SyntaxError {
        span: TextSpan {
            start: at,
            end: at + end,
        },
        detail: format!("`{}` is not a number", &rest[..end]),
    })?;
    Ok((Token::Number(value), end))
}

fn symbol(rest: &str, at: usize) -> Result<(Token<'_>, usize), SyntaxError> {
    const SYMBOLS: [(&str, Token<'static>); 16] = [
        ("<=", Token::Operator(Operator::LessOrEqual)),
        (">=", Token::Operator(Operator::GreaterOrEqual)),
        ("<", Token::Operator(Operator::Less)),
        (">", Token::Operator(Operator::Greater)),
        ("**", Token::Operator(Operator::Power)),
        ("+", Token::Operator(Operator::Add)),
        ("-", Token::Operator(Operator::Subtract)),
        ("−", Token::Operator(Operator::Subtract)),
        ("*", Token::Operator(Operator::Multiply)),
        ("·", Token::Operator(Operator::Multiply)),
        ("/", Token::Operator(Operator::Divide)),
        ("^", Token::Operator(Operator::Power)),
        ("(", Token::Open),
        (")", Token::Close),
        (",", Token::Comma),
        ("\u{d7}", Token::Operator(Operator::Multiply)),
    ];
    for (text, token) in SYMBOLS {
        if rest.starts_with(text) {
            return Ok((token, text.len()));
        }
    }
    let first = rest.chars().next().unwrap_or(' ');
    let hint = match first {
        '=' => "; there is no test for equality, only <, <=, > and >=",
        '&' => "; write `and`",
        '|' => "; write `or` or `abs(…)`",
        '!' => "; write `not`",
        _ => "",
    };
    Err(SyntaxError {
        span: TextSpan {
            start: at,
            end: at + first.len_utf8(),
        },
        detail: format!("`{first}` is not part of an expression{hint}"),
    })
}
