-- The audit log as a chain: the digest of each entry covers the entry and the digest of the entry before it. Entries
-- from before this migration have none. Servers before this add entries without a digest.

alter table audit add column chain text collate "C";
update schema_support set oldest = 47;

-- The newest entry that went, from which the chain goes on.
create table audit_anchor (
    id    bigint not null primary key check (id = 1),
    entry bigint not null,
    chain text collate "C"
);

create trigger audit_is_not_emptied before truncate on audit
for each statement execute function audit_is_only_added_to();
