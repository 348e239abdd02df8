//! Roles: what the members of a group may do, as a proxy or a provider that knows people says who is one.

use std::str::FromStr;

use super::{Project, Scope};

/// What the members of one group may do, in one project: `group=scope` or `group=scope:project`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Role {
    group: String,
    /// How much.
    pub scope: Scope,
    /// Where.
    pub project: Project,
}

/// A text that says no role.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{text}` is no role of the form group=scope or group=scope:project: {why}")]
pub struct InvalidRole {
    text: String,
    why: String,
}

impl FromStr for Role {
    type Err = InvalidRole;

    fn from_str(text: &str) -> Result<Self, InvalidRole> {
        let invalid = |why: String| InvalidRole {
            text: text.to_owned(),
            why,
        };
        let (group, role) = text
            .rsplit_once('=')
            .ok_or_else(|| invalid("it has no `=`".to_owned()))?;
        let (scope, project) = match role.split_once(':') {
            None => (role, Ok(Project::default())),
            Some((scope, project)) => (scope, project.parse()),
        };
        let group = group.trim();
        if group.is_empty() || group.contains(',') {
            return Err(invalid("it names no single group".to_owned()));
        }
        let scope = scope.parse().map_err(|why| invalid(format!("{why}")))?;
        if scope == Scope::Append {
            return Err(invalid(
                "the scope append is for tokens, which name streams".to_owned(),
            ));
        }
        Ok(Self {
            group: group.to_owned(),
            scope,
            project: project.map_err(|why| invalid(why.to_string()))?,
        })
    }
}

/// All roles, in their order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Roles(Vec<Role>);

impl Roles {
    /// These roles.
    #[must_use]
    pub fn new(roles: Vec<Role>) -> Self {
        Self(roles)
    }

    /// The role of somebody who is in these groups: the first one that one of them has.
    #[must_use]
    pub fn of<G: AsRef<str>>(&self, groups: &[G]) -> Option<&Role> {
        let is_in = |group: &str| groups.iter().any(|name| name.as_ref().trim() == group);
        self.0.iter().find(|role| is_in(&role.group))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_role_that_a_group_has_counts() {
        let role = |text: &str| text.parse::<Role>().expect("a role");
        let roles = Roles::new(vec![role("plant it=admin"), role("operators=read:hall-2")]);
        assert_eq!(
            roles.of(&["x", " operators ", "plant it"]).map(|r| r.scope),
            Some(Scope::Admin)
        );
        let role = roles.of(&["operators"]).expect("a role");
        assert_eq!((role.scope, role.project.as_str()), (Scope::Read, "hall-2"));
        assert_eq!(roles.of(&["plant"]), None);
        assert_eq!(roles.of::<&str>(&[]), None);
        for text in [
            "admin", "=read", "a=write", "a=read:B", "a,b=read", "a=append",
        ] {
            assert!(text.parse::<Role>().is_err(), "{text}");
        }
    }
}
