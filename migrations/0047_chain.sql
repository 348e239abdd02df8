-- The audit log as a chain: the digest of each entry covers the entry and the digest of the entry before it. Entries
-- from before this migration have none.

alter table audit add column chain text;

-- The newest entry that went, from which the chain goes on.
create table audit_anchor (
    id    integer not null primary key check (id = 1),
    entry integer not null,
    chain text
) strict;

-- `insert or replace` removes the row in its way without asking the trigger of removals.
create trigger audit_is_not_replaced before insert on audit
when exists (select 1 from audit where id = new.id) begin
    select raise(abort, 'the audit log is only added to');
end;
