//! Files that a program leaves in a folder, as exports are: each is brought whole, as the server reads any file.

use std::collections::BTreeMap;
use std::fs::Metadata;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use jiff::{SignedDuration, Timestamp};

use super::error::CollectError;
use super::page::{ReadStretch, SeriesPage};
use super::series::SourceSeries;

/// The types of files by the ends of their names; all others are text.
const TYPES: [(&str, &str); 5] = [
    ("json", "application/json"),
    ("parquet", "application/vnd.apache.parquet"),
    (
        "xlsx",
        "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet",
    ),
    ("csv", "text/csv"),
    ("gz", "text/csv"),
];
/// Bytes of a file at the most.
const LARGEST_FILE: u64 = 1 << 30;

/// A folder, and how long a file must have rested before it is read.
#[derive(Clone, Debug)]
pub struct Folder {
    pub(super) path: PathBuf,
    pub(super) rest: SignedDuration,
}

/// A file and the instant at which it came or was changed last.
struct FolderFile {
    name: String,
    changed: Timestamp,
}

impl Folder {
    /// The first file that came or changed in a stretch of time, and whose name fits the pattern of the series.
    pub(super) async fn read(
        &self,
        series: &SourceSeries,
        stretch: &ReadStretch,
    ) -> Result<SeriesPage, CollectError> {
        let (path, pattern) = (self.path.clone(), series.table.clone());
        let now = Timestamp::now();
        let rested = now.checked_sub(self.rest).unwrap_or(Timestamp::MIN);
        let between = stretch.between.start..stretch.between.end.min(rested);
        let read = tokio::task::spawn_blocking(move || {
            let files = files(&path, &pattern)?;
            let next = files
                .into_iter()
                .find(|file| between.start < file.changed && file.changed <= between.end);
            let Some(file) = next else {
                return Ok::<_, std::io::Error>(SeriesPage::default());
            };
            let path = path.join(&file.name);
            let is_too_large = std::fs::metadata(&path)?.len() > LARGEST_FILE;
            let mut refusal =
                is_too_large.then(|| format!("the file has more than {LARGEST_FILE} bytes"));
            let body = match &refusal {
                Some(_) => Vec::new(),
                None => match std::fs::read(&path) {
                    // A change of its rights is a change of the file, so that it is read then.
                    Err(error) if error.kind() == ErrorKind::PermissionDenied => {
                        refusal = Some(error.to_string());
                        Vec::new()
                    }
                    read => read?,
                },
            };
            Ok(SeriesPage {
                body,
                refusal,
                content_type: type_of(&file.name),
                rows: 0,
                newest: Some(file.changed),
                file: Some(file.name),
                options: BTreeMap::new(),
            })
        });
        let read = read
            .await
            .unwrap_or_else(|error| std::panic::resume_unwind(error.into_panic()));
        read.map_err(|error| CollectError::SourceAway(format!("{}: {error}", self.path.display())))
    }
}

/// The files of a folder whose names fit a pattern, in the order in which they came. Files of one instant are a
/// nanosecond apart, in the order of their names.
fn files(folder: &Path, pattern: &str) -> std::io::Result<Vec<FolderFile>> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let Ok(name) = entry.file_name().into_string() else {
            continue;
        };
        let metadata = std::fs::metadata(entry.path())?;
        if metadata.is_file() && fits(pattern, &name) {
            let changed = changed(&metadata)?;
            files.push(FolderFile { name, changed });
        }
    }
    files.sort_by(|a, b| (a.changed, &a.name).cmp(&(b.changed, &b.name)));
    let mut before = Timestamp::MIN;
    for file in &mut files {
        let next = before.checked_add(SignedDuration::from_nanos(1));
        file.changed = file.changed.max(next.unwrap_or(before));
        before = file.changed;
    }
    Ok(files)
}

/// When a file came into its folder or was changed last, whatever its date says: tools that copy keep the date.
fn changed(metadata: &Metadata) -> std::io::Result<Timestamp> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt as _;
        let nanoseconds = i32::try_from(metadata.ctime_nsec()).unwrap_or_default();
        Timestamp::new(metadata.ctime(), nanoseconds).map_err(std::io::Error::other)
    }
    #[cfg(not(unix))]
    {
        metadata
            .modified()?
            .try_into()
            .map_err(std::io::Error::other)
    }
}

fn type_of(name: &str) -> &'static str {
    let end = name.rsplit('.').next().unwrap_or_default().to_lowercase();
    let entry = TYPES.iter().find(|(suffix, _)| *suffix == end);
    entry.map_or("text/plain", |(_, content_type)| content_type)
}

/// Whether a name fits a pattern, in which `*` stands for any characters and `?` for one.
fn fits(pattern: &str, name: &str) -> bool {
    let (pattern, name): (Vec<char>, Vec<char>) =
        (pattern.chars().collect(), name.chars().collect());
    // Which beginnings of the name the pattern so far fits.
    let mut fitting = vec![false; name.len() + 1];
    fitting[0] = true;
    for wanted in pattern {
        let before = fitting.clone();
        for end in 0..fitting.len() {
            let one_more = end > 0 && before[end - 1] && (wanted == '?' || name[end - 1] == wanted);
            fitting[end] = match wanted {
                '*' => before[end] || end > 0 && fitting[end - 1],
                _ => one_more,
            };
        }
    }
    fitting[name.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_fits_whole_names() {
        for (pattern, name, is_fit) in [
            ("*.csv", "week 12.csv", true),
            ("*.csv", "week 12.csv.tmp", false),
            ("press_??_*.csv", "press_07_2026.csv", true),
            ("press_??_*.csv", "press_7_2026.csv", false),
            ("*", "", true),
            ("", "x", false),
            ("a*b*c", "a-b-b-c", true),
        ] {
            assert_eq!(fits(pattern, name), is_fit, "{pattern} {name}");
        }
    }

    #[test]
    fn files_of_one_instant_are_told_apart() {
        let folder = tempfile::tempdir().unwrap();
        let [first, second] = ["a.csv", "b.csv"].map(|name| folder.path().join(name));
        std::fs::write(&second, "x").unwrap();
        // Two links to one file have one instant.
        std::fs::hard_link(second, first).unwrap();
        std::fs::write(folder.path().join("c.txt"), "x").unwrap();
        let files = files(folder.path(), "*.csv").unwrap();
        let [first, second] = &files[..] else {
            panic!("{} files", files.len());
        };
        assert_eq!([&*first.name, &*second.name], ["a.csv", "b.csv"]);
        let apart = second.changed.duration_since(first.changed);
        assert_eq!(apart, SignedDuration::from_nanos(1));
    }
}
