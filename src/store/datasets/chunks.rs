//! The samples of a recording in chunks, as the database keeps them.

use std::io;

use tokio::sync::mpsc;
use tokio::task::JoinHandle;

use crate::store::StoreError;
use crate::store::database::{Kind, Query, QueryBuilder};
use crate::store::sealed::DATASET_CHUNKS;
use greybox::recording::{ReceivedRecording, TimeAxis};

/// The most bytes in one chunk.
pub(super) const CHUNK_BYTES: usize = 1 << 20;
/// Chunks that wait to be written.
const CHUNKS_WAITING: usize = 2;

/// The chunks of a recording, which a thread cuts while they are written.
pub(super) struct Chunks {
    waiting: mpsc::Receiver<Chunk>,
    cutting: JoinHandle<io::Result<()>>,
}

impl Chunks {
    /// Begins to cut.
    pub(super) fn of(recording: ReceivedRecording) -> Self {
        let (send, waiting) = mpsc::channel(CHUNKS_WAITING);
        let cutting = tokio::task::spawn_blocking(move || {
            let gone = |_| io::Error::from(io::ErrorKind::BrokenPipe);
            cut(recording, |chunk| send.blocking_send(chunk).map_err(gone))
        });
        Self { waiting, cutting }
    }

    /// The next chunk; nothing after the last one, or where the samples do not read back.
    pub(super) async fn next(&mut self) -> Option<Chunk> {
        self.waiting.recv().await
    }

    /// Whether all samples were cut.
    pub(super) async fn end(self) -> Result<(), StoreError> {
        let cut = self.cutting.await.unwrap_or_else(|crash| Err(crash.into()));
        cut.map_err(StoreError::Scratch)
    }
}

/// A part of a series of samples.
pub(super) struct Chunk {
    /// Which series: 0 is the time axis, signals follow.
    position: i64,
    number: i64,
    samples: Vec<u8>,
}

impl Chunk {
    /// The statement that stores a chunk of a recording.
    pub(super) fn insertion(self, dataset: &str) -> QueryBuilder {
        let parts = [
            dataset.into(),
            self.position.into(),
            self.number.into(),
            (&self.samples).into(),
        ];
        let seal = DATASET_CHUNKS.seal(&parts);
        let mut insertion = QueryBuilder::new(
            "insert into dataset_chunks (dataset, position, chunk, samples, seal) select ",
        );
        let mut values = insertion.separated(", ");
        values.push_bind(dataset);
        values.push_bind(self.position);
        values.push_bind(self.number);
        values.push_bind(self.samples);
        values.push_bind(seal);
        insertion
    }

    /// The statement that stores a chunk for as long as its recording is on its way in with the server of a life.
    pub(super) fn insertion_by(self, dataset: &str, life: i64, kind: Kind) -> Query {
        let mut insertion = self.insertion(dataset);
        insertion
            .push(" where exists (select 1 from unfinished_datasets where dataset = ")
            .push_bind(dataset)
            .push(" and life = ")
            .push_bind(life)
            // Whoever removes the chunks of a server that is gone waits for this one.
            .push(kind.either(")", " for share)"));
        insertion.build()
    }
}

/// Cuts the series of a recording, one after the other.
fn cut(
    mut recording: ReceivedRecording,
    mut hand_over: impl FnMut(Chunk) -> io::Result<()>,
) -> io::Result<()> {
    if let TimeAxis::Instants(instants) = &recording.header.time {
        let mut cutter = Cutter::new(0);
        cutter.take(instants, &mut hand_over)?;
        cutter.end(&mut hand_over)?;
    }
    for signal in 0..recording.header.signals.len() {
        let mut cutter = Cutter::new(signal as i64 + 1);
        recording.visit(signal, &mut |samples| cutter.take(samples, &mut hand_over))?;
        cutter.end(&mut hand_over)?;
    }
    Ok(())
}

/// Cuts a series that comes in pieces of any length.
struct Cutter {
    position: i64,
    number: i64,
    samples: Vec<u8>,
}

impl Cutter {
    fn new(position: i64) -> Self {
        Self {
            position,
            number: 0,
            samples: Vec::new(),
        }
    }

    fn take(
        &mut self,
        samples: &[f64],
        hand_over: &mut impl FnMut(Chunk) -> io::Result<()>,
    ) -> io::Result<()> {
        let mut left = samples;
        while !left.is_empty() {
            let room = (CHUNK_BYTES - self.samples.len()) / size_of::<f64>();
            let (now, later) = left.split_at(room.min(left.len()));
            self.samples
                .extend(now.iter().flat_map(|x| x.to_le_bytes()));
            left = later;
            if self.samples.len() == CHUNK_BYTES {
                self.end(hand_over)?;
            }
        }
        Ok(())
    }

    /// Hands over what there is.
    fn end(&mut self, hand_over: &mut impl FnMut(Chunk) -> io::Result<()>) -> io::Result<()> {
        if self.samples.is_empty() {
            return Ok(());
        }
        hand_over(Chunk {
            position: self.position,
            number: self.number,
            samples: std::mem::take(&mut self.samples),
        })?;
        self.number += 1;
        Ok(())
    }
}

/// The samples of a chunk.
pub(super) fn decode(bytes: &[u8]) -> impl Iterator<Item = f64> {
    let (samples, _) = bytes.as_chunks();
    samples.iter().map(|sample| f64::from_le_bytes(*sample))
}
