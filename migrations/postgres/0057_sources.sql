-- Sources: what collectors beside historians say of the sources that they read, for people to look at.
create table sources (
    project        text collate "C" not null,
    name           text collate "C" not null,
    -- What the collector said last, as JSON.
    state          text collate "C" not null,
    first_heard_at text collate "C" not null,
    heard_at       text collate "C" not null,
    seal           bigint,
    primary key (project, name)
);

create index sources_without_seal on sources (project, name) where seal is null;
create trigger sources_lose_their_seal before update of state, heard_at on sources
for each row execute function lose_seal();
