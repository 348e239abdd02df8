-- Types and containers, which senders of the Open Message Format define once when they begin, by the mapping under
-- which they write.
create table omf_definitions (
    project    text collate "C" not null,
    mapping    text collate "C" not null,
    -- `type` or `container`, and the id that the sender chose.
    kind       text collate "C" not null check (kind in ('type', 'container')),
    id         text collate "C" not null,
    -- As JSON.
    definition text collate "C" not null,
    seal       bigint,
    primary key (project, mapping, kind, id),
    foreign key (project, mapping) references mappings (project, name) on delete cascade
);

create index omf_definitions_without_seal on omf_definitions (project, mapping, kind, id) where seal is null;
create trigger omf_definitions_lose_their_seal before update of definition on omf_definitions
for each row execute function lose_seal();
