//! The lines of the metrics that a caller may read.
//!
//! Lines without a project are of the server, whose operator reads them with a token of the project `default`. Lines
//! that name a project are for callers of the project, and for the operator as an administrator.

use super::client::Client;
use crate::access::{Project, Scope};
use crate::store::AuditHead;

/// Whether a caller reads the lines of every project, and the head of the audit log.
pub(super) fn are_all_shown_to(client: &Client) -> bool {
    !client.is_known || (client.project == Project::default() && client.scope == Scope::Admin)
}

/// The lines for a caller. A comment stays with the lines that it describes.
pub(super) fn shown_to(client: &Client, rendered: &str) -> String {
    if are_all_shown_to(client) {
        return rendered.to_owned();
    }
    let label = format!("project=\"{}\"", client.project);
    let is_of_operator = client.project == Project::default();
    let mut shown = String::new();
    let mut comments = String::new();
    let mut follows_comment = false;
    for line in rendered.lines() {
        if line.starts_with('#') {
            if !follows_comment {
                comments.clear();
            }
            follows_comment = true;
            comments.push_str(line);
            comments.push('\n');
            continue;
        }
        follows_comment = false;
        let is_shown = match labels(line) {
            Some(labels) if labels.contains("project=\"") => {
                labels.split(',').any(|part| part == label)
            }
            _ => is_of_operator && !line.is_empty(),
        };
        if is_shown {
            shown.push_str(&std::mem::take(&mut comments));
            shown.push_str(line);
            shown.push('\n');
        }
    }
    shown
}

/// The labels of a line, where the line has some.
fn labels(line: &str) -> Option<&str> {
    let (_, rest) = line.split_once('{')?;
    let (labels, _) = rest.rsplit_once('}')?;
    Some(labels)
}

/// The line of the audit log's head: the number of the last entry, and its digest as a label.
pub(super) fn of_audit_head(head: &AuditHead) -> String {
    format!(
        "# TYPE greybox_audit_head gauge\ngreybox_audit_head{{sha256=\"{}\"}} {}\n",
        head.chain, head.entry
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const RENDERED: &str = "\
# TYPE greybox_jobs gauge
greybox_jobs{status=\"queued\"} 2

# HELP greybox_work_seconds_total time
# TYPE greybox_work_seconds_total counter
greybox_work_seconds_total{project=\"default\"} 5
greybox_work_seconds_total{project=\"hall-a\"} 7
greybox_work_seconds_total{project=\"hall-a-2\"} 9
";

    fn shown(project: &str, scope: Scope) -> String {
        let client = Client {
            project: project.parse().expect("a project"),
            scope,
            is_known: true,
            ..Client::local(String::new())
        };
        shown_to(&client, RENDERED)
    }

    #[test]
    fn a_project_reads_its_lines_and_the_operator_those_of_the_server() {
        let hall = "# HELP greybox_work_seconds_total time\n\
                    # TYPE greybox_work_seconds_total counter\n\
                    greybox_work_seconds_total{project=\"hall-a\"} 7\n";
        assert_eq!(shown("hall-a", Scope::Read), hall);
        assert_eq!(shown("hall-a", Scope::Admin), hall);
        assert_eq!(shown("hall-b", Scope::Read), "");
        let server = shown("default", Scope::Read);
        assert!(server.starts_with("# TYPE greybox_jobs gauge\ngreybox_jobs{"));
        assert!(server.contains("project=\"default\"} 5"), "{server}");
        assert!(!server.contains("hall-a"), "{server}");
        assert_eq!(shown("default", Scope::Admin), RENDERED);
    }
}
