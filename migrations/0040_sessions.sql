-- People at the page, who brought a token: each request of a session is one of its token.

create table sessions (
    -- A digest of what stands in the cookie, which is not kept.
    digest     text    not null primary key,
    token      integer not null references tokens (id) on delete cascade,
    created_at text    not null,
    expires_at text    not null
) strict, without rowid;

create index sessions_by_token on sessions (token, created_at);
