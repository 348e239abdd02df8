//! Sealed rows that a project keeps under names: all of them, one by its name, and the removal of one.

use super::StoreError;
use super::database::{QueryBuilder, Row};
use super::sealed::Sealed;
use super::shared_database::Database;
use super::writer::in_transaction;
use crate::access::Project;

/// A statement that reads the rows of a project, up to a further condition.
fn select(sealed: &Sealed, project: &Project) -> QueryBuilder {
    let mut select = sealed.select();
    select.push(sealed.table).push(" where project = ");
    select.push_bind(project.as_str());
    select
}

/// A statement that reads the row of a name.
pub(super) fn select_named(sealed: &Sealed, project: &Project, name: &str) -> QueryBuilder {
    let mut select = select(sealed, project);
    select.push(" and name = ").push_bind(name.to_owned());
    select
}

/// The rows of a project by name, not verified.
pub(super) async fn all(
    database: &Database,
    sealed: &Sealed,
    project: &Project,
) -> Result<Vec<Row>, StoreError> {
    let mut query = select(sealed, project);
    query.push(" order by name");
    Ok(query.build().fetch_all(&database.readers).await?)
}

/// The row of a name, not verified.
pub(super) async fn find(
    database: &Database,
    sealed: &Sealed,
    project: &Project,
    name: &str,
) -> Result<Option<Row>, StoreError> {
    let query = select_named(sealed, project, name);
    Ok(query.build().fetch_optional(&database.readers).await?)
}

/// Removes the row of a name. Says whether there was one.
pub(super) async fn delete(
    database: &Database,
    sealed: &'static Sealed,
    project: &Project,
    name: &str,
) -> Result<bool, StoreError> {
    let (project, name) = (project.clone(), name.to_owned());
    in_transaction!(database, |tx| async move {
        let mut query = QueryBuilder::new("delete from ");
        query.push(sealed.table).push(" where project = ");
        query.push_bind(project.as_str());
        query.push(" and name = ").push_bind(name);
        Ok(query.build().execute(&mut **tx).await? == 1)
    })
    .await
}
