-- What collecting agents write becomes samples of streams by rules: a mapping for each database or bucket that
-- agents name.
create table mappings (
    project    text collate "C" not null,
    -- The database or bucket.
    name       text collate "C" not null,
    rules      text collate "C" not null,
    -- Samples of series that no rule names and that are not listed, because the list is full.
    unlisted   bigint           not null default 0,
    created_at text collate "C" not null,
    changed_at text collate "C" not null,
    primary key (project, name)
);

-- Series that came and that no rule names. Their samples are not kept.
create table unmapped_series (
    project    text collate "C" not null,
    mapping    text collate "C" not null,
    -- The measurement, the tags and the field, as JSON.
    series     text collate "C" not null,
    samples    bigint           not null,
    -- The value of the sample with the latest instant, as JSON, and the instant, nanoseconds since 1970.
    last_value text collate "C" not null,
    last_ns    bigint           not null,
    primary key (project, mapping, series),
    foreign key (project, mapping) references mappings (project, name) on delete cascade
);

-- A token that appends names the streams that it appends to, as a JSON array. Servers before this do not take
-- such a token.
alter table tokens add column streams text collate "C";
alter table tokens drop constraint tokens_scope_check;
alter table tokens add constraint tokens_scope_check check (scope in ('append', 'read', 'submit', 'admin'));
