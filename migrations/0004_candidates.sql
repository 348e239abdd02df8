-- Every candidate that a search simulated, once. Jobs that ran before this have none.

-- What is kept of a job's candidates.
create table candidate_records (
    job               text    not null primary key references jobs (id) on delete cascade,
    -- What each of a candidate's values stands for.
    columns           text    not null,
    kept              integer not null,
    -- The generation in which the limit was reached; what came later is not kept.
    cut_in_generation integer
) strict, without rowid;

-- A row for each generation that simulated any. The candidates stand one after another, little
-- endian: place (u32), failure (u8; 0 for none), cost (f64; NaN where it failed), values (f64 each).
create table candidates (
    job        text    not null references jobs (id) on delete cascade,
    generation integer not null,
    candidates blob    not null,
    primary key (job, generation)
) strict;
