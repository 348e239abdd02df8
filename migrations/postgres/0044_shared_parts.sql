-- Not refits alone: whatever several nodes do of a job together.
alter table shared_refits rename to shared_parts;
alter table shared_parts rename column refit to part;

-- The oldest schema whose servers can work with the database as it is. A server that is older opens a database
-- of a newer schema from this one on.
create table schema_support (
    id     bigint not null primary key check (id = 1),
    oldest bigint not null
);

insert into schema_support (id, oldest) values (1, 44);
