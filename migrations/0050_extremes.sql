-- The extremes of each block of a stream, so that a plot of a year reads a few rows of each block. Blocks of
-- earlier versions have none.
--
-- Samples of a block are coded since this version as `src/store/streams/coding.rs` says. Blocks that were
-- stored before begin with their first instant, and stay as they are until something falls into them.
create table stream_extremes (
    stream   text    not null,
    first_ns integer not null,
    -- How many rows there are.
    rows     integer not null,
    -- Rows of the block, coded as those of a block are.
    samples  blob    not null,
    seal     integer,
    primary key (stream, first_ns),
    foreign key (stream, first_ns) references stream_blocks (stream, first_ns) on delete cascade
) strict;
