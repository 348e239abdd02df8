//! Documents by reference: `name@digest` means one document for ever.

use super::runnable::{Read, read};
use crate::model::Model;
use greybox_numerics::parsing::fault::Fault;
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::sync::Arc;

/// The hexadecimal digits of the digest that a reference shows.
const DIGITS: usize = 16;

/// A document's model under its reference.
#[derive(Clone, Debug)]
pub struct Referenced {
    /// The name that its author gave.
    pub name: String,
    /// `sha256:…` of the whole document.
    pub digest: String,
    /// The model, whose name is `name@digest`.
    pub model: Arc<Model>,
    /// Warnings for the author.
    pub warnings: Vec<Fault>,
}

impl Referenced {
    /// `name@digest`.
    #[must_use]
    pub fn reference(&self) -> &str {
        &self.model.description().name
    }
}

/// Reads a document into a model that is named by reference.
///
/// # Errors
/// Everything that is wrong with it.
pub fn referenced(document: &Value) -> Result<Referenced, Vec<Fault>> {
    let Read { model, warnings } = read(document)?;
    let digest = Sha256::digest(document.to_string());
    let digest: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
    let name = model.description().name.to_string();
    let reference = format!("{name}@{}", &digest[..DIGITS]);
    Ok(Referenced {
        name,
        digest: format!("sha256:{digest}"),
        model: Arc::new(model.renamed(reference)),
        warnings,
    })
}
