//! Rows of samples as the bytes of a block.
//!
//! The bytes are [`MARK`], the number of signals (`u32`), and then parts: the instants, and for each signal
//! its runs and its values. A part is its length (`u32`) and as many bytes; numbers are little endian.
//! Instants and values are coded by [`pco`], which gives each bit back. The runs of a signal are pairs of a
//! byte and a length (LEB128): the byte says the class of the samples of the run, and by [`MISSING`] that they
//! are missing. Values are those of the samples that are there.
//!
//! Blocks of earlier versions have, instead: the instants (`i64`), for each signal its values (`f64`, NaN is
//! a missing sample), for each signal a byte for the class of each sample.

use pco::ChunkConfig;
use pco::standalone::{simple_compress, simple_decompress};

use greybox::recording::{Class, RowColumn, Rows};

/// How a block begins. In a block of earlier versions the same bytes are the first instant, and no sample was
/// taken in the first nanosecond of those that 64 bits can say, which lies in the year 1677.
const MARK: [u8; WORD] = i64::MIN.to_le_bytes();
/// The bit of a run whose samples are missing.
const MISSING: u8 = 1 << 7;
/// How hard `pco` tries, from 0 to 12: beyond, blocks of sensors became no smaller.
const LEVEL: usize = 4;
/// Bytes of an instant, of a value.
const WORD: usize = 8;

type Coded<T> = Result<T, &'static str>;

/// The bytes of rows.
pub(super) fn encode(rows: &Rows) -> Vec<u8> {
    let mut bytes = MARK.to_vec();
    let columns = u32::try_from(rows.columns.len()).expect("a stream has few signals");
    bytes.extend(columns.to_le_bytes());
    put(&mut bytes, &packed(&rows.instants));
    for column in &rows.columns {
        put(&mut bytes, &runs(column));
        let values = column.values.iter().copied();
        let values: Vec<f64> = values.filter(|value| !value.is_nan()).collect();
        put(&mut bytes, &packed(&values));
    }
    bytes
}

/// The rows of a block that has so many.
pub(super) fn decode(bytes: &[u8], rows: usize) -> Coded<Rows> {
    let Some(rest) = bytes.strip_prefix(&MARK) else {
        return earlier(bytes, rows);
    };
    let (columns, mut rest) = rest.split_first_chunk().ok_or(SHORT)?;
    let instants = unpacked(part(&mut rest)?)?;
    if instants.len() != rows {
        return Err("it has another number of rows");
    }
    let mut column = || {
        let runs = part(&mut rest)?;
        column(runs, &unpacked(part(&mut rest)?)?, rows)
    };
    let columns = 0..u32::from_le_bytes(*columns);
    Ok(Rows {
        columns: columns.map(|_| column()).collect::<Coded<_>>()?,
        instants,
    })
}

/// The instants of a block that has so many rows.
pub(super) fn instants(bytes: &[u8], rows: usize) -> Coded<Vec<i64>> {
    if let Some(rest) = bytes.strip_prefix(&MARK) {
        let (_, mut rest) = rest.split_first_chunk::<4>().ok_or(SHORT)?;
        return unpacked(part(&mut rest)?);
    }
    let (words, _) = words_of(bytes, rows)?;
    Ok(words.iter().map(|word| i64::from_le_bytes(*word)).collect())
}

const SHORT: &str = "it is too short";

fn put(bytes: &mut Vec<u8>, part: &[u8]) {
    let length = u32::try_from(part.len()).expect("a block is small");
    bytes.extend(length.to_le_bytes());
    bytes.extend(part);
}

/// Takes the next part off.
fn part<'a>(rest: &mut &'a [u8]) -> Coded<&'a [u8]> {
    let (length, after) = rest.split_first_chunk().ok_or(SHORT)?;
    let length = u32::from_le_bytes(*length) as usize;
    let (part, after) = after.split_at_checked(length).ok_or(SHORT)?;
    *rest = after;
    Ok(part)
}

fn packed<T: pco::data_types::Number>(numbers: &[T]) -> Vec<u8> {
    if numbers.is_empty() {
        return Vec::new();
    }
    let config = ChunkConfig::default().with_compression_level(LEVEL);
    simple_compress(numbers, &config).expect("the level is one of those that there are")
}

fn unpacked<T: pco::data_types::Number>(bytes: &[u8]) -> Coded<Vec<T>> {
    if bytes.is_empty() {
        return Ok(Vec::new());
    }
    simple_decompress(bytes).map_err(|_| "its numbers do not read back")
}

fn runs(column: &RowColumn) -> Vec<u8> {
    let kind = |(value, class): (&f64, &Class)| match value.is_nan() {
        true => *class as u8 | MISSING,
        false => *class as u8,
    };
    let kinds: Vec<u8> = column
        .values
        .iter()
        .zip(&column.classes)
        .map(kind)
        .collect();
    let mut runs = Vec::new();
    for run in kinds.chunk_by(|kind, next| kind == next) {
        runs.push(run[0]);
        let mut length = run.len();
        while length >= 1 << 7 {
            runs.push(length as u8 | 1 << 7);
            length >>= 7;
        }
        runs.push(length as u8);
    }
    runs
}

/// Takes the next run off: the byte, and how long it is.
fn run(rest: &mut &[u8]) -> Coded<(u8, usize)> {
    let mut next = || -> Coded<u8> {
        let (byte, after) = rest.split_first().ok_or(SHORT)?;
        *rest = after;
        Ok(*byte)
    };
    let kind = next()?;
    let mut length = 0;
    for shift in (0..usize::BITS).step_by(7) {
        let byte = next()?;
        length |= usize::from(byte & !(1 << 7)) << shift;
        if byte & 1 << 7 == 0 {
            return Ok((kind, length));
        }
    }
    Err("a run is too long")
}

fn column(mut runs: &[u8], values: &[f64], rows: usize) -> Coded<RowColumn> {
    let mut column = RowColumn::default();
    let mut values_left = values;
    while !runs.is_empty() {
        let (kind, length) = run(&mut runs)?;
        let until = column.classes.len().checked_add(length);
        let until = until.filter(|until| *until <= rows);
        let until = until.ok_or("a run is too long")?;
        column.classes.resize(until, class(kind & !MISSING)?);
        if kind & MISSING == 0 {
            let (now, later) = values_left.split_at_checked(length).ok_or(SHORT)?;
            column.values.extend(now);
            values_left = later;
        } else {
            column.values.resize(until, f64::NAN);
        }
    }
    if column.values.len() != rows || !values_left.is_empty() {
        return Err("a signal has another number of rows");
    }
    Ok(column)
}

fn class(code: u8) -> Coded<Class> {
    let classes = [
        Class::Good,
        Class::Uncertain,
        Class::Substituted,
        Class::Bad,
    ];
    let class_of_code = classes.into_iter().find(|class| *class as u8 == code);
    class_of_code.ok_or("a sample has no class")
}

/// The first `words` words, and the bytes behind them.
fn words_of(bytes: &[u8], words: usize) -> Coded<(&[[u8; WORD]], &[u8])> {
    let (words, rest) = bytes
        .split_at_checked(words.saturating_mul(WORD))
        .ok_or(SHORT)?;
    Ok((words.as_chunks().0, rest))
}

/// The rows of a block of an earlier version.
fn earlier(bytes: &[u8], rows: usize) -> Coded<Rows> {
    let (instants, rest) = words_of(bytes, rows)?;
    let columns = rest.len() / (rows * (WORD + 1)).max(1);
    if rest.len() != columns * rows * (WORD + 1) {
        return Err("it has another length");
    }
    let (values, classes) = words_of(rest, columns * rows)?;
    let column = |place: usize| {
        let of_column = place * rows..(place + 1) * rows;
        let values = values[of_column.clone()].iter();
        let classes = classes[of_column].iter();
        Ok(RowColumn {
            values: values.map(|word| f64::from_le_bytes(*word)).collect(),
            classes: classes.map(|code| class(*code)).collect::<Coded<_>>()?,
        })
    };
    Ok(Rows {
        instants: instants
            .iter()
            .map(|word| i64::from_le_bytes(*word))
            .collect(),
        columns: (0..columns).map(column).collect::<Coded<_>>()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rows(steps: &[i64], columns: Vec<Vec<(f64, u8)>>) -> Rows {
        let sums = steps.iter().scan(i64::MIN + 1, |at, step| {
            *at += step;
            Some(*at)
        });
        let column = |samples: Vec<(f64, u8)>| RowColumn {
            values: samples.iter().map(|(value, _)| *value).collect(),
            classes: samples
                .iter()
                .map(|(_, code)| class(*code).expect("a class"))
                .collect(),
        };
        Rows {
            instants: sums.collect(),
            columns: columns.into_iter().map(column).collect(),
        }
    }

    fn any_rows() -> impl Strategy<Value = Rows> {
        let value = prop_oneof![
            any::<f64>(),
            Just(f64::NAN),
            Just(-0.0),
            (0..4096_i32).prop_map(|code| f64::from(code) * 0.2 / 4096.0),
        ];
        let sample = (value, 0..4_u8);
        (1..300_usize, 0..4_usize).prop_flat_map(move |(rows_of, columns)| {
            let steps = prop::collection::vec(1..i64::MAX / 200, rows_of);
            let column = prop::collection::vec(sample.clone(), rows_of);
            let columns = prop::collection::vec(column, columns);
            (steps, columns).prop_map(|(steps, columns)| rows(&steps, columns))
        })
    }

    /// The bits of values; a missing sample is a missing sample whatever its bits.
    fn bits(rows: &Rows) -> Vec<Option<u64>> {
        let values = rows.columns.iter().flat_map(|column| &column.values);
        values
            .map(|value| (!value.is_nan()).then(|| value.to_bits()))
            .collect()
    }

    proptest! {
        #[test]
        fn each_bit_comes_back(rows in any_rows()) {
            let bytes = encode(&rows);
            let back = decode(&bytes, rows.rows()).expect("what was coded");
            prop_assert_eq!(&back.instants, &rows.instants);
            prop_assert_eq!(bits(&back), bits(&rows));
            for (column, coded) in back.columns.iter().zip(&rows.columns) {
                prop_assert_eq!(&column.classes, &coded.classes);
            }
            prop_assert_eq!(instants(&bytes, rows.rows()), Ok(rows.instants));
        }

        #[test]
        fn bytes_cut_off_are_refused(rows in any_rows(), share in 0.0..1.0) {
            let bytes = encode(&rows);
            let end = (bytes.len() as f64 * share) as usize;
            prop_assert!(decode(&bytes[..end], rows.rows()).is_err());
        }
    }

    #[test]
    fn a_block_of_an_earlier_version_reads() {
        let mut bytes = Vec::new();
        bytes.extend([5_i64, 7].iter().flat_map(|ns| ns.to_le_bytes()));
        bytes.extend(
            [1.5, f64::NAN]
                .iter()
                .flat_map(|value: &f64| value.to_le_bytes()),
        );
        bytes.extend([Class::Good as u8, Class::Bad as u8]);
        let read = decode(&bytes, 2).expect("a block");
        assert_eq!(read.instants, [5, 7]);
        assert_eq!(bits(&read), [Some(1.5_f64.to_bits()), None]);
        assert_eq!(read.columns[0].classes, [Class::Good, Class::Bad]);
        assert_eq!(instants(&bytes, 2), Ok(vec![5, 7]));
        assert!(decode(&bytes, 1).is_err());
    }

    #[test]
    fn samples_of_a_sensor_of_12_bits_take_a_tenth() {
        let of = |k: i32| {
            f64::from((f64::from(k) * 0.01).sin().mul_add(900.0, 2048.0) as i32 + k * 7 % 3)
        };
        let column = RowColumn {
            values: (0..3000).map(|k| of(k) * 0.2 / 4096.0).collect(),
            classes: vec![Class::Good; 3000],
        };
        let rows = Rows {
            instants: (0..3000)
                .map(|k| 1_700_000_000_000_000_000 + k * 1_000_000_000)
                .collect(),
            columns: vec![column],
        };
        let earlier_bytes = 3000 * (8 + 8 + 1);
        assert!(
            encode(&rows).len() * 10 < earlier_bytes,
            "{}",
            encode(&rows).len()
        );
    }
}
