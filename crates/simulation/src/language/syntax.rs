//! The text of an expression to its tree.
//!
//! A precedence-climbing (Pratt) parser: `or`, `and`, `not`, comparison, `+ -`, `* /`, unary
//! minus, `^` (to the right), then numbers, names, calls and parentheses. Length and depth are
//! bounded; every node knows where in the text it stands.

pub use super::token::{Operator, SyntaxError, TextSpan};
use super::token::{Token, tokens};

/// The bytes of one expression at the most.
pub const MAX_BYTES: usize = 4096;

/// How deep an expression may be nested.
pub const MAX_DEPTH: usize = 64;

/// The operations of one expression at the most, which also bounds the depth of its tree.
pub const MAX_OPERATIONS: usize = 256;

/// A node of the tree.
#[derive(Clone, Debug, PartialEq)]
pub struct Expression {
    /// The place of the expression in the text.
    pub span: TextSpan,
    /// The operation of the node, with its operands.
    pub kind: Syntax,
}

/// The operation of a node, with its operands.
#[derive(Clone, Debug, PartialEq)]
pub enum Syntax {
    /// A literal.
    Number(f64),
    /// The name of a quantity.
    Name(String),
    /// `-a`.
    Negative(Box<Expression>),
    /// `not a`.
    Not(Box<Expression>),
    /// `a ∘ b`.
    Binary(Operator, Box<[Expression; 2]>),
    /// `f(a, b, …)`.
    Call(String, Vec<Expression>),
}

/// `not` binds tighter than `and`, the minus of one operand tighter than `*` but not than `^`.
const NOT_BINDING: u8 = 5;
const MINUS_BINDING: u8 = 13;

/// Reads a whole text as one expression.
///
/// # Errors
/// The first place that cannot be understood.
pub fn parse(text: &str) -> Result<Expression, SyntaxError> {
    if text.len() > MAX_BYTES {
        let detail = format!(
            "{} bytes are more than {MAX_BYTES}; name parts of it under `quantities`",
            text.len()
        );
        let span = TextSpan::default();
        return Err(SyntaxError { span, detail });
    }
    let mut parser = Parser {
        tokens: tokens(text)?,
        next: 0,
        depth: 0,
        operations: 0,
    };
    let expression = parser.expression(0)?;
    match parser.peek() {
        (Token::End, _) => Ok(expression),
        (token, span) => Err(SyntaxError {
            span,
            detail: format!("{token} is not expected here"),
        }),
    }
}

struct Parser<'t> {
    tokens: Vec<(Token<'t>, TextSpan)>,
    next: usize,
    depth: usize,
    operations: usize,
}

impl<'t> Parser<'t> {
    fn peek(&self) -> (Token<'t>, TextSpan) {
        let last = self.tokens.len() - 1;
        self.tokens[self.next.min(last)]
    }

    fn take(&mut self) -> (Token<'t>, TextSpan) {
        let taken = self.peek();
        self.next += 1;
        taken
    }

    /// An expression whose operators bind at least as tightly as `least`.
    fn expression(&mut self, least: u8) -> Result<Expression, SyntaxError> {
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            let (_, span) = self.peek();
            let detail = format!("the expression is nested deeper than {MAX_DEPTH}");
            return Err(SyntaxError { span, detail });
        }
        let mut left = self.operand()?;
        while let (Token::Operator(operator), _) = self.peek() {
            let (binds_left, binds_right) = operator.binding();
            if binds_left < least {
                break;
            }
            self.operations += 1;
            let (_, span) = self.take();
            if self.operations > MAX_OPERATIONS {
                let detail = format!(
                    "more than {MAX_OPERATIONS} operations; name parts of it under `quantities`"
                );
                return Err(SyntaxError { span, detail });
            }
            let right = self.expression(binds_right)?;
            left = Expression {
                span: left.span.to(right.span),
                kind: Syntax::Binary(operator, Box::new([left, right])),
            };
        }
        self.depth -= 1;
        Ok(left)
    }

    fn operand(&mut self) -> Result<Expression, SyntaxError> {
        let (token, span) = self.take();
        match token {
            Token::Number(value) => Ok(Expression {
                span,
                kind: Syntax::Number(value),
            }),
            Token::Operator(Operator::Subtract) => {
                let inner = self.expression(MINUS_BINDING)?;
                Ok(Expression {
                    span: span.to(inner.span),
                    kind: Syntax::Negative(Box::new(inner)),
                })
            }
            Token::Operator(Operator::Add) => self.expression(MINUS_BINDING),
            Token::Not => {
                let inner = self.expression(NOT_BINDING)?;
                Ok(Expression {
                    span: span.to(inner.span),
                    kind: Syntax::Not(Box::new(inner)),
                })
            }
            Token::Open => {
                let inner = self.expression(0)?;
                let close = self.close()?;
                Ok(Expression {
                    span: span.to(close),
                    kind: inner.kind,
                })
            }
            Token::Name(name) if self.peek().0 == Token::Open => self.call(name, span),
            Token::Name(name) => Ok(Expression {
                span,
                kind: Syntax::Name(name.to_owned()),
            }),
            token => Err(SyntaxError {
                span,
                detail: format!("a number, a name or `(` is expected here, not {token}"),
            }),
        }
    }

    fn call(&mut self, name: &str, span: TextSpan) -> Result<Expression, SyntaxError> {
        self.take();
        let mut arguments = Vec::new();
        if self.peek().0 != Token::Close {
            arguments.push(self.expression(0)?);
            while self.peek().0 == Token::Comma {
                self.take();
                arguments.push(self.expression(0)?);
            }
        }
        let close = self.close()?;
        Ok(Expression {
            span: span.to(close),
            kind: Syntax::Call(name.to_owned(), arguments),
        })
    }

    fn close(&mut self) -> Result<TextSpan, SyntaxError> {
        match self.take() {
            (Token::Close, span) => Ok(span),
            (token, span) => Err(SyntaxError {
                span,
                detail: format!("`)` is expected here, not {token}"),
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The tree as fully bracketed text.
    fn shown(expression: &Expression) -> String {
        match &expression.kind {
            Syntax::Number(value) => value.to_string(),
            Syntax::Name(name) => name.clone(),
            Syntax::Negative(inner) => format!("(-{})", shown(inner)),
            Syntax::Not(inner) => format!("(not {})", shown(inner)),
            Syntax::Binary(operator, sides) => {
                let [left, right] = sides.as_ref();
                format!("({} {} {})", shown(left), operator.symbol(), shown(right))
            }
            Syntax::Call(name, arguments) => {
                let arguments: Vec<String> = arguments.iter().map(shown).collect();
                format!("{name}({})", arguments.join(", "))
            }
        }
    }

    #[test]
    fn operators_bind_as_they_do_in_a_book() {
        for (text, tree) in [
            ("a - b - c", "((a - b) - c)"),
            ("a + b*c^2", "(a + (b * (c ^ 2)))"),
            ("2^3^2", "(2 ^ (3 ^ 2))"),
            ("-x^2", "(-(x ^ 2))"),
            ("a*-b", "(a * (-b))"),
            ("2^-1", "(2 ^ (-1))"),
            (
                "a < b and not c > d or e <= f",
                "(((a < b) and (not (c > d))) or (e <= f))",
            ),
            ("f(x, g(), 1e-3)", "f(x, g(), 0.001)"),
            (".5 * (a)", "(0.5 * a)"),
        ] {
            let parsed = parse(text).unwrap_or_else(|error| panic!("{text}: {error:?}"));
            assert_eq!(shown(&parsed), tree);
        }
    }

    #[test]
    fn a_fault_names_the_line_and_the_column() {
        let text = "a +\n  b ) c";
        let error = parse(text).unwrap_err();
        assert_eq!(error.span.place(text), (2, 5));
        assert!(error.detail.contains("`)` is not expected"), "{error:?}");
        for (wrong, hint) in [
            ("a == b", "equality"),
            ("a &&b", "`and`"),
            ("1e999", "number"),
        ] {
            assert!(parse(wrong).unwrap_err().detail.contains(hint), "{wrong}");
        }
    }

    #[test]
    fn depth_and_length_are_bounded() {
        for hostile in [
            "(".repeat(4000),
            "-".repeat(4000),
            "1+".repeat(2000) + "1",
            "2^".repeat(2000) + "2",
            "f(".repeat(2000),
            "x".repeat(5000),
        ] {
            assert!(parse(&hostile).is_err() || hostile.starts_with('x'));
        }
        assert!(parse(&"x".repeat(5000)).is_err());
    }

    proptest! {
        #[test]
        fn no_text_makes_the_parser_panic(text in "\\PC{0,200}") {
            drop(parse(&text));
        }

        #[test]
        fn no_mixture_of_tokens_makes_the_parser_panic(
            parts in proptest::collection::vec(
                prop_oneof!["[a-z]{1,3}", "[0-9.e+-]{1,6}", "[-+*/^(),<>=&|!]", "and|or|not", "\\s"],
                0..80,
            )
        ) {
            if let Err(error) = parse(&parts.concat()) {
                prop_assert!(error.span.end <= parts.concat().len());
            }
        }
    }
}
