-- The specification of a job changes where its name, its labels or its note do.
create trigger jobs_change after update of spec on jobs begin
    update job_bytes set bytes = bytes + octet_length(new.spec) - octet_length(old.spec) where job = new.id;
end;
