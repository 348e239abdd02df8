-- Marks of streams: stretches that people mark as bad, which recordings that are cut out of a stream do without.
create table stream_marks (
    project    text collate "C" not null,
    -- The name of the stream.
    name       text collate "C" not null,
    -- How often the marks were changed.
    number     bigint           not null,
    -- All marks, as JSON.
    marks      text collate "C" not null,
    changed_by text collate "C" not null,
    changed_at text collate "C" not null,
    seal       bigint,
    primary key (project, name),
    foreign key (project, name) references streams (project, name) on delete cascade
);

create index stream_marks_without_seal on stream_marks (project, name) where seal is null;
create trigger stream_marks_lose_their_seal before update of number, marks, changed_by, changed_at on stream_marks
for each row execute function lose_seal();
