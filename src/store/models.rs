//! Models that users wrote: each document kept once, under a reference that never means another.

use std::sync::Arc;

use jiff::Timestamp;
use serde_json::Value;

use super::StoreError;
use super::columns::{self, from_json, time};
use super::database::{self, QueryBuilder, Row};
use super::sealed::MODELS;
use super::shared_database::Database;
use super::writer::{Tx, in_transaction};
use crate::access::Project;
use greybox::identification::JobId;

/// The models that no job was made with that one server keeps at the most. One more takes the place
/// of the oldest of the client that has the most of them.
pub const MAX_UNUSED_MODELS: i64 = 500;

/// A model to be stored.
#[derive(Clone, Debug)]
pub struct NewModel {
    /// The project that the model belongs to.
    pub project: Project,
    /// `name@digest`, by which jobs name it.
    pub reference: String,
    /// The name that its author gave.
    pub name: String,
    /// The digest of its document.
    pub digest: String,
    /// The document.
    pub document: Value,
    /// Who brings it: the address that it comes from.
    pub client: String,
}

/// A stored model.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelRow {
    /// `name@digest`, by which jobs name it.
    pub reference: String,
    /// The digest of its document.
    pub digest: String,
    /// The document.
    pub document: Value,
    /// When the model was stored.
    pub created_at: Timestamp,
}

/// What became of a model that was to be stored.
#[derive(Clone, Debug, PartialEq)]
pub enum ModelStored {
    /// The model is new.
    Created(ModelRow),
    /// A model with the same document was stored before.
    There(ModelRow),
}

/// What became of a wish to remove a model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ModelRemoval {
    /// It is gone.
    Removed,
    /// There is no such model.
    NotFound,
    /// These jobs were made with it; the first few of them.
    InUse(Vec<JobId>),
}

const SELECT: &str = "select project, reference, digest, document, created_at, seal from models";

/// A model of its row.
fn read(row: &Row) -> Result<ModelRow, StoreError> {
    MODELS.verify(row)?;
    let reference: &str = row.try_get("reference")?;
    Ok(ModelRow {
        document: from_json("document", reference, row.try_get("document")?)?,
        created_at: time(reference, row.try_get("created_at")?)?,
        digest: row.try_get("digest")?,
        reference: reference.to_owned(),
    })
}

/// Models that users wrote.
#[derive(Clone)]
pub struct Models {
    pub(super) database: Arc<Database>,
}

impl Models {
    /// Stores a model, or finds the one of its project that has the same digest.
    pub async fn insert(&self, new: NewModel) -> Result<ModelStored, StoreError> {
        in_transaction!(self.database, |tx| insert(tx, new)).await
    }

    /// A model of a project. The names of the catalogue have no digest and are not looked for.
    pub async fn find(
        &self,
        project: &Project,
        reference: &str,
    ) -> Result<Option<ModelRow>, StoreError> {
        if !reference.contains('@') {
            return Ok(None);
        }
        let mut query = QueryBuilder::new(SELECT);
        query.push(" where project = ").push_bind(project.as_str());
        query.push(" and reference = ").push_bind(reference);
        let row = query.build().fetch_optional(&self.database.readers).await?;
        row.as_ref().map(read).transpose()
    }

    /// A stored model, whose ever it is: a reference names the same document everywhere. The names
    /// of the catalogue have no digest and are not looked for.
    pub async fn by_reference(&self, reference: &str) -> Result<Option<ModelRow>, StoreError> {
        if !reference.contains('@') {
            return Ok(None);
        }
        let mut query = QueryBuilder::new(SELECT);
        query.push(" where reference = ").push_bind(reference);
        query.push(" limit 1");
        let row = query.build().fetch_optional(&self.database.readers).await?;
        row.as_ref().map(read).transpose()
    }

    /// All models of a project, newest first.
    pub async fn list(&self, project: &Project) -> Result<Vec<ModelRow>, StoreError> {
        let mut query = QueryBuilder::new(SELECT);
        query.push(" where project = ").push_bind(project.as_str());
        query.push(" order by created_at desc, reference");
        let rows = query.build().fetch_all(&self.database.readers).await?;
        rows.iter().map(read).collect()
    }

    /// Removes a model of a project that no job of it was made with.
    pub async fn delete(
        &self,
        project: &Project,
        reference: &str,
    ) -> Result<ModelRemoval, StoreError> {
        let (project, reference) = (project.clone(), reference.to_owned());
        in_transaction!(self.database, |tx| delete(tx, project, reference)).await
    }
}

pub(super) async fn insert(tx: &mut Tx, new: NewModel) -> Result<ModelStored, StoreError> {
    let mut query = QueryBuilder::new(SELECT);
    query
        .push(" where project = ")
        .push_bind(new.project.as_str());
    // A row whose digest is damaged is found by the reference.
    query.push(" and (digest = ").push_bind(&new.digest);
    query.push(" or reference = ").push_bind(&new.reference);
    query.push(")");
    let same = query.build().fetch_optional(&mut **tx).await?;
    if let Some(same) = same {
        return Ok(ModelStored::There(read(&same)?));
    }
    let created_at = Timestamp::now();
    let (document, at) = (new.document.to_string(), created_at.to_string());
    let seal = MODELS.seal(&[
        new.project.as_str().into(),
        (&new.reference).into(),
        (&new.digest).into(),
        (&document).into(),
        (&at).into(),
    ]);
    database::query(
        "insert into models (project, reference, name, digest, document, created_at, client, seal) \
         values ($1, $2, $3, $4, $5, $6, $7, $8)",
    )
    .bind(new.project.as_str())
    .bind(&new.reference)
    .bind(&new.name)
    .bind(&new.digest)
    .bind(document)
    .bind(at)
    .bind(&new.client)
    .bind(seal)
    .execute(&mut **tx)
    .await?;
    make_room(tx, &new.project, &new.reference).await?;
    Ok(ModelStored::Created(ModelRow {
        reference: new.reference,
        digest: new.digest,
        document: new.document,
        created_at,
    }))
}

/// Forgets an unused model where there are too many, and not the one that just came.
async fn make_room(tx: &mut Tx, project: &Project, but_not: &str) -> Result<(), StoreError> {
    const UNUSED: &str = "not exists (select 1 from jobs where jobs.project = models.project \
                          and jobs.model = models.reference)";
    let mut count = QueryBuilder::new("select count(*) from models where ");
    count.push(UNUSED);
    let count: i64 = count.build_query_scalar().fetch_one(&mut **tx).await?;
    if count <= MAX_UNUSED_MODELS {
        return Ok(());
    }
    let mut removal = QueryBuilder::new(
        "with unused as (select project, reference, client, created_at from models \
         where (project, reference) <> (",
    );
    removal.push_bind(project.as_str()).push(", ");
    removal.push_bind(but_not).push(") and ").push(UNUSED).push(
        "), greediest as (select project, client from unused group by project, client \
             order by count(*) desc, project, client limit 1) \
             delete from models where (project, reference) = (select project, reference from unused \
             where (project, client) = (select project, client from greediest) \
             order by created_at, reference limit 1)",
    );
    removal.build().execute(&mut **tx).await?;
    Ok(())
}

async fn delete(
    tx: &mut Tx,
    project: Project,
    reference: String,
) -> Result<ModelRemoval, StoreError> {
    let users: Vec<String> = database::query_scalar(
        "select id from jobs where project = $1 and model = $2 order by id limit 10",
    )
    .bind(project.as_str())
    .bind(&reference)
    .fetch_all(&mut **tx)
    .await?;
    if !users.is_empty() {
        let users = users.iter().map(|job| columns::parse_id(job));
        return Ok(ModelRemoval::InUse(users.collect::<Result<_, _>>()?));
    }
    let removed = database::query("delete from models where project = $1 and reference = $2")
        .bind(project.as_str())
        .bind(&reference)
        .execute(&mut **tx)
        .await?;
    Ok(if removed == 0 {
        ModelRemoval::NotFound
    } else {
        ModelRemoval::Removed
    })
}
