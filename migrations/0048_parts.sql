-- For how long the counter of a node has stood still at its value `silent_beat`, counted in the beats of those
-- who observe it [ms]: an observer that begins goes on with it.
alter table nodes add column silent_beat integer;
alter table nodes add column silence_ms integer not null default 0;

-- Recordings on their way in: their samples are stored part by part, and their row comes last. Of one whose
-- server is gone the parts are removed.
create table unfinished_datasets (
    dataset text    not null primary key,
    -- The life of the server that stores it.
    life    integer not null
) strict, without rowid;

-- Parts come before the recording that they belong to, and go with it. SQLite has no statement that takes a
-- reference away and leaves the table as it is; what follows is its documented way
-- (https://www.sqlite.org/lang_altertable.html, "making other kinds of table schema changes").
pragma writable_schema = on;
update sqlite_master set sql = replace(sql, ' references datasets (id) on delete cascade', '')
    where type = 'table' and name = 'dataset_chunks';
pragma writable_schema = reset;
create temporary table references_left (n integer not null check (n = 0));
insert into references_left select count(*) from pragma_foreign_key_list('dataset_chunks');
drop table references_left;
create trigger dataset_chunks_go after delete on datasets begin
    delete from dataset_chunks where dataset = old.id;
end;
