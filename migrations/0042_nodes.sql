-- The servers that work with the database, one row for each life of one: each start is a new one. A file
-- has one at a time.
create table nodes (
    life     integer not null primary key,
    -- For people: the machine and the process.
    name     text    not null,
    -- Raised again and again for as long as it lives, and how often [ms].
    beat     integer not null default 0,
    beat_ms  integer not null,
    -- `dead` is one that did not end in order.
    state    text    not null check (state in ('live', 'ended', 'dead')),
    begun_at text    not null
) strict;

insert into nodes (life, name, beat_ms, state, begun_at)
select number, '', 1000, case ended_in_order when 1 then 'ended' else 'live' end, '' from server_life;

drop table server_life;
