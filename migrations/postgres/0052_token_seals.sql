-- What a token allows is sealed as other rows are (0045): a changed scope or project is found when the token is used.
alter table tokens add column seal bigint;
