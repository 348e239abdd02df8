//! Identifiers of new rows. They sort after the identifiers of all rows that are stored, also where the clock was set
//! back: lists go by identifiers.

use std::fmt::Display;
use std::str::FromStr;

use super::StoreError;
use super::database::QueryBuilder;
use super::writer::Tx;

/// The hexadecimal digits of an identifier that say when it was made, in milliseconds.
const TIME_DIGITS: usize = 12;

/// Makes identifiers for rows of one table.
pub(super) struct NewIds<I> {
    newest: Option<I>,
}

impl<I: Copy + Default + Display + FromStr + Ord> NewIds<I> {
    /// Identifiers for new rows of a table.
    pub(super) async fn of(tx: &mut Tx, table: &'static str) -> Result<Self, StoreError> {
        let mut newest = QueryBuilder::new("select max(id) from ");
        newest.push(table);
        let newest: Option<String> = newest.build_query_scalar().fetch_one(&mut **tx).await?;
        let newest = newest.and_then(|id| id.parse().ok());
        Ok(Self { newest })
    }

    /// The next identifier.
    pub(super) fn next(&mut self) -> I {
        let id = match self.newest {
            Some(newest) => later_than(newest, I::default()),
            None => I::default(),
        };
        self.newest = Some(id);
        id
    }
}

/// The identifier `id` where it sorts after `newest`, else the same digits one millisecond after `newest`.
fn later_than<I: Copy + Display + FromStr + Ord>(newest: I, id: I) -> I {
    if newest < id {
        return id;
    }
    let (newest, text) = (newest.to_string(), id.to_string());
    let later = || {
        let (prefix, digits) = newest.rsplit_once('_')?;
        let (time, _) = digits.split_at_checked(TIME_DIGITS)?;
        let (_, rest) = text.rsplit_once('_')?.1.split_at_checked(TIME_DIGITS)?;
        let time = u64::from_str_radix(time, 16).ok()? + 1;
        format!("{prefix}_{time:0TIME_DIGITS$x}{rest}").parse().ok()
    };
    later().unwrap_or(id)
}

#[cfg(test)]
mod tests {
    use greybox::identification::JobId;

    use super::*;

    #[test]
    fn identifiers_sort_after_the_newest_whatever_the_clock_says() {
        let future = "job_0fffffffffff7d8e9f00112233445566";
        let mut ids = NewIds {
            newest: future.parse::<JobId>().ok(),
        };
        let made: Vec<JobId> = (0..3).map(|_| ids.next()).collect();
        assert!(made.is_sorted() && made[0].to_string().as_str() > future);
        assert!(made[0].to_string().starts_with("job_1000000000007"));
        let before = JobId::new();
        let after = JobId::new();
        assert_eq!(later_than(before, after), after);
    }
}
