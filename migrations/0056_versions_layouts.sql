-- Versions of recordings: what people marked as bad in a recording, which itself never changes. A row never changes.
create table dataset_versions (
    dataset    text    not null references datasets (id) on delete cascade,
    number     integer not null check (number > 0),
    -- All marks of the version, as JSON.
    marks      text    not null,
    made_by    text    not null,
    created_at text    not null,
    seal       integer,
    primary key (dataset, number)
) strict, without rowid;

create index dataset_versions_without_seal on dataset_versions (dataset, number) where seal is null;

-- The marks of a recording count among its bytes.
create trigger recordings_grow after update of bytes on datasets when new.bytes <> old.bytes begin
    update stored_bytes set samples = samples + new.bytes - old.bytes where project = new.project;
end;

-- Layouts: options for reading tables, which a project keeps under a name.
create table layouts (
    project    text    not null,
    name       text    not null,
    -- Texts by the names of the options, as JSON.
    options    text    not null,
    created_at text    not null,
    changed_at text    not null,
    seal       integer,
    primary key (project, name)
) strict, without rowid;

create index layouts_without_seal on layouts (project, name) where seal is null;
create trigger layouts_lose_their_seal after update of options, changed_at on layouts
when new.seal is not null begin
    update layouts set seal = null where project = new.project and name = new.name;
end;
