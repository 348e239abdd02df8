-- Sources: what collectors beside historians say of the sources that they read, for people to look at.
create table sources (
    project        text not null,
    name           text not null,
    -- What the collector said last, as JSON.
    state          text not null,
    first_heard_at text not null,
    heard_at       text not null,
    seal           integer,
    primary key (project, name)
) strict, without rowid;

create index sources_without_seal on sources (project, name) where seal is null;
create trigger sources_lose_their_seal after update of state, heard_at on sources
when new.seal is not null begin
    update sources set seal = null where project = new.project and name = new.name;
end;
