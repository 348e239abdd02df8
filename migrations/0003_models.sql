-- Models that users wrote. A row never changes; its reference is its name and part of its digest.

create table models (
    reference  text not null primary key,
    name       text not null,
    digest     text not null unique,
    document   text not null,
    created_at text not null
) strict;

create index jobs_by_model on jobs (model, id);
