-- Types and containers, which senders of the Open Message Format define once when they begin, by the mapping under
-- which they write.
create table omf_definitions (
    project    text    not null,
    mapping    text    not null,
    -- `type` or `container`, and the id that the sender chose.
    kind       text    not null check (kind in ('type', 'container')),
    id         text    not null,
    -- As JSON.
    definition text    not null,
    seal       integer,
    primary key (project, mapping, kind, id),
    foreign key (project, mapping) references mappings (project, name) on delete cascade
) strict, without rowid;

create index omf_definitions_without_seal on omf_definitions (project, mapping, kind, id) where seal is null;
create trigger omf_definitions_lose_their_seal after update of definition on omf_definitions
when new.seal is not null begin
    update omf_definitions set seal = null
    where project = new.project and mapping = new.mapping and kind = new.kind and id = new.id;
end;
