-- The servers that work with the database, one row for each life of one: each start is a new one.
create table nodes (
    life     bigint not null primary key,
    -- For people: the machine and the process.
    name     text   not null,
    -- Raised again and again for as long as it lives, and how often [ms].
    beat     bigint not null default 0,
    beat_ms  bigint not null,
    -- `dead` is one that did not end in order.
    state    text collate "C" not null check (state in ('live', 'ended', 'dead')),
    begun_at text   not null
) with (fillfactor = 50);

insert into nodes (life, name, beat_ms, state, begun_at)
select number, '', 1000, case when ended_in_order then 'ended' else 'live' end, '' from server_life;

drop table server_life;
