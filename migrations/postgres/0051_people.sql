-- A session is begun with a token, or by a person at the identity provider.
alter table sessions alter column token drop not null;
-- The name of the person, and the groups as a JSON array.
alter table sessions add column person text collate "C";
alter table sessions add column in_groups text collate "C";
alter table sessions add check ((token is null) = (person is not null));
alter table sessions add check ((person is null) = (in_groups is null));

create index sessions_by_person on sessions (person, created_at);
