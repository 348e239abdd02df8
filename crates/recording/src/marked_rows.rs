//! Samples by their instant that people marked as bad.

use super::rows::RowColumn;
use super::{Class, Rows};
use std::ops::RangeInclusive;

impl Rows {
    /// Takes the values of samples of columns away and says that they are bad, between two instants, both included.
    /// Answers how many had a value.
    pub fn mark_bad(
        &mut self,
        instants: RangeInclusive<i64>,
        columns: impl Iterator<Item = usize>,
    ) -> usize {
        let first = self
            .instants
            .partition_point(|instant| instant < instants.start());
        let end = self
            .instants
            .partition_point(|instant| instant <= instants.end());
        let mut marked = 0;
        for column in columns {
            let RowColumn { values, classes } = &mut self.columns[column];
            for row in (first..end)
                .filter(|row| !values[*row].is_nan())
                .collect::<Vec<_>>()
            {
                (values[row], classes[row]) = (f64::NAN, Class::Bad);
                marked += 1;
            }
        }
        marked
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_between_two_instants_lose_their_values_and_missing_ones_stay_unsaid() {
        let column = |values: [f64; 4]| RowColumn {
            values: values.to_vec(),
            classes: vec![Class::Good; 4],
        };
        let mut rows = Rows {
            instants: vec![0, 10, 20, 30],
            columns: vec![column([1.0, 2.0, f64::NAN, 4.0]), column([5.0; 4])],
        };
        assert_eq!(rows.mark_bad(10..=25, [0].into_iter()), 1);
        assert!(rows.columns[0].values[1].is_nan());
        assert_eq!(rows.columns[0].classes[1..3], [Class::Bad, Class::Good]);
        assert_eq!(rows.columns[0].values[3], 4.0);
        assert_eq!(rows.columns[1], column([5.0; 4]));
        assert_eq!(rows.mark_bad(31..=99, 0..2), 0);
    }
}
