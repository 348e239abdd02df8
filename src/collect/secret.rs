//! Secrets that a sources file names and never holds: the first line of a file, a variable of the environment, or a
//! credential that systemd hands to the service.

use std::ffi::OsString;
use std::fmt;
use std::path::{Path, PathBuf};

use super::document::SourcesTable;

/// Where systemd puts the credentials of a service.
const CREDENTIALS: &str = "CREDENTIALS_DIRECTORY";

/// A secret. Neither logs nor errors show it.
#[derive(Clone)]
pub struct SourceSecret(String);

impl SourceSecret {
    /// The text itself, for the request that needs it.
    pub(super) fn expose(&self) -> &str {
        &self.0
    }
}

impl fmt::Debug for SourceSecret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SourceSecret(…)")
    }
}

/// Takes a secret by its place, `{ file = "…" }`, `{ variable = "…" }` or `{ credential = "…" }`. A secret that
/// stands in the sources file itself is refused. Paths are seen from `folder`.
pub(super) fn take(table: &mut SourcesTable, key: &str, folder: &Path) -> Option<SourceSecret> {
    const PLACES: [&str; 3] = ["file", "variable", "credential"];
    if !table.has(key) {
        return None;
    }
    let refusal = format!(
        "`{key}` says where a secret is, {{ file = \"…\" }}, {{ variable = \"…\" }} or {{ credential = \"…\" }}: \
         the secret itself does not belong into this file"
    );
    if !table.is_table(key) {
        table.fault_at(key, refusal);
        table.skip(key);
        return None;
    }
    let mut place = table.table(key, &format!("`{key}`"))?;
    let file = place.text("file").map(|file| folder.join(file));
    let variable = place.text("variable");
    let credential = place.text("credential");
    let secret = match (file, variable, credential) {
        (Some(file), None, None) => of_file(&file),
        (None, Some(variable), None) => of_variable(&variable),
        (None, None, Some(credential)) => of_credential(&credential),
        _ => Err(refusal),
    };
    let secret = secret.map_err(|detail| place.fault(detail)).ok();
    place.end(&PLACES);
    secret.map(SourceSecret)
}

fn of_file(file: &Path) -> Result<String, String> {
    let shown = file.display();
    let text = std::fs::read_to_string(file);
    let text = text.map_err(|error| format!("the file {shown} cannot be read: {error}"))?;
    let line = text.lines().next().unwrap_or_default().trim();
    match line.is_empty() {
        true => Err(format!("the first line of the file {shown} is empty")),
        false => Ok(line.to_owned()),
    }
}

fn of_variable(name: &str) -> Result<String, String> {
    let value = std::env::var_os(name).filter(|value| !value.is_empty());
    let value = value.ok_or_else(|| format!("the variable {name} is not set"))?;
    let text = OsString::into_string(value);
    text.map_err(|_| format!("the variable {name} is no text"))
}

fn of_credential(name: &str) -> Result<String, String> {
    let folder = std::env::var_os(CREDENTIALS).map(PathBuf::from);
    let folder = folder.ok_or_else(|| {
        format!("there is no credential `{name}`: {CREDENTIALS} is not set, so systemd did not start the collector")
    })?;
    of_file(&folder.join(name))
}
