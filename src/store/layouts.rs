//! Layouts: options for reading tables, kept under a name for the next export of the kind.

use std::collections::BTreeMap;
use std::sync::Arc;

use jiff::Timestamp;
use sqlx::FromRow;

use super::columns::{from_json, json, time};
use super::database::{self, Row};
use super::sealed::LAYOUTS;
use super::shared_database::Database;
use super::writer::{Tx, in_transaction};
use super::{StoreError, named_rows};
use crate::access::Project;

/// Layouts that a project can have.
pub const MAX_LAYOUTS: i64 = 200;

/// The options of a layout by their names, as texts.
pub type LayoutOptions = BTreeMap<String, String>;

/// A layout as it stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SavedLayout {
    /// The name of the layout.
    pub name: String,
    /// The options.
    pub options: LayoutOptions,
    /// When the layout was made.
    pub created_at: Timestamp,
    /// When the options were last changed.
    pub changed_at: Timestamp,
}

/// The outcome of storing a layout.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LayoutPut {
    /// The layout is new.
    Created(SavedLayout),
    /// The options took the place of others.
    Replaced(SavedLayout),
    /// The project has [`MAX_LAYOUTS`] already.
    TooMany,
}

#[derive(FromRow)]
struct LayoutColumns {
    name: String,
    options: String,
    created_at: String,
    changed_at: String,
}

fn read(row: &Row) -> Result<SavedLayout, StoreError> {
    LAYOUTS.verify(row)?;
    let row: LayoutColumns = row.read()?;
    let of = &row.name;
    Ok(SavedLayout {
        options: from_json("options", of, &row.options)?,
        created_at: time(of, &row.created_at)?,
        changed_at: time(of, &row.changed_at)?,
        name: row.name,
    })
}

/// Options for reading tables, by name.
#[derive(Clone)]
pub struct Layouts {
    pub(super) database: Arc<Database>,
}

impl Layouts {
    /// Stores a layout, in the place of the one of its name where there is one.
    pub async fn put(
        &self,
        project: &Project,
        name: &str,
        options: LayoutOptions,
    ) -> Result<LayoutPut, StoreError> {
        let (project, name) = (project.clone(), name.to_owned());
        in_transaction!(self.database, |tx| put(tx, project, name, options)).await
    }

    /// The layouts of a project by name.
    pub async fn list(&self, project: &Project) -> Result<Vec<SavedLayout>, StoreError> {
        let rows = named_rows::all(&self.database, &LAYOUTS, project).await?;
        rows.iter().map(read).collect()
    }

    /// A layout of a project.
    pub async fn find(
        &self,
        project: &Project,
        name: &str,
    ) -> Result<Option<SavedLayout>, StoreError> {
        let row = named_rows::find(&self.database, &LAYOUTS, project, name).await?;
        row.as_ref().map(read).transpose()
    }

    /// Removes a layout. Says whether there was one.
    pub async fn delete(&self, project: &Project, name: &str) -> Result<bool, StoreError> {
        named_rows::delete(&self.database, &LAYOUTS, project, name).await
    }
}

async fn put(
    tx: &mut Tx,
    project: Project,
    name: String,
    options: LayoutOptions,
) -> Result<LayoutPut, StoreError> {
    let layouts: i64 =
        database::query_scalar("select count(*) from layouts where project = $1 and name <> $2")
            .bind(project.as_str())
            .bind(&name)
            .fetch_one(&mut **tx)
            .await?;
    if layouts >= MAX_LAYOUTS {
        return Ok(LayoutPut::TooMany);
    }
    let now = Timestamp::now();
    database::query(
        "insert into layouts (project, name, options, created_at, changed_at) \
         values ($1, $2, $3, $4, $5) on conflict (project, name) \
         do update set options = excluded.options, changed_at = excluded.changed_at",
    )
    .bind(project.as_str())
    .bind(&name)
    .bind(json(&options))
    .bind(now.to_string())
    .bind(now.to_string())
    .execute(&mut **tx)
    .await?;
    let stored = named_rows::select_named(&LAYOUTS, &project, &name);
    let stored = read(&stored.build().fetch_one(&mut **tx).await?)?;
    Ok(match stored.created_at == now {
        true => LayoutPut::Created(stored),
        false => LayoutPut::Replaced(stored),
    })
}
