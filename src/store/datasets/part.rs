//! A part of a recording that is too large to be kept in memory: some of its signals, between two instants.

use std::ops::Range;

use super::chunks::decode;
use super::row::described;
use crate::store::database::{self, Connection};
use crate::store::sealed::DATASET_CHUNKS;
use crate::store::{StoreError, corrupt};
use greybox::recording::{Recording, TimeAxis};

/// Bytes of a sample.
const SAMPLE_BYTES: usize = size_of::<f64>();

/// Which samples of a recording are wanted.
#[derive(Clone, Debug, Default)]
pub struct DatasetPart {
    /// The names of the signals; all where none are given.
    pub signals: Option<Vec<String>>,
    /// From this time on, seconds from the first sample.
    pub from: Option<f64>,
    /// Up to and with this time, seconds from the first sample.
    pub to: Option<f64>,
}

/// A part of a recording, each sample at the instant that it has in the whole. Only chunks that hold wanted samples are
/// read. Names that the recording does not have are left out, and how good samples are.
pub(super) async fn read(
    connection: &mut Connection,
    key: &str,
    wanted: DatasetPart,
) -> Result<Option<Recording>, StoreError> {
    let Some((_, description)) = described(connection, key).await? else {
        return Ok(None);
    };
    let of_recording = SeriesOf {
        dataset: key,
        samples: description.samples,
    };
    let time = match description.sample_time {
        Some(sample_time) => TimeAxis::Uniform {
            sample_time,
            samples: description.samples,
        },
        None => {
            let all = 0..description.samples;
            TimeAxis::Instants(of_recording.read(connection, 0, all).await?)
        }
    };
    let range = time.between(wanted.from, wanted.to);
    let is_wanted = |name: &String| {
        wanted
            .signals
            .as_ref()
            .is_none_or(|names| names.contains(name))
    };
    let mut signals = Vec::new();
    for (place, mut signal) in description.signals.into_iter().enumerate() {
        if is_wanted(&signal.name) {
            signal.classes.clear();
            let position = place as i64 + 1;
            let values = of_recording.read(connection, position, range.clone());
            signals.push(signal.with_values(values.await?));
        }
    }
    let instants = range.map(|sample| time.instant(sample)).collect();
    Ok(Some(Recording::new(TimeAxis::Instants(instants), signals)))
}

/// The series of a recording.
struct SeriesOf<'a> {
    dataset: &'a str,
    /// How many samples each series has.
    samples: usize,
}

impl SeriesOf<'_> {
    /// The samples of a series in a range.
    async fn read(
        &self,
        connection: &mut Connection,
        position: i64,
        range: Range<usize>,
    ) -> Result<Vec<f64>, StoreError> {
        let sizes = database::query(
            "select chunk, cast(length(samples) as bigint) as bytes from dataset_chunks \
             where dataset = $1 and position = $2 order by chunk",
        );
        let sizes = sizes.bind(self.dataset).bind(position);
        let sizes = sizes.fetch_all(&mut *connection).await?;
        let mut values = Vec::with_capacity(range.len());
        let mut begin = 0;
        for size in &sizes {
            let bytes: i64 = size.try_get("bytes")?;
            let end = begin + usize::try_from(bytes).unwrap_or_default() / SAMPLE_BYTES;
            if begin < range.end && range.start < end {
                let chunk = self
                    .chunk(connection, position, size.try_get("chunk")?)
                    .await?;
                let within = range.start.max(begin) - begin..range.end.min(end) - begin;
                values.extend_from_slice(&chunk[within]);
            }
            begin = end;
        }
        if begin != self.samples {
            return Err(corrupt("recording", self.dataset, "samples are missing"));
        }
        Ok(values)
    }

    async fn chunk(
        &self,
        connection: &mut Connection,
        position: i64,
        chunk: i64,
    ) -> Result<Vec<f64>, StoreError> {
        let row = database::query(
            "select dataset, position, chunk, samples, seal from dataset_chunks \
             where dataset = $1 and position = $2 and chunk = $3",
        )
        .bind(self.dataset)
        .bind(position)
        .bind(chunk)
        .fetch_one(connection)
        .await?;
        DATASET_CHUNKS.verify(&row)?;
        Ok(decode(row.try_get("samples")?).collect())
    }
}
