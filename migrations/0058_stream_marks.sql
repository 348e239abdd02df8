-- Marks of streams: stretches that people mark as bad, which recordings that are cut out of a stream do without.
create table stream_marks (
    project    text    not null,
    -- The name of the stream.
    name       text    not null,
    -- How often the marks were changed.
    number     integer not null,
    -- All marks, as JSON.
    marks      text    not null,
    changed_by text    not null,
    changed_at text    not null,
    seal       integer,
    primary key (project, name),
    foreign key (project, name) references streams (project, name) on delete cascade
) strict, without rowid;

create index stream_marks_without_seal on stream_marks (project, name) where seal is null;
create trigger stream_marks_lose_their_seal after update of number, marks, changed_by, changed_at on stream_marks
when new.seal is not null begin
    update stream_marks set seal = null where project = new.project and name = new.name;
end;
