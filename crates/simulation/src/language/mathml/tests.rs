//! Equations in MathML are read back by a reader of their own and compared with the expressions.

use super::super::function;
use super::super::syntax::{Expression, Operator, Syntax, TextSpan, parse};
use super::equation;
use crate::model::Catalogue;
use proptest::prelude::*;

/// Names of quantities, and how each is set.
const NAMES: [(&str, &str); 8] = [
    ("x", "<mi>x</mi>"),
    ("x_1", "<msub><mi>x</mi><mn>1</mn></msub>"),
    ("p_a", "<msub><mi>p</mi><mtext>a</mtext></msub>"),
    ("Km", "<msub><mi>K</mi><mtext>m</mtext></msub>"),
    ("area", "<mi>area</mi>"),
    ("alpha", "<mi>α</mi>"),
    ("tau1", "<msub><mi>τ</mi><mn>1</mn></msub>"),
    ("Delta_p_s", "<msub><mi>Δ</mi><mtext>p s</mtext></msub>"),
];

/// An element with its parts; text stands in an element without a tag.
#[derive(Debug, Default)]
struct Element {
    tag: String,
    attributes: String,
    text: String,
    parts: Vec<Element>,
}

impl Element {
    /// Reads MathML; every element is closed.
    fn read(mathml: &str) -> Element {
        let mut open = vec![Element::default()];
        let mut rest = mathml;
        while !rest.is_empty() {
            if let Some(closed) = rest.strip_prefix("</") {
                let (tag, after) = closed.split_once('>').unwrap();
                let element = open.pop().unwrap();
                assert_eq!(element.tag, tag);
                open.last_mut().unwrap().parts.push(element);
                rest = after;
            } else if let Some(opened) = rest.strip_prefix('<') {
                let (head, after) = opened.split_once('>').unwrap();
                let (tag, attributes) = head.split_once(' ').unwrap_or((head, ""));
                open.push(Element {
                    tag: tag.to_owned(),
                    attributes: attributes.to_owned(),
                    ..Element::default()
                });
                rest = after;
            } else {
                let (text, _) = rest.split_at(rest.find('<').unwrap_or(rest.len()));
                open.last_mut().unwrap().text.push_str(text);
                rest = &rest[text.len()..];
            }
        }
        assert_eq!(open.len(), 1);
        open.remove(0)
    }

    fn written(&self) -> String {
        let parts: String = self.parts.iter().map(Element::written).collect();
        format!("<{0}>{1}{parts}</{0}>", self.tag, self.text)
    }

    /// What a person reads, as a text of the language.
    fn linear(&self) -> String {
        if let Some((name, _)) = NAMES.iter().find(|(_, set)| *set == self.written()) {
            return (*name).to_owned();
        }
        let part = |place: usize| self.parts[place].linear();
        match self.tag.as_str() {
            "" | "mrow" | "mtd" => match &self.parts[..] {
                [brace, table] if brace.text == "{" => table.cases(),
                [mantissa, times, power] if times.text == "×" => {
                    format!("{}e{}", mantissa.text, power.exponent())
                }
                parts => parts.iter().map(Element::linear).collect(),
            },
            "mi" | "mn" => self.text.clone(),
            "mo" => self.sign(),
            "mfrac" => format!("(({})/({}))", part(0), part(1)),
            "msqrt" => {
                let inner: String = self.parts.iter().map(Element::linear).collect();
                format!("sqrt({inner})")
            }
            "msup" if self.parts[1].tag == "mn" => format!("1e{}", self.exponent()),
            "msup" => format!("{}^({})", part(0), part(1)),
            tag => panic!("{tag} in {}", self.written()),
        }
    }

    /// The exponent of a power of ten that is part of a number.
    fn exponent(&self) -> String {
        assert_eq!((&*self.tag, &*self.parts[0].text), ("msup", "10"));
        self.parts[1].text.replace('−', "-")
    }

    fn sign(&self) -> String {
        let is_prefix = self.attributes.contains("form=\"prefix\"");
        let text = match (self.text.as_str(), is_prefix) {
            ("|", true) => "abs(",
            ("|", false) => ")",
            ("−", _) => "-",
            ("·", _) => "*",
            ("≤", _) => "<=",
            ("≥", _) => ">=",
            ("&lt;", _) => "<",
            ("&gt;", _) => ">",
            (text, _) => text,
        };
        format!(" {text} ")
    }

    /// The rows of cases, as an `if` in an `if`.
    fn cases(&self) -> String {
        let mut text = String::new();
        for row in &self.parts {
            let [value, when] = &row.parts[..] else {
                panic!("{}", row.written());
            };
            let (word, condition) = when.parts.split_first().unwrap();
            let condition: String = condition.iter().map(Element::linear).collect();
            match word.text.as_str() {
                "otherwise" => text += &value.linear(),
                "if\u{a0}" => text += &format!("if({condition}, {}, ", value.linear()),
                word => panic!("{word}"),
            }
        }
        text + &")".repeat(self.parts.len() - 1)
    }
}

/// A tree without the places of its parts in a text.
fn without_places(tree: &Expression) -> Expression {
    let kind = match &tree.kind {
        Syntax::Negative(inner) => Syntax::Negative(Box::new(without_places(inner))),
        Syntax::Not(inner) => Syntax::Not(Box::new(without_places(inner))),
        Syntax::Binary(operator, sides) => {
            Syntax::Binary(*operator, Box::new(sides.each_ref().map(without_places)))
        }
        Syntax::Call(name, arguments) => {
            Syntax::Call(name.clone(), arguments.iter().map(without_places).collect())
        }
        leaf => leaf.clone(),
    };
    of_kind(kind)
}

fn of_kind(kind: Syntax) -> Expression {
    Expression {
        span: TextSpan::default(),
        kind,
    }
}

fn trees() -> impl Strategy<Value = Expression> {
    const OPERATORS: [Operator; 11] = [
        Operator::Add,
        Operator::Subtract,
        Operator::Multiply,
        Operator::Divide,
        Operator::Power,
        Operator::Less,
        Operator::LessOrEqual,
        Operator::Greater,
        Operator::GreaterOrEqual,
        Operator::And,
        Operator::Or,
    ];
    let size = prop_oneof![0.0..1e3, 1e-12..1e-3, 1e6..1e15, Just(1e-9), Just(2.0)];
    let names = (0..NAMES.len()).prop_map(|place| Syntax::Name(NAMES[place].0.to_owned()));
    let leaf = prop_oneof![size.prop_map(Syntax::Number), names].prop_map(of_kind);
    leaf.prop_recursive(5, 40, 3, |inner| {
        let pair = [inner.clone(), inner.clone()];
        let triple = [inner.clone(), inner.clone(), inner.clone()];
        let binary = (0..OPERATORS.len(), pair);
        let call = (0..function::ALL.len(), triple);
        prop_oneof![
            1 => inner.clone().prop_map(|tree| Syntax::Negative(Box::new(tree))),
            1 => inner.prop_map(|tree| Syntax::Not(Box::new(tree))),
            6 => binary.prop_map(|(place, pair)| Syntax::Binary(OPERATORS[place], Box::new(pair))),
            3 => call.prop_map(|(place, triple)| {
                let (name, arguments, _) = function::ALL[place];
                Syntax::Call(name.to_owned(), triple.into_iter().take(arguments.len()).collect())
            }),
        ]
        .prop_map(of_kind)
    })
}

proptest! {
    #[test]
    fn the_equation_that_a_person_reads_is_the_one_that_is_computed(tree in trees()) {
        let read = Element::read(&super::typeset(&tree).mathml).linear();
        let parsed = parse(&read).map_err(|fault| TestCaseError::fail(format!("{read}: {fault:?}")))?;
        prop_assert_eq!(without_places(&parsed), tree, "{}", read);
    }

    #[test]
    fn terms_on_several_lines_are_the_same_sum(tree in trees()) {
        let pieces = super::terms(&tree).into_iter();
        let read: String = pieces.map(|piece| Element::read(&piece.mathml).linear()).collect();
        let parsed = parse(&read).map_err(|fault| TestCaseError::fail(format!("{read}: {fault:?}")))?;
        prop_assert_eq!(without_places(&parsed), tree, "{}", read);
    }
}

fn set(line: &str) -> String {
    let typeset = equation(line).unwrap_or_else(|| panic!("{line}"));
    assert_eq!(typeset.pieces.len(), 1, "{line}");
    typeset.pieces.concat()
}

#[test]
fn an_equation_is_set_as_it_is_written_by_hand() {
    for (line, mathml) in [
        (
            "x' = -k*x^2/m",
            "<mover><mi>x</mi><mo>˙</mo></mover><mo>=</mo><mfrac><mrow><mrow><mrow>\
             <mo form=\"prefix\">−</mo><mi>k</mi></mrow><mo>·</mo><msup><mi>x</mi><mrow><mn>2</mn>\
             </mrow></msup></mrow></mrow><mrow><mi>m</mi></mrow></mfrac>",
        ),
        (
            "x_1'' = 2.5e-9",
            "<msub><mover><mi>x</mi><mo>¨</mo></mover><mn>1</mn></msub><mo>=</mo><mrow><mn>2.5</mn>\
             <mo>×</mo><msup><mn>10</mn><mn>−9</mn></msup></mrow>",
        ),
        (
            "y = if(u < 1, a, sqrt(b))",
            "<mi>y</mi><mo>=</mo><mrow><mo stretchy=\"true\" form=\"prefix\">{</mo><mtable><mtr><mtd>\
             <mi>a</mi></mtd><mtd><mtext>if\u{a0}</mtext><mrow><mi>u</mi><mo>&lt;</mo><mn>1</mn></mrow>\
             </mtd></mtr><mtr><mtd><msqrt><mi>b</mi></msqrt></mtd><mtd><mtext>otherwise</mtext></mtd>\
             </mtr></mtable></mrow>",
        ),
    ] {
        assert_eq!(set(line), mathml);
    }
}

#[test]
fn brackets_grow_with_a_fraction_between_them() {
    assert!(set("y = (a/b + c)^2").contains("<mo stretchy=\"true\">(</mo>"));
    assert!(set("y = (a + c)^2").contains("<mo stretchy=\"false\">(</mo>"));
}

#[test]
fn words_behind_an_equation_stay_words() {
    let typeset = equation("command = clip(K*e, -1, 1), once a sample, held").unwrap();
    assert_eq!(typeset.text, "command = clip(K*e, -1, 1)");
    assert_eq!(typeset.words, ", once a sample, held");
}

#[test]
fn a_long_sum_is_broken_between_its_terms_and_a_wide_product_is_left_as_text() {
    let long = format!("y = {}", ["alpha*(x + area)"; 8].join(" - "));
    let pieces = equation(&long).unwrap().pieces;
    assert_eq!(pieces.len(), 8);
    assert!(pieces[7].starts_with("<mo form=\"infix\">−</mo>"));
    let wide = format!("y = {}", ["(first + second)"; 8].join("*"));
    assert!(equation(&wide).unwrap().pieces.is_empty());
}

#[test]
fn a_line_that_is_no_equation_of_the_language_is_not_set() {
    for line in [
        "u >= 0: Q1 = Kq*u",
        "psi(d) = d/2",
        "V1 = V01 + A1*x, V2 = V02",
        "y = ",
        "y = 2 x",
        "the spool follows its command",
    ] {
        assert_eq!(equation(line), None, "{line}");
    }
}

#[test]
fn every_equation_of_the_documents_in_the_catalogue_is_set() {
    let catalogue = Catalogue::built_in();
    let documents = catalogue.iter().filter(|model| model.document().is_some());
    let descriptions = documents.map(|model| model.description());
    let lines: Vec<_> = descriptions.flat_map(|about| &about.equations).collect();
    assert!(lines.len() > 20);
    for line in lines {
        assert!(equation(line).is_some(), "{line}");
    }
}
