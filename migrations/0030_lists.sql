-- What a list of many jobs shows of each is read without its whole specification and result.

alter table jobs add column method text
    generated always as (json_extract(spec, '$.method.name')) virtual;

alter table results add column trust text
    generated always as (json_extract(outcome, '$.verdict.trust')) virtual;

create index results_by_trust on results (job, trust);
