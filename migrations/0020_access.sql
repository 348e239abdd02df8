-- Who may ask, whose everything is, and a log of who did what.

create table tokens (
    id           integer not null primary key,
    name         text    not null,
    -- SHA-256 of the secret, which is not kept.
    digest       text    not null unique,
    scope        text    not null check (scope in ('read', 'submit', 'admin')),
    project      text    not null,
    created_at   text    not null,
    expires_at   text,
    revoked_at   text,
    last_used_at text
) strict;

create unique index tokens_by_name on tokens (name) where revoked_at is null;

-- Everything that an earlier version stored belongs to the project `default`.
alter table jobs add column project text not null default 'default';
create index jobs_by_project on jobs (project, id);
create index jobs_by_project_and_status on jobs (project, status, id);

alter table comparisons add column project text not null default 'default';
create index comparisons_by_project on comparisons (project, id);

-- A recording is kept once in each project: what is unique is its project with its digest.
alter table datasets rename column digest to identity;
alter table datasets add column project text not null default 'default';
alter table datasets add column digest text not null default '';
update datasets set digest = identity, identity = project || ' ' || identity;
create index datasets_by_project on datasets (project, id);

-- A key is one of its project.
create table project_keys (
    project     text not null,
    key         text not null,
    body_digest text not null,
    made        text not null,
    primary key (project, key)
) strict, without rowid;
insert into project_keys select 'default', key, body_digest, made from idempotency;
drop table idempotency;
alter table project_keys rename to idempotency;

-- A reference names the same document in every project that has it.
create table project_models (
    project    text not null,
    reference  text not null,
    name       text not null,
    digest     text not null,
    document   text not null,
    created_at text not null,
    client     text not null,
    primary key (project, reference)
) strict;
insert into project_models
    select 'default', reference, name, digest, document, created_at, client from models;
drop table models;
alter table project_models rename to models;
create index models_by_reference on models (reference);
create index jobs_by_project_and_model on jobs (project, model);

-- Who changed what, and who was refused. Rows are added; they never change, and go only with age.
create table audit (
    id         integer not null primary key autoincrement,
    at         text    not null,
    who        text    not null,
    project    text,
    address    text    not null,
    method     text    not null,
    path       text    not null,
    status     integer not null,
    request_id text    not null,
    -- Refusals before this one that were too many to be written down singly.
    left_out   integer not null default 0
) strict;

create index audit_by_project on audit (project, id);

create trigger audit_never_changes before update on audit begin
    select raise(abort, 'the audit log is only added to');
end;

create trigger audit_is_kept before delete on audit
when julianday('now') - julianday(old.at) < 30 begin
    select raise(abort, 'the audit log is kept for 30 days at the least');
end;
