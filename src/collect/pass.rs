//! One pass over a series: from a little before its cursor to now.

use std::ops::Range;

use jiff::{SignedDuration, Timestamp};

use super::cursors::{Cursors, SeriesCursor};
use super::delivery::{Stored, StreamDelivery};
use super::error::CollectError;
use super::page::{ReadStretch, SeriesPage};
use super::reports::SourceReport;
use super::series::SourceSeries;
use super::sources_file::SampleSource;

/// How far ahead of the collector's clock a sample may be. What is further ahead is read once the clock has come there.
const AHEAD: SignedDuration = SignedDuration::from_mins(1);
/// Pages of fewer rows are not made, however small a page the server takes.
const FEWEST_ROWS: u32 = 100;

/// What a pass brought.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Brought {
    pub(super) rows: u64,
    pub(super) stored: Stored,
}

/// A series on its way to its stream.
pub(super) struct SeriesPass<'a> {
    pub(super) source: &'a SampleSource,
    pub(super) series: &'a SourceSeries,
    pub(super) cursors: &'a Cursors,
    pub(super) delivery: &'a StreamDelivery,
    /// The rows of a page at the most; fewer once the server has refused a larger one.
    pub(super) rows: &'a mut u32,
    /// The refusal of a file, which keeps no later file back.
    pub(super) refusal: Option<CollectError>,
    pub(super) brought: Brought,
    /// The report in which the pass notes how far the series has come.
    pub(super) report: &'a SourceReport,
    /// The place of the series in the source.
    pub(super) place: usize,
}

impl SeriesPass<'_> {
    /// Brings the series up to now. What was brought before a failure stays in `brought`.
    pub(super) async fn run(&mut self) -> Result<(), CollectError> {
        let (source, key) = (self.source, self.series.key());
        let now = Timestamp::now();
        let oldest = before(source.from);
        let kept = self.cursors.find(&source.name, &key).await?;
        let mut cursor = kept.unwrap_or(SeriesCursor {
            reached: oldest,
            looked_back: now,
        });
        let back_from = |instant: Timestamp, back: SignedDuration| {
            instant.checked_sub(back).unwrap_or(oldest).max(oldest)
        };
        self.report.reached(self.place, cursor.reached);
        let begin = back_from(cursor.reached, source.overlap);
        let until = now.checked_add(AHEAD).unwrap_or(Timestamp::MAX);
        self.bring(begin..until, &mut cursor, now).await?;
        if now.duration_since(cursor.looked_back) >= source.late {
            // Whatever came after the last look back, late by no more than may be, is younger than this.
            let late = back_from(cursor.looked_back.min(begin), source.late);
            self.bring(late..begin, &mut cursor, now).await?;
            cursor.looked_back = now;
        }
        self.cursors.put(&source.name, &key, cursor).await?;
        self.refusal.take().map_or(Ok(()), Err)
    }

    /// Brings a stretch page by page, and moves the cursor with each.
    async fn bring(
        &mut self,
        stretch: Range<Timestamp>,
        cursor: &mut SeriesCursor,
        now: Timestamp,
    ) -> Result<(), CollectError> {
        let (source, key) = (self.source, self.series.key());
        let mut after = stretch.start;
        let mut next = self.read(after..stretch.end).await?;
        while let Some((page, newest)) = next {
            // The source writes the next page while the server stores this one.
            let further = self.read(newest..stretch.end);
            let append = async {
                match &page.refusal {
                    Some(why) => Err(CollectError::SourceRefuses(why.clone())),
                    None => self.delivery.append(self.series, page.clone()).await,
                }
            };
            let (stored, further) = tokio::join!(append, further);
            if !self.count(&page, stored)? {
                next = self.read(after..stretch.end).await?;
                continue;
            }
            // A clock that was ahead at the source does not carry the cursor beyond now: what comes after the clock
            // was set right lies before those samples.
            cursor.reached = cursor.reached.max(newest.min(now));
            self.cursors.put(&source.name, &key, *cursor).await?;
            self.report.reached(self.place, cursor.reached);
            after = newest;
            tokio::time::sleep(source.pause).await;
            next = further?;
        }
        Ok(())
    }

    /// Reads a page and says its newest instant; nothing where there is no newer row.
    async fn read(
        &self,
        between: Range<Timestamp>,
    ) -> Result<Option<(SeriesPage, Timestamp)>, CollectError> {
        let after = between.start;
        let stretch = ReadStretch {
            between,
            rows: *self.rows,
        };
        let page = self.source.connection.read(self.series, &stretch).await?;
        let newest = page.newest.filter(|newest| *newest > after);
        Ok(newest.map(|newest| (page, newest)))
    }

    /// Counts what a page did, and says whether the series goes on behind it; where the server takes no page of this
    /// size, the same rows are read again as smaller ones.
    fn count(
        &mut self,
        page: &SeriesPage,
        stored: Result<Stored, CollectError>,
    ) -> Result<bool, CollectError> {
        match (stored, &page.file) {
            (Ok(stored), _) => {
                self.brought.rows += page.rows;
                self.brought.stored.add(stored);
                Ok(true)
            }
            (Err(CollectError::PageTooLarge), None) if *self.rows > FEWEST_ROWS => {
                *self.rows = (*self.rows / 2).max(FEWEST_ROWS);
                Ok(false)
            }
            (Err(refusal), Some(file)) if refusal.is_refusal() => {
                self.refusal = Some(refusal.of_file(file));
                Ok(true)
            }
            (Err(error), _) => Err(error),
        }
    }
}

/// An instant before another, so that rows after it have those of the other one. No source has finer instants in the
/// rows where a series begins.
fn before(instant: Timestamp) -> Timestamp {
    let step = SignedDuration::from_micros(1);
    instant.checked_sub(step).unwrap_or(instant)
}
