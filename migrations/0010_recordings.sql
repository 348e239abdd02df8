-- What is shown of a recording says when it began. Recordings of earlier versions knew it, but in
-- the description only.

update datasets
set summary = json_set(summary, '$.start', json_extract(description, '$.start'))
where json_extract(description, '$.start') is not null;
