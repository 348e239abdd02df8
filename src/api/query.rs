//! Query strings into types, all faults at once; a parameter that is not known is a fault.

use axum::extract::{FromRequestParts, Query};
use axum::http::request::Parts;
use utoipa::openapi::schema::{Object, ObjectBuilder, Type};

use super::error::{Answer, Kind, Problem};
use greybox::parsing::Fault;

/// What a handler can be asked beside its path.
pub trait FromQuery: Sized {
    /// Reads every parameter, leaving faults in `query`.
    fn read(query: &mut QueryReader) -> Self;
}

/// The schema of a text that is one of some names.
pub fn one_of(names: impl Iterator<Item = &'static str>) -> Object {
    let schema = ObjectBuilder::new().schema_type(Type::String);
    schema.enum_values(Some(names)).build()
}

/// The query of a request, read.
pub struct Params<T>(pub T);

impl<T: FromQuery, S: Sync> FromRequestParts<S> for Params<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _state: &S) -> Answer<Self> {
        let pairs = Query::<Vec<(String, String)>>::try_from_uri(&parts.uri);
        let Query(pairs) = pairs.map_err(|rejection| {
            let detail = format!("the query cannot be read: {}", rejection.body_text());
            Problem::new(Kind::Invalid, detail)
        })?;
        let mut query = QueryReader {
            pairs,
            parameters: Vec::new(),
            faults: Vec::new(),
        };
        let read = T::read(&mut query);
        query.refuse_the_unknown();
        if query.faults.is_empty() {
            Ok(Params(read))
        } else {
            Err(Problem::of_faults(Kind::Invalid, query.faults))
        }
    }
}

/// The pairs of a query and the faults found in them.
pub struct QueryReader {
    pairs: Vec<(String, String)>,
    parameters: Vec<&'static str>,
    faults: Vec<Fault>,
}

impl QueryReader {
    /// The text of a parameter. One that is given twice is a fault.
    pub fn text(&mut self, name: &'static str) -> Option<String> {
        self.parameters.push(name);
        let mut values = self.pairs.iter().filter(|(key, _)| key == name);
        let value = values.next().map(|(_, value)| value.clone());
        if values.next().is_some() {
            self.fault(name, "repeated", format!("`{name}` is given twice"));
        }
        value
    }

    /// A parameter that `parse` understands; what it does not is a fault with its sentence.
    pub fn parsed<T>(
        &mut self,
        name: &'static str,
        parse: impl FnOnce(&str) -> Result<T, String>,
    ) -> Option<T> {
        match parse(&self.text(name)?) {
            Ok(value) => Some(value),
            Err(detail) => {
                self.fault(name, "invalid_parameter", detail);
                None
            }
        }
    }

    /// A whole number in `[least, most]`.
    pub fn integer(&mut self, name: &'static str, least: u64, most: u64) -> Option<u64> {
        self.parsed(name, |text| match text.parse::<u64>() {
            Ok(value) if (least..=most).contains(&value) => Ok(value),
            Ok(value) => Err(format!("{value} is outside {least} to {most}")),
            Err(_) => Err(format!("`{}` is not a whole number", cut(text))),
        })
    }

    /// A finite number.
    pub fn number(&mut self, name: &'static str) -> Option<f64> {
        self.parsed(name, |text| match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(format!("`{}` is not a number", cut(text))),
        })
    }

    /// The numbers `from` and `to`, of which the first is not above the second.
    pub fn interval(&mut self) -> (Option<f64>, Option<f64>) {
        let (from, to) = (self.number("from"), self.number("to"));
        if let (Some(from), Some(to)) = (from, to)
            && from > to
        {
            let detail = format!("from {from} is after to {to}");
            self.fault("from", "bounds_reversed", detail);
        }
        (from, to)
    }

    /// `true` or `false`; the bare name counts as `true`.
    pub fn flag(&mut self, name: &'static str) -> bool {
        let flag = self.parsed(name, |text| match text {
            "true" | "" => Ok(true),
            "false" => Ok(false),
            other => Err(format!("`{}` is not true or false", cut(other))),
        });
        flag.unwrap_or(false)
    }

    /// Records a fault of a parameter.
    pub fn fault(&mut self, parameter: &str, code: &'static str, detail: String) {
        self.faults
            .push(Fault::of_parameter(parameter, code, detail));
    }

    fn refuse_the_unknown(&mut self) {
        let unknown = self.pairs.iter().map(|(name, _)| name.as_str());
        let mut unknown: Vec<String> = unknown
            .filter(|name| !self.parameters.contains(name))
            .map(cut)
            .collect();
        unknown.dedup();
        for name in unknown {
            let expected = if self.parameters.is_empty() {
                "there are none".to_owned()
            } else {
                format!("there are {}", self.parameters.join(", "))
            };
            let detail = format!("`{name}` is not a parameter here; {expected}");
            self.fault(&name, "unknown_parameter", detail);
        }
    }
}

/// A text of the client, short enough for a sentence.
fn cut(text: &str) -> String {
    /// Longer texts are cut.
    const LONGEST: usize = 60;
    text.chars().take(LONGEST).collect()
}

/// For a resource that takes no query.
pub struct NoQuery;

impl FromQuery for NoQuery {
    fn read(_query: &mut QueryReader) -> Self {
        Self
    }
}

#[cfg(test)]
mod tests {
    use axum::http::Request;

    use super::*;

    struct Page {
        limit: Option<u64>,
        from: Option<f64>,
        all: bool,
    }

    impl FromQuery for Page {
        fn read(query: &mut QueryReader) -> Self {
            Self {
                limit: query.integer("limit", 1, 100),
                from: query.number("from"),
                all: query.flag("all"),
            }
        }
    }

    async fn read(query: &str) -> Result<Page, Problem> {
        let request = Request::get(format!("/?{query}")).body(()).unwrap();
        let (mut parts, ()) = request.into_parts();
        let params = Params::<Page>::from_request_parts(&mut parts, &()).await?;
        Ok(params.0)
    }

    #[tokio::test]
    async fn parameters_become_types() {
        let page = read("limit=5&from=-1e-3&all").await.unwrap();
        assert_eq!(
            (page.limit, page.from, page.all),
            (Some(5), Some(-1e-3), true)
        );
    }

    #[tokio::test]
    async fn all_faults_of_a_query_are_told_at_once() {
        let problem = read("limit=0&from=NaN&all=2&all=1&limt=5").await.err();
        let text = format!("{problem:?}");
        for detail in [
            "0 is outside 1 to 100",
            "`NaN` is not a number",
            "`all` is given twice",
            "`2` is not true or false",
            "`limt` is not a parameter here",
        ] {
            assert!(text.contains(detail), "{detail} in {text}");
        }
    }
}
