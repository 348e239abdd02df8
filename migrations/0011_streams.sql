-- Recordings that grow: samples by their instant, in blocks that do not overlap.

create table streams (
    name        text    not null primary key,
    -- The signals in the order in which they came: names, units, how they go on.
    signals     text    not null,
    zone        text,
    samples     integer not null,
    bytes       integer not null,
    -- The first and the last instant, nanoseconds since 1970.
    first_ns    integer not null,
    last_ns     integer not null,
    -- What is kept: so long before the last instant, and so much.
    keep_s      real,
    keep_mib    integer not null,
    created_at  text    not null,
    received_at text    not null
) strict, without rowid;

-- Little endian: the instants (i64), then for each of the first signals of the stream its values (f64;
-- NaN is a missing sample), then for each of them a byte for the class of each sample.
create table stream_blocks (
    stream   text    not null references streams (name) on delete cascade,
    first_ns integer not null,
    last_ns  integer not null,
    rows     integer not null,
    samples  blob    not null,
    primary key (stream, first_ns)
) strict;

-- What was answered to batches that came with a key.
create table stream_batches (
    id     text not null primary key,
    answer text not null
) strict, without rowid;
