//! A JSON document to a [`Definition`]: names, units and texts, with every fault on the way.
//!
//! Everything is bounded here, so that what follows works on a small thing.

use super::definition::{
    Declared, Definition, Formula, Initial, Measured, ModelOptions, NamedTable, Parameter, Sampled,
    StateDefinition, Written,
};
use crate::language::operation::LookupTable;
use crate::language::syntax;
use crate::language::unit::ValueUnit;
use crate::model::{Scale, Tolerance};
use greybox_numerics::parsing::fault::Fault;
use greybox_numerics::parsing::reader::{Faults, Field, Object};

/// The names of one kind (states, quantities …) in a model at the most.
const MAX_STATES: usize = 32;
const MAX_SIGNALS: usize = 32;
const MAX_PARAMETERS: usize = 128;
const MAX_QUANTITIES: usize = 256;
const MAX_TABLES: usize = 16;
const MAX_KINKS: usize = 64;
/// The points of one table at the most.
const MAX_POINTS: usize = 1000;
/// The characters of a name at the most, and those of a meaning or a summary.
const MAX_NAME_CHARS: usize = 64;
const MAX_TEXT_CHARS: usize = 4000;

/// Reads a document; none where so much is wrong that nothing else can be said.
pub fn read(document: &Field<'_>, faults: &Faults) -> Option<Definition> {
    let reader = SectionReader { faults };
    let mut root = document.object()?;
    let name = root.required("name");
    let name = name.and_then(|field| reader.model_name(&field));
    let title = reader.text(root.optional("title"));
    let definition = Definition {
        title: if title.is_empty() {
            name.clone().unwrap_or_default()
        } else {
            title
        },
        name: name.unwrap_or_default(),
        summary: reader.text(root.optional("summary")),
        source: reader.text(root.optional("source")),
        inputs: reader.section(&mut root, "inputs", MAX_SIGNALS, SectionReader::input),
        parameters: reader.section(
            &mut root,
            "parameters",
            MAX_PARAMETERS,
            SectionReader::parameter,
        ),
        constants: reader.section(
            &mut root,
            "constants",
            MAX_PARAMETERS,
            SectionReader::constant,
        ),
        tables: reader.section(&mut root, "tables", MAX_TABLES, SectionReader::table),
        quantities: reader.section(
            &mut root,
            "quantities",
            MAX_QUANTITIES,
            SectionReader::formula,
        ),
        sampled: reader.section(&mut root, "sampled", MAX_SIGNALS, SectionReader::sampled),
        states: reader.section(&mut root, "states", MAX_STATES, SectionReader::state),
        outputs: reader.section(&mut root, "outputs", MAX_SIGNALS, SectionReader::formula),
        options: root
            .optional("options")
            .map(|field| reader.options(&field))
            .unwrap_or_default(),
    };
    for (section, is_empty) in [
        ("states", definition.states.is_empty()),
        ("outputs", definition.outputs.is_empty()),
        ("parameters", definition.parameters.is_empty()),
    ] {
        if is_empty && document.value.get(section).is_none_or(is_hollow) {
            root.fault("missing_field", format!("a model needs `{section}`"));
        }
    }
    root.finish();
    Some(definition)
}

fn is_hollow(value: &serde_json::Value) -> bool {
    value.is_null() || value.as_object().is_some_and(serde_json::Map::is_empty)
}

struct SectionReader<'f> {
    faults: &'f Faults,
}

impl SectionReader<'_> {
    /// The entries of a section, each by its name.
    fn section<'v, T>(
        &self,
        root: &mut Object<'v>,
        section: &'static str,
        most: usize,
        read: impl Fn(&Self, &str, &Field<'v>) -> Option<T>,
    ) -> Vec<T> {
        let Some(field) = root.optional(section) else {
            return Vec::new();
        };
        let Some(object) = field.object() else {
            return Vec::new();
        };
        if object.n_entries() > most {
            let detail = format!("{} `{section}` are more than {most}", object.n_entries());
            field.fault("too_many", detail);
        }
        let entries = object.entries().take(most);
        let named = entries.filter(|(name, field)| is_name(name, field));
        named
            .filter_map(|(name, field)| read(self, name, &field))
            .collect()
    }

    fn model_name(&self, field: &Field<'_>) -> Option<String> {
        let text = field.text()?;
        is_name(text, field).then(|| text.to_owned())
    }

    fn text(&self, field: Option<Field<'_>>) -> String {
        let Some((field, text)) = field.and_then(|field| field.text().map(|text| (field, text)))
        else {
            return String::new();
        };
        let length = text.chars().count();
        if length > MAX_TEXT_CHARS {
            let detail = format!("{length} characters are more than {MAX_TEXT_CHARS}");
            field.fault("too_long", detail);
            return String::new();
        }
        text.to_owned()
    }

    fn unit(&self, field: Option<Field<'_>>) -> (ValueUnit, String) {
        let Some(field) = field else {
            return (ValueUnit::Any, String::new());
        };
        let Some(text) = field.text() else {
            return (ValueUnit::Any, String::new());
        };
        let unit = ValueUnit::parse(text).unwrap_or_else(|why| {
            field.fault("unknown_unit", why);
            ValueUnit::Any
        });
        (unit, text.to_owned())
    }

    fn declared(&self, name: &str, pointer: &str, object: &mut Object<'_>) -> Declared {
        let symbol = object.optional("symbol");
        let symbol = symbol.and_then(|field| {
            let text = field.text()?;
            is_name(text, &field).then(|| text.to_owned())
        });
        let (unit, unit_text) = self.unit(object.optional("unit"));
        Declared {
            name: name.to_owned(),
            symbol,
            unit,
            unit_text,
            meaning: self.text(object.optional("meaning")),
            pointer: pointer.to_owned(),
        }
    }

    fn input(&self, name: &str, field: &Field<'_>) -> Option<Declared> {
        let mut object = field.object()?;
        let declared = self.declared(name, &field.pointer, &mut object);
        object.finish();
        Some(declared)
    }

    fn parameter(&self, name: &str, field: &Field<'_>) -> Option<Parameter> {
        let mut object = field.object()?;
        let declared = self.declared(name, &field.pointer, &mut object);
        let default = object.required("default").and_then(|field| field.number());
        let mut number = |name| object.optional(name).and_then(|field| field.number());
        let bounds = [number("lower"), number("upper")];
        let limits = [number("minimum"), number("maximum")];
        let scale = object
            .optional("scale")
            .and_then(|field| field.choice(&[("linear", Scale::Linear), ("log", Scale::Log)]));
        let unknown = object.optional("unknown").and_then(|field| field.boolean());
        let tolerance = object.optional("tolerance");
        let tolerance = tolerance.and_then(|field| Tolerance::read(&field));
        object.finish();
        let default = default?;
        let scale = scale.unwrap_or_default();
        let [lower, upper] = bounds;
        let lower = lower.unwrap_or(if default > 0.0 {
            default / 10.0
        } else {
            default * 10.0 - 1.0
        });
        let upper = upper.unwrap_or(if default > 0.0 {
            default * 10.0
        } else {
            default / 10.0 + 1.0
        });
        if lower >= upper {
            let detail = format!("lower {lower} is not below upper {upper}");
            field.fault("bounds_reversed", detail);
        } else if scale == Scale::Log && lower <= 0.0 {
            let detail = format!("a log scale needs lower {lower} above 0");
            field.fault("log_scale_not_positive", detail);
        }
        Some(Parameter {
            declared,
            default,
            bounds: [lower, upper],
            scale,
            unknown: unknown.unwrap_or(false),
            limits,
            tolerance,
        })
    }

    fn constant(&self, name: &str, field: &Field<'_>) -> Option<(Declared, f64)> {
        if field.value.is_number() {
            let declared = Declared::of_any_unit(name, &field.pointer);
            return Some((declared, field.number()?));
        }
        let mut object = field.object()?;
        let declared = self.declared(name, &field.pointer, &mut object);
        let value = object.required("value").and_then(|field| field.number());
        object.finish();
        Some((declared, value?))
    }

    fn table(&self, name: &str, field: &Field<'_>) -> Option<NamedTable> {
        let mut object = field.object()?;
        let x = object.required("x").and_then(|field| numbers(&field));
        let y = object.required("y").and_then(|field| numbers(&field));
        let units = [
            self.unit(object.optional("x_unit")).0,
            self.unit(object.optional("y_unit")).0,
        ];
        object.finish();
        let (x, y) = (x?, y?);
        let rising = x.windows(2).all(|pair| pair[0] < pair[1]);
        if x.len() != y.len() || x.len() < 2 || x.len() > MAX_POINTS || !rising {
            let detail = format!(
                "a table has 2 to {MAX_POINTS} points, as many `y` as `x`, and its `x` rise"
            );
            field.fault("table_not_possible", detail);
            return None;
        }
        Some(NamedTable {
            name: name.to_owned(),
            table: LookupTable { x, y },
            units,
            pointer: field.pointer.clone(),
        })
    }

    fn expression(&self, field: &Field<'_>) -> Option<Written> {
        let text = match field.value.as_f64() {
            Some(number) => number.to_string(),
            None => field.text()?.to_owned(),
        };
        let tree = syntax::parse(&text);
        if let Err(error) = &tree {
            let fault = Fault::new(&field.pointer, "expression_not_understood", &error.detail);
            self.faults.push(fault.within(error.span.place(&text)));
        }
        Some(Written {
            pointer: field.pointer.clone(),
            text,
            tree: tree.ok(),
        })
    }

    /// A formula stands alone as text, or with its unit and meaning in an object.
    fn formula(&self, name: &str, field: &Field<'_>) -> Option<Formula> {
        if !field.value.is_object() {
            return Some(Formula {
                declared: Declared::of_any_unit(name, &field.pointer),
                text: self.expression(field)?,
            });
        }
        let mut object = field.object()?;
        let declared = self.declared(name, &field.pointer, &mut object);
        let text = object.required("expression");
        let text = text.and_then(|field| self.expression(&field));
        object.finish();
        Some(Formula {
            declared,
            text: text?,
        })
    }

    fn sampled(&self, name: &str, field: &Field<'_>) -> Option<Sampled> {
        if !field.value.is_object() {
            return Some(Sampled {
                formula: self.formula(name, field)?,
                initial: None,
            });
        }
        let mut object = field.object()?;
        let declared = self.declared(name, &field.pointer, &mut object);
        let text = object.required("expression");
        let text = text.and_then(|field| self.expression(&field));
        let initial = object.optional("initial");
        let initial = initial.and_then(|field| self.expression(&field));
        object.finish();
        Some(Sampled {
            formula: Formula {
                declared,
                text: text?,
            },
            initial,
        })
    }

    fn state(&self, name: &str, field: &Field<'_>) -> Option<StateDefinition> {
        let mut object = field.object()?;
        let declared = self.declared(name, &field.pointer, &mut object);
        let derivative = object.required("derivative");
        let derivative = derivative.and_then(|field| self.expression(&field));
        let initial = object.required("initial");
        let initial = initial.and_then(|field| self.initial(name, &field));
        let scale = object.optional("scale").and_then(|field| field.positive());
        object.finish();
        Some(StateDefinition {
            declared,
            derivative: derivative?,
            initial: initial?,
            scale,
        })
    }

    /// A number, an expression of parameters, `"first sample of output y"`, or
    /// `{"first_sample" | "estimate_near" | "estimate_near_slope_of": "y", "otherwise": …}`.
    fn initial(&self, name: &str, field: &Field<'_>) -> Option<Initial> {
        const WORDS: &str = "first sample of output ";
        if let Some(text) = field.value.as_str() {
            let output = match text {
                "first_sample" => Some(name),
                _ => text.strip_prefix(WORDS).map(str::trim),
            };
            if let Some(output) = output {
                let pointer = field.pointer.clone();
                return Some(Initial::Measured {
                    kind: Measured::First,
                    output: output.to_owned(),
                    pointer,
                    otherwise: None,
                });
            }
        }
        if !field.value.is_object() {
            return Some(Initial::Computed(self.expression(field)?));
        }
        let mut object = field.object()?;
        let mut measured = None;
        for (word, kind) in [
            ("first_sample", Measured::First),
            ("estimate_near", Measured::Near),
            ("estimate_near_slope_of", Measured::NearSlope),
        ] {
            if let Some(output) = object.optional(word) {
                let name = output.text()?.to_owned();
                measured = Some((kind, name, output.pointer));
            }
        }
        if measured.is_none() {
            let detail = "one of `first_sample`, `estimate_near` and `estimate_near_slope_of` is \
                          needed, with the name of an output";
            object.fault("missing_field", detail);
        }
        let otherwise = object.optional("otherwise");
        let otherwise = otherwise.and_then(|field| self.expression(&field));
        object.finish();
        let (kind, output, pointer) = measured?;
        Some(Initial::Measured {
            kind,
            output,
            pointer,
            otherwise,
        })
    }

    fn options(&self, field: &Field<'_>) -> ModelOptions {
        let Some(mut object) = field.object() else {
            return ModelOptions::default();
        };
        let hold = object.optional("input_hold");
        let hold = hold.and_then(|field| field.choice(&[("zero", false), ("first", true)]));
        let mut expression = |name| {
            let field = object.optional(name)?;
            self.expression(&field)
        };
        let options = ModelOptions {
            first_order_hold: hold.unwrap_or(false),
            delay: expression("delay"),
            fastest_rate: expression("fastest_rate"),
            valid_while: expression("valid_while"),
            kinks: object
                .optional("kinks")
                .and_then(|field| self.kinks(&field)),
        };
        object.finish();
        options
    }

    fn kinks(&self, field: &Field<'_>) -> Option<Vec<Written>> {
        let items = field.array()?;
        if items.len() > MAX_KINKS {
            let detail = format!("{} kinks are more than {MAX_KINKS}", items.len());
            field.fault("too_large", detail);
            return None;
        }
        items.map(|item| self.expression(&item)).collect()
    }
}

fn numbers(field: &Field<'_>) -> Option<Vec<f64>> {
    let items = field.array()?;
    let items = items.take(MAX_POINTS + 1);
    items.map(|item| item.number()).collect()
}

/// Whether a text can be a name; a fault where it cannot.
fn is_name(name: &str, field: &Field<'_>) -> bool {
    let starts = name
        .chars()
        .next()
        .is_some_and(|c| c.is_alphabetic() || c == '_');
    let goes_on = name.chars().all(|c| c.is_alphanumeric() || c == '_');
    let good = starts && goes_on && name.chars().count() <= MAX_NAME_CHARS;
    if !good {
        let shown: String = name.chars().take(MAX_NAME_CHARS).collect();
        let detail = format!(
            "`{shown}` is not a name: a letter, then letters, digits and `_`, at most \
             {MAX_NAME_CHARS} characters"
        );
        field.fault("name_not_possible", detail);
    }
    good
}
