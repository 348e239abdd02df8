-- A session is begun with a token, or by a person at the identity provider.
create table sessions_of_both (
    -- A digest of what stands in the cookie, which is not kept.
    digest     text    not null primary key,
    token      integer references tokens (id) on delete cascade,
    -- The name of the person, and the groups as a JSON array.
    person     text,
    in_groups  text,
    created_at text    not null,
    expires_at text    not null,
    check ((token is null) = (person is not null)),
    check ((person is null) = (in_groups is null))
) strict, without rowid;

insert into sessions_of_both (digest, token, created_at, expires_at)
    select digest, token, created_at, expires_at from sessions;
drop table sessions;
alter table sessions_of_both rename to sessions;

create index sessions_by_token on sessions (token, created_at);
create index sessions_by_person on sessions (person, created_at);
