//! What follows from other rows has to follow from them: counts of bytes, columns that the database computes, and
//! the entries of jobs in the queue.

use super::database::{Connection, Kind, QueryBuilder};
use super::{StoreError, queue};

/// Faults of one kind that are named.
const MOST_NAMED: usize = 100;

/// Looks at all that follows from other rows, in one transaction.
pub(super) async fn look(
    tx: &mut Connection,
    findings: &mut Vec<String>,
) -> Result<(), StoreError> {
    let kind = tx.kind();
    for job in keys(tx, QueryBuilder::new(JOB_BYTES)).await? {
        findings.push(format!(
            "{job} keeps another number of bytes than is counted"
        ));
    }
    for project in keys(tx, QueryBuilder::new(STORED_BYTES)).await? {
        let finding =
            format!("the project {project} keeps another number of bytes than is counted");
        findings.push(finding);
    }
    if kind == Kind::Postgres {
        for job in keys(tx, QueryBuilder::new(COMPUTED)).await? {
            findings.push(format!(
                "the method or the trust of {job} is not the one it has"
            ));
        }
        for oldest in keys(tx, QueryBuilder::new(OLDEST)).await? {
            let finding = format!("the oldest schema whose servers work with it would be {oldest}");
            findings.push(finding);
        }
    }
    for migration in keys(tx, QueryBuilder::new(HALF_DONE)).await? {
        findings.push(format!("the migration {migration} is half done"));
    }
    let mut entries = QueryBuilder::new(
        "select jobs.id from jobs join river_job on river_job.id = jobs.queue_entry \
         where jobs.status in ('queued', 'running') and not (",
    );
    entries.push(queue::is_entry_of_its_job(kind)).push(")");
    for job in keys(tx, entries).await? {
        findings.push(format!(
            "the entry of {job} in the queue is not one of this job"
        ));
    }
    Ok(())
}

/// Each job with a count of bytes that is not that of its rows, and each count of no job.
const JOB_BYTES: &str = "select jobs.id from jobs left join job_bytes on job_bytes.job = jobs.id \
    where coalesce(job_bytes.project, '') <> jobs.project or coalesce(bytes, -1) <> octet_length(spec) \
    + coalesce((select sum(octet_length(data)) from events where job = jobs.id), 0) \
    + coalesce((select sum(octet_length(g.row)) from generations as g where job = jobs.id), 0) \
    + coalesce((select sum(octet_length(candidates)) from candidates where job = jobs.id), 0) \
    + coalesce((select octet_length(outcome) from results where job = jobs.id), 0) \
    union all select job from job_bytes where not exists (select 1 from jobs where id = job)";

/// Each project with counts that are not those of what it keeps.
const STORED_BYTES: &str = "select project from ( \
    select project, cast(bytes as double precision) as samples, 0 as jobs, 0 as keys from datasets \
    union all select project, bytes, 0, 0 from streams \
    union all select project, 0, bytes, 0 from job_bytes \
    union all select project, 0, 0, octet_length(key) + octet_length(body_digest) + octet_length(made) \
        + coalesce((select octet_length(answer) from stream_batches where id = made), 0) from idempotency \
    union all select project, 0, 0, octet_length(signals) from signal_lists \
    union all select project, -cast(samples as double precision), -cast(jobs as double precision), \
        -cast(keys as double precision) from stored_bytes \
    ) as kept group by project having sum(samples) <> 0 or sum(jobs) <> 0 or sum(keys) <> 0";

/// Each job of a PostgreSQL with a method or a trust that is not that of its specification or its result.
const COMPUTED: &str = "select id from jobs where method is distinct from spec::json #>> '{method,name}' \
    union all select job from results where trust is distinct from outcome::json #>> '{verdict,trust}'";

/// The oldest schema whose servers work with a PostgreSQL, where it is newer than that of the database.
const OLDEST: &str = "select cast(oldest as text) from schema_support \
    where oldest > (select max(version) from _sqlx_migrations)";

const HALF_DONE: &str = "select cast(version as text) from _sqlx_migrations where not success";

/// What a statement with one column selects first.
async fn keys(tx: &mut Connection, mut statement: QueryBuilder) -> Result<Vec<String>, StoreError> {
    statement.push(format_args!(" limit {MOST_NAMED}"));
    Ok(statement.build_query_scalar().fetch_all(tx).await?)
}
