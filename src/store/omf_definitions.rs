//! Types and containers that senders of the Open Message Format define under a mapping.

use std::collections::{BTreeMap, BTreeSet};

use sqlx::FromRow;

use super::StoreError;
use super::columns::{from_json, json};
use super::database::{self, QueryBuilder};
use super::mappings::Mappings;
use super::sealed::OMF_DEFINITIONS;
use super::writer::{Tx, in_transaction};
use crate::access::Project;
use greybox::intake::omf::{
    ContainerDefinition, DefinedContainer, DefinitionChange, DefinitionKey, DefinitionKind,
    OmfDefinition, TypeDefinition,
};

/// Types and containers under a mapping at the most.
pub const MAX_DEFINITIONS: usize = 20_000;
/// Bytes of the types and containers under a mapping at the most, without their ids.
pub const MAX_DEFINITION_BYTES: u64 = 16 << 20;
/// Rows that are read or written with one statement.
const ROWS_TOGETHER: usize = 100;

/// What became of definitions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DefinitionsPut {
    /// The changes are on disk.
    Stored,
    /// The mapping would have more than [`MAX_DEFINITIONS`] or [`MAX_DEFINITION_BYTES`]; nothing is changed.
    TooMany,
    /// There is no mapping of the name.
    NoMapping,
}

#[derive(FromRow)]
struct DefinitionColumns {
    id: String,
    definition: String,
}

impl Mappings {
    /// Stores and removes definitions in their order. Removing what is not there is no fault.
    pub async fn define(
        &self,
        project: &Project,
        mapping: &str,
        changes: Vec<DefinitionChange>,
    ) -> Result<DefinitionsPut, StoreError> {
        let (project, mapping) = (project.clone(), mapping.to_owned());
        in_transaction!(self.database, |tx| define(tx, project, mapping, changes)).await
    }

    /// Containers by their ids, without the ids that are not defined.
    pub async fn containers(
        &self,
        project: &Project,
        mapping: &str,
        ids: BTreeSet<String>,
    ) -> Result<BTreeMap<String, DefinedContainer>, StoreError> {
        let of_kind = async |kind, ids| self.definitions(project, mapping, kind, ids).await;
        let containers = of_kind(DefinitionKind::Container, ids).await?.into_iter();
        let containers: BTreeMap<String, ContainerDefinition> = containers
            .filter_map(|(id, definition)| Some((id, definition.into_container()?)))
            .collect();
        let type_ids = containers.values().map(|container| &container.type_id);
        let mut missing: BTreeSet<String> = type_ids.cloned().collect();
        let mut types: BTreeMap<String, TypeDefinition> = BTreeMap::new();
        // First the types of containers, then those of their properties.
        for _ in 0..2 {
            let read = of_kind(DefinitionKind::Type, missing).await?.into_iter();
            types.extend(read.filter_map(|(id, definition)| Some((id, definition.into_type()?))));
            let of_properties = types.values().flat_map(TypeDefinition::types);
            let of_properties = of_properties.filter(|id| !types.contains_key(*id));
            missing = of_properties.map(str::to_owned).collect();
        }
        let containers = containers.into_iter().filter_map(|(id, container)| {
            let defined = DefinedContainer::of(&container, &types)?;
            Some((id, defined))
        });
        Ok(containers.collect())
    }

    /// Definitions of a kind by their ids.
    async fn definitions(
        &self,
        project: &Project,
        mapping: &str,
        kind: DefinitionKind,
        ids: BTreeSet<String>,
    ) -> Result<BTreeMap<String, OmfDefinition>, StoreError> {
        let ids: Vec<String> = ids.into_iter().collect();
        let mut definitions = BTreeMap::new();
        for ids in ids.chunks(ROWS_TOGETHER) {
            let mut query = OMF_DEFINITIONS.select();
            query
                .push("omf_definitions where project = ")
                .push_bind(project.as_str());
            query.push(" and mapping = ").push_bind(mapping.to_owned());
            query.push(" and kind = ").push_bind(kind.name());
            query.push(" and id in (");
            let mut places = query.separated(", ");
            for id in ids {
                places.push_bind(id.clone());
            }
            query.push(")");
            for row in query.build().fetch_all(&self.database.readers).await? {
                OMF_DEFINITIONS.verify(&row)?;
                let DefinitionColumns { id, definition } = row.read()?;
                let definition = from_json("definition", &id, &definition)?;
                definitions.insert(id, definition);
            }
        }
        Ok(definitions)
    }
}

async fn define(
    tx: &mut Tx,
    project: Project,
    mapping: String,
    changes: Vec<DefinitionChange>,
) -> Result<DefinitionsPut, StoreError> {
    if !super::mappings::is_there(tx, &project, &mapping).await? {
        return Ok(DefinitionsPut::NoMapping);
    }
    // Where a definition changes several times, the last change counts.
    let mut last: BTreeMap<DefinitionKey, Option<String>> = BTreeMap::new();
    for change in changes {
        match change {
            DefinitionChange::Stored(key, definition) => last.insert(key, Some(json(&definition))),
            DefinitionChange::Removed(key) => last.insert(key, None),
        };
    }
    if !is_room(tx, &project, &mapping, &last).await? {
        return Ok(DefinitionsPut::TooMany);
    }
    let mut stored = Vec::with_capacity(last.len());
    for (key, definition) in last {
        match definition {
            Some(definition) => stored.push((key, definition)),
            None => remove(tx, &project, &mapping, key).await?,
        }
    }
    for rows in stored.chunks(ROWS_TOGETHER) {
        let mut query = QueryBuilder::new(
            "insert into omf_definitions (project, mapping, kind, id, definition) ",
        );
        query.push_values(rows, |mut row, (key, definition)| {
            row.push_bind(project.as_str());
            row.push_bind(mapping.as_str());
            row.push_bind(key.kind.name());
            row.push_bind(key.id.clone());
            row.push_bind(definition.clone());
        });
        query.push(
            " on conflict (project, mapping, kind, id) do update set definition = excluded.definition \
             where omf_definitions.definition <> excluded.definition",
        );
        query.build().execute(&mut **tx).await?;
    }
    Ok(DefinitionsPut::Stored)
}

/// Whether a mapping has room for changes.
async fn is_room(
    tx: &mut Tx,
    project: &Project,
    mapping: &str,
    changes: &BTreeMap<DefinitionKey, Option<String>>,
) -> Result<bool, StoreError> {
    let rows: Vec<(String, String, i64)> = database::query_as(
        "select kind, id, cast(octet_length(definition) as bigint) from omf_definitions \
         where project = $1 and mapping = $2",
    )
    .bind(project.as_str())
    .bind(mapping)
    .fetch_all(&mut **tx)
    .await?;
    let sizes = rows.into_iter();
    let mut sizes: BTreeMap<(String, String), u64> = sizes
        .map(|(kind, id, bytes)| ((kind, id), bytes.unsigned_abs()))
        .collect();
    for (key, definition) in changes {
        let named = (key.kind.name().to_owned(), key.id.clone());
        match definition {
            Some(definition) => sizes.insert(named, definition.len() as u64),
            None => sizes.remove(&named),
        };
    }
    let has_room = sizes.len() <= MAX_DEFINITIONS;
    Ok(has_room && sizes.values().sum::<u64>() <= MAX_DEFINITION_BYTES)
}

async fn remove(
    tx: &mut Tx,
    project: &Project,
    mapping: &str,
    key: DefinitionKey,
) -> Result<(), StoreError> {
    database::query(
        "delete from omf_definitions where project = $1 and mapping = $2 and kind = $3 and id = $4",
    )
    .bind(project.as_str())
    .bind(mapping)
    .bind(key.kind.name())
    .bind(key.id)
    .execute(&mut **tx)
    .await?;
    Ok(())
}
