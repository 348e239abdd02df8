-- Versions of recordings: what people marked as bad in a recording, which itself never changes. A row never changes.
create table dataset_versions (
    dataset    text collate "C" not null references datasets (id) on delete cascade,
    number     bigint not null check (number > 0),
    -- All marks of the version, as JSON.
    marks      text collate "C" not null,
    made_by    text collate "C" not null,
    created_at text collate "C" not null,
    seal       bigint,
    primary key (dataset, number)
);

create index dataset_versions_without_seal on dataset_versions (dataset, number) where seal is null;

-- Layouts: options for reading tables, which a project keeps under a name.
create table layouts (
    project    text collate "C" not null,
    name       text collate "C" not null,
    -- Texts by the names of the options, as JSON.
    options    text collate "C" not null,
    created_at text collate "C" not null,
    changed_at text collate "C" not null,
    seal       bigint,
    primary key (project, name)
);

create index layouts_without_seal on layouts (project, name) where seal is null;
create trigger layouts_lose_their_seal before update of options, changed_at on layouts
for each row execute function lose_seal();
