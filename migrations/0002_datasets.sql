-- Recordings. Samples are little-endian f64, cut into chunks so that no row is large.

create table datasets (
    id          text    not null primary key,
    name        text,
    digest      text    not null unique,
    -- The recording without its samples: start, time axis, names and units.
    description text    not null,
    summary     text    not null,
    created_at  text    not null
) strict;

-- Position 0 is the time axis of a recording that is not uniform; signals follow from 1.
create table dataset_chunks (
    dataset  text    not null references datasets (id) on delete cascade,
    position integer not null,
    chunk    integer not null,
    samples  blob    not null,
    primary key (dataset, position, chunk)
) strict;
