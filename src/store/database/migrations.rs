//! Which migrations a database needs: a new one begins with the first schema that is kept.

use sqlx::migrate::{MigrateError, Migrator};

use crate::store::StoreError;

/// The schema that the first migration makes of a new database. An older database came to the same schema by
/// migrations that are no longer kept, the last of which had the same number.
const FIRST_SCHEMA: i64 = 44;

/// The migrations that a database of a schema may still need; a new database has no schema.
pub(super) fn migrations_after(
    schema: Option<i64>,
    all: &Migrator,
) -> Result<Migrator, StoreError> {
    let newest = all.iter().map(|migration| migration.version).max();
    match schema {
        Some(schema) if schema < FIRST_SCHEMA => {
            return Err(StoreError::TooOld {
                schema,
                oldest: FIRST_SCHEMA,
            });
        }
        Some(schema) if Some(schema) > newest => {
            return Err(MigrateError::VersionMissing(schema).into());
        }
        _ => {}
    }
    let is_made = |version| schema.is_some() && version == FIRST_SCHEMA;
    let rest = all.iter().filter(|migration| !is_made(migration.version));
    let mut rest = Migrator::with_migrations(rest.cloned().collect());
    rest.set_ignore_missing(true);
    Ok(rest)
}
