-- For how long the counter of a node has stood still at its value `silent_beat`, counted in the beats of those
-- who observe it [ms]: an observer that begins goes on with it. Servers before this count for themselves.
alter table nodes add column silent_beat bigint;
alter table nodes add column silence_ms bigint not null default 0;

-- Recordings on their way in: their samples are stored part by part, and their row comes last. Of one whose
-- server is gone the parts are removed.
create table unfinished_datasets (
    dataset text collate "C" not null primary key,
    -- The life of the server that stores it.
    life    bigint not null
);

-- Parts come before the recording that they belong to, and go with it.
alter table dataset_chunks drop constraint dataset_chunks_dataset_fkey;
create function remove_dataset_chunks() returns trigger language plpgsql as $$
begin
    delete from dataset_chunks where dataset = old.id;
    return null;
end
$$;
create trigger dataset_chunks_go after delete on datasets
for each row execute function remove_dataset_chunks();
