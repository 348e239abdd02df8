//! Columns of samples that are filled row by row and then gone through one by one, as often as
//! needed: in memory, or beyond a bound in a scratch that the caller provides.

use std::io::{self, Read, Seek, SeekFrom, Write};

/// What memory holds before it goes to the scratch, all columns together `[bytes]`.
const HELD_BYTES: usize = 2 << 20;

/// Bytes of a sample.
const SAMPLE_BYTES: usize = size_of::<f64>();

/// A place for samples that memory is not to hold.
pub trait Scratch: Read + Write + Seek + Send {}

impl<T: Read + Write + Seek + Send> Scratch for T {}

/// Makes a scratch when one is needed.
pub type NewScratch = Box<dyn FnOnce() -> io::Result<Box<dyn Scratch>> + Send>;

/// Samples that can be gone through again and again.
pub(crate) trait SampleSeries {
    /// Hands over all samples in their order, piece by piece.
    ///
    /// # Errors
    /// When the samples cannot be read, or with what `take` answers.
    fn visit(&mut self, take: &mut dyn FnMut(&[f64]) -> io::Result<()>) -> io::Result<()>;

    /// All samples at once.
    ///
    /// # Errors
    /// When the samples cannot be read.
    fn collect(&mut self) -> io::Result<Vec<f64>> {
        let mut samples = Vec::new();
        self.visit(&mut |piece| {
            samples.extend_from_slice(piece);
            Ok(())
        })?;
        Ok(samples)
    }
}

impl SampleSeries for &[f64] {
    fn visit(&mut self, take: &mut dyn FnMut(&[f64]) -> io::Result<()>) -> io::Result<()> {
        take(self)
    }
}

/// Columns of equal length.
pub(crate) struct SampleColumns {
    /// The newest rows of each column; all of them where there is no scratch.
    held: Vec<Vec<f64>>,
    /// Rows that go to the scratch together.
    block_rows: usize,
    /// Blocks in the scratch: each holds the rows of the first column, then of the next.
    blocks: u64,
    scratch_state: ScratchState,
    /// Whether the rows came in the opposite of their order.
    is_reversed: bool,
    /// Samples that stand for missing ones, each with its column.
    stand_ins: Vec<(usize, f64)>,
}

/// Where rows go that memory is not to hold.
enum ScratchState {
    /// Nowhere: memory holds all.
    Memory,
    New(NewScratch),
    Open(Box<dyn Scratch>),
    /// The scratch could not be made.
    Failed,
}

impl SampleColumns {
    /// Empty columns.
    pub(crate) fn new(columns: usize, scratch: Option<NewScratch>) -> Self {
        Self {
            held: vec![Vec::new(); columns],
            block_rows: (HELD_BYTES / SAMPLE_BYTES / columns.max(1)).max(1),
            blocks: 0,
            scratch_state: scratch.map_or(ScratchState::Memory, ScratchState::New),
            is_reversed: false,
            stand_ins: Vec::new(),
        }
    }

    /// Columns that memory holds already.
    pub(crate) fn of(columns: Vec<Vec<f64>>) -> Self {
        Self {
            held: columns,
            ..Self::new(0, None)
        }
    }

    /// Adds a row: a sample for each column.
    ///
    /// # Errors
    /// When the scratch cannot be made or does not take more.
    pub(crate) fn push(&mut self, row: &[f64]) -> io::Result<()> {
        debug_assert_eq!(row.len(), self.held.len(), "a sample for each column");
        for (column, sample) in self.held.iter_mut().zip(row) {
            column.push(*sample);
        }
        let is_full = self.held_rows() >= self.block_rows;
        if is_full && !matches!(self.scratch_state, ScratchState::Memory) {
            self.put_aside()?;
        }
        Ok(())
    }

    /// Turns the order of the rows round.
    pub(crate) fn reverse(&mut self) {
        self.is_reversed = !self.is_reversed;
    }

    /// Hands over samples of a column that are exactly this one as missing from now on.
    pub(crate) fn leave_out(&mut self, index: usize, sample: f64) {
        self.stand_ins.push((index, sample));
    }

    /// Whether samples of a column stand for missing ones.
    fn has_stand_ins(&self, index: usize) -> bool {
        self.stand_ins.iter().any(|(column, _)| *column == index)
    }

    /// How many rows there are.
    pub(crate) fn rows(&self) -> usize {
        self.blocks as usize * self.block_rows + self.held_rows()
    }

    /// One of the columns.
    pub(crate) fn column(&mut self, index: usize) -> SampleColumn<'_> {
        SampleColumn {
            columns: self,
            index,
        }
    }

    /// Takes a column out, all of it in memory.
    ///
    /// # Errors
    /// When the scratch cannot be read.
    pub(crate) fn take(&mut self, index: usize) -> io::Result<Vec<f64>> {
        if self.blocks == 0 && !self.has_stand_ins(index) {
            let mut samples = std::mem::take(&mut self.held[index]);
            samples.shrink_to_fit();
            if self.is_reversed {
                samples.reverse();
            }
            return Ok(samples);
        }
        self.column(index).collect()
    }

    fn held_rows(&self) -> usize {
        self.held.iter().map(Vec::len).max().unwrap_or(0)
    }

    fn put_aside(&mut self) -> io::Result<()> {
        let column_bytes = self.block_rows * SAMPLE_BYTES;
        let end = self.blocks * (self.held.len() * column_bytes) as u64;
        let mut bytes = Vec::with_capacity(column_bytes);
        let scratch = self.scratch_state.open()?;
        scratch.seek(SeekFrom::Start(end))?;
        for column in &mut self.held {
            bytes.clear();
            bytes.extend(column.iter().flat_map(|sample| sample.to_le_bytes()));
            scratch.write_all(&bytes)?;
            column.clear();
        }
        self.blocks += 1;
        Ok(())
    }
}

impl ScratchState {
    fn open(&mut self) -> io::Result<&mut dyn Scratch> {
        if let ScratchState::New(_) = self
            && let ScratchState::New(new) = std::mem::replace(self, ScratchState::Failed)
        {
            *self = ScratchState::Open(new()?);
        }
        match self {
            ScratchState::Open(scratch) => Ok(scratch.as_mut()),
            _ => Err(io::Error::other("there is no scratch")),
        }
    }
}

/// One of several columns.
pub(crate) struct SampleColumn<'a> {
    columns: &'a mut SampleColumns,
    index: usize,
}

impl SampleColumn<'_> {
    /// Hands over the samples that are in the scratch.
    fn visit_scratch(&mut self, take: &mut dyn FnMut(&[f64]) -> io::Result<()>) -> io::Result<()> {
        let SampleColumns {
            held,
            block_rows,
            blocks,
            scratch_state,
            is_reversed,
            ..
        } = &mut *self.columns;
        let scratch = scratch_state.open()?;
        let mut bytes = vec![0; *block_rows * SAMPLE_BYTES];
        let mut samples = Vec::with_capacity(*block_rows);
        for k in 0..*blocks {
            let block = if *is_reversed { *blocks - 1 - k } else { k };
            let before = block * held.len() as u64 + self.index as u64;
            scratch.seek(SeekFrom::Start(before * bytes.len() as u64))?;
            scratch.read_exact(&mut bytes)?;
            samples.clear();
            let (numbers, _) = bytes.as_chunks();
            samples.extend(numbers.iter().map(|number| f64::from_le_bytes(*number)));
            if *is_reversed {
                samples.reverse();
            }
            take(&samples)?;
        }
        Ok(())
    }
}

impl SampleColumn<'_> {
    /// Hands over the samples as they came.
    fn visit_all(&mut self, take: &mut dyn FnMut(&[f64]) -> io::Result<()>) -> io::Result<()> {
        if self.columns.is_reversed {
            let held = self.columns.held[self.index].iter();
            take(&held.rev().copied().collect::<Vec<f64>>())?;
        }
        if self.columns.blocks > 0 {
            self.visit_scratch(take)?;
        }
        match self.columns.is_reversed {
            true => Ok(()),
            false => take(&self.columns.held[self.index]),
        }
    }
}

impl SampleSeries for SampleColumn<'_> {
    fn visit(&mut self, take: &mut dyn FnMut(&[f64]) -> io::Result<()>) -> io::Result<()> {
        if !self.columns.has_stand_ins(self.index) {
            return self.visit_all(take);
        }
        let stand_ins = self.columns.stand_ins.clone();
        let index = self.index;
        let without = |sample: &f64| match stand_ins.contains(&(index, *sample)) {
            true => f64::NAN,
            false => *sample,
        };
        self.visit_all(&mut |piece| take(&piece.iter().map(without).collect::<Vec<f64>>()))
    }
}

/// Instants, in seconds from the first of them.
pub(crate) struct Since<S> {
    pub(crate) instants: S,
    pub(crate) first: f64,
    /// Whether the instants are whole nanoseconds.
    pub(crate) is_exact: bool,
}

impl<S: SampleSeries> SampleSeries for Since<S> {
    fn visit(&mut self, take: &mut dyn FnMut(&[f64]) -> io::Result<()>) -> io::Result<()> {
        let Self {
            instants,
            first,
            is_exact,
        } = self;
        if *first == 0.0 {
            return instants.visit(take);
        }
        let since = |instant: &f64| match *is_exact {
            true => ((*instant - *first) * 1e9).round() / 1e9,
            false => *instant - *first,
        };
        instants.visit(&mut |piece| take(&piece.iter().map(since).collect::<Vec<f64>>()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::io::Cursor;

    /// Columns that put every few rows aside.
    fn columns(count: usize, block_rows: usize) -> SampleColumns {
        let scratch = || Ok(Box::new(Cursor::new(Vec::new())) as Box<dyn Scratch>);
        SampleColumns {
            block_rows,
            ..SampleColumns::new(count, Some(Box::new(scratch)))
        }
    }

    proptest! {
        #[test]
        fn columns_come_back_however_often_they_were_put_aside(
            rows in prop::collection::vec(prop::array::uniform3(prop::num::f64::ANY), 0..40),
            block_rows in 1_usize..9,
        ) {
            let mut columns = columns(3, block_rows);
            for (count, row) in rows.iter().enumerate() {
                columns.push(row).unwrap();
                // Looking at what is there does not disturb what comes.
                let seen = columns.column(count % 3).collect().unwrap();
                prop_assert_eq!((columns.rows(), seen.len()), (count + 1, count + 1));
            }
            for index in [2, 0, 1, 2] {
                let back = columns.column(index).collect().unwrap();
                let bits = back.iter().map(|sample| sample.to_bits());
                prop_assert!(bits.eq(rows.iter().map(|row| row[index].to_bits())));
            }
            columns.reverse();
            let back = columns.take(1).unwrap();
            let bits = back.iter().map(|sample| sample.to_bits());
            prop_assert!(bits.eq(rows.iter().rev().map(|row| row[1].to_bits())));
        }
    }

    #[test]
    fn samples_that_stand_for_missing_ones_are_handed_over_as_such() {
        for reverse in [false, true] {
            let mut columns = columns(2, 2);
            for row in [[1.0, -9.0], [-9.0, 2.0], [3.0, 4.0]] {
                columns.push(&row).unwrap();
            }
            columns.leave_out(0, -9.0);
            if reverse {
                columns.reverse();
            }
            let left: Vec<bool> = columns
                .take(0)
                .unwrap()
                .iter()
                .map(|v| v.is_nan())
                .collect();
            assert_eq!(left, [false, true, false]);
            let kept = columns.column(1).collect().unwrap();
            assert!(kept.contains(&-9.0), "{kept:?}");
        }
        let mut held = SampleColumns::of(vec![vec![1.0, -9.0]]);
        held.leave_out(0, -9.0);
        assert!(held.take(0).unwrap()[1].is_nan());
    }

    #[test]
    fn a_scratch_that_cannot_be_made_or_is_full_is_an_error() {
        let refuse = || Err(io::ErrorKind::StorageFull.into());
        let mut columns = SampleColumns {
            block_rows: 2,
            ..SampleColumns::new(1, Some(Box::new(refuse)))
        };
        columns.push(&[1.0]).unwrap();
        let error = columns.push(&[2.0]).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
        assert!(columns.push(&[3.0]).is_err(), "nothing is lost unseen");
    }
}
