-- The specification of a job changes where its name, its labels or its note do.
create function count_specification() returns trigger language plpgsql as $$
begin
    perform add_job_bytes(new.id, octet_length(new.spec) - octet_length(old.spec));
    return null;
end
$$;
create trigger jobs_change after update of spec on jobs
for each row execute function count_specification();
