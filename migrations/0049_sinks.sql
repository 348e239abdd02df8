-- What collecting agents write becomes samples of streams by rules: a mapping for each database or bucket that
-- agents name.
create table mappings (
    project    text    not null,
    -- The database or bucket.
    name       text    not null,
    rules      text    not null,
    -- Samples of series that no rule names and that are not listed, because the list is full.
    unlisted   integer not null default 0,
    created_at text    not null,
    changed_at text    not null,
    primary key (project, name)
) strict, without rowid;

-- Series that came and that no rule names. Their samples are not kept.
create table unmapped_series (
    project    text    not null,
    mapping    text    not null,
    -- The measurement, the tags and the field, as JSON.
    series     text    not null,
    samples    integer not null,
    -- The value of the sample with the latest instant, as JSON, and the instant, nanoseconds since 1970.
    last_value text    not null,
    last_ns    integer not null,
    primary key (project, mapping, series),
    foreign key (project, mapping) references mappings (project, name) on delete cascade
) strict, without rowid;

-- A token that appends names the streams that it appends to, as a JSON array.
alter table tokens add column streams text;

-- SQLite has no statement that changes a check of a column; what follows is its documented way
-- (https://www.sqlite.org/lang_altertable.html, "making other kinds of table schema changes").
pragma writable_schema = on;
update sqlite_master set sql = replace(sql, '(scope in (''read''', '(scope in (''append'', ''read''')
    where type = 'table' and name = 'tokens';
pragma writable_schema = reset;
create temporary table checks_changed (n integer not null check (n = 1));
insert into checks_changed select count(*) from sqlite_master
    where name = 'tokens' and sql like '%in (''append'', ''read''%';
drop table checks_changed;
