//! Statements that are put together.

use std::fmt::{Display, Write as _};

use super::query::{QueryAs, QueryScalar};
use super::{Query, Record, Value};

/// A connection keeps a statement with so many rows of values at the most: each number of rows is
/// another statement.
const ROWS_OF_A_KEPT_STATEMENT: usize = 16;

/// A statement on its way: text is pushed as it is, values get their places.
pub(in crate::store) struct QueryBuilder {
    sql: String,
    values: Vec<Value>,
    /// Rows of values so far.
    rows: usize,
}

impl QueryBuilder {
    pub(in crate::store) fn new(sql: &str) -> Self {
        Self {
            sql: sql.to_owned(),
            values: Vec::new(),
            rows: 0,
        }
    }

    /// Adds text, which must not come from outside.
    pub(in crate::store) fn push(&mut self, sql: impl Display) -> &mut Self {
        write!(self.sql, "{sql}").expect("a string takes all text");
        self
    }

    /// Adds the next place and its value.
    pub(in crate::store) fn push_bind(&mut self, value: impl Into<Value>) -> &mut Self {
        self.values.push(value.into());
        let place = self.values.len();
        self.push(format_args!("${place}"))
    }

    /// Adds parts with a text between them.
    pub(in crate::store) fn separated(&mut self, between: &'static str) -> Separated<'_> {
        Separated {
            query: self,
            between,
            begun: false,
        }
    }

    /// Adds `values (…), (…)`, a row for each of `rows`.
    pub(in crate::store) fn push_values<T>(
        &mut self,
        rows: impl IntoIterator<Item = T>,
        mut push: impl FnMut(Separated<'_>, T),
    ) -> &mut Self {
        self.push("values ");
        for (k, row) in rows.into_iter().enumerate() {
            self.push(if k == 0 { "(" } else { ", (" });
            push(self.separated(", "), row);
            self.push(")");
            self.rows = k + 1;
        }
        self
    }

    /// The statement, whose rows are read column by column.
    pub(in crate::store) fn build(self) -> Query {
        let is_kept = self.rows <= ROWS_OF_A_KEPT_STATEMENT;
        Query::made(self.sql, self.values).persistent(is_kept)
    }

    /// The statement, whose rows are read into a type.
    pub(in crate::store) fn build_query_as<T: Record>(self) -> QueryAs<T> {
        self.build().read_as()
    }

    /// The statement, whose rows have one column.
    pub(in crate::store) fn build_query_scalar<T>(self) -> QueryScalar<T>
    where
        (T,): Record,
    {
        self.build().read_scalar()
    }
}

/// Parts of a statement with a text between them.
pub(in crate::store) struct Separated<'q> {
    query: &'q mut QueryBuilder,
    between: &'static str,
    begun: bool,
}

impl Separated<'_> {
    /// Adds text as the next part.
    pub(in crate::store) fn push(&mut self, sql: impl Display) -> &mut Self {
        self.begin_part();
        self.query.push(sql);
        self
    }

    /// Adds a place and its value as the next part.
    pub(in crate::store) fn push_bind(&mut self, value: impl Into<Value>) -> &mut Self {
        self.begin_part();
        self.query.push_bind(value);
        self
    }

    fn begin_part(&mut self) {
        if self.begun {
            self.query.push(self.between);
        }
        self.begun = true;
    }
}
