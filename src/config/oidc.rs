//! The identity provider at which people sign in.

use std::path::{Path, PathBuf};

use clap::Args;

use super::SettingsError;
use crate::api::session_cookie::CALLBACK;
use crate::identity::{ProviderSettings, callback, secure_address};
use crate::outbound::trust;

/// The claim that has the name of a person.
const DEFAULT_NAME_CLAIM: &str = "preferred_username";
/// The claim that has the groups of a person.
const DEFAULT_GROUPS_CLAIM: &str = "groups";
/// The scope that the provider is asked for beside `openid`.
const DEFAULT_SCOPE: &str = "profile";

/// How people sign in at the plant's identity provider.
#[derive(Clone, Debug, Args)]
pub struct OidcArguments {
    /// The issuer of the identity provider at which people sign in to the page by OpenID Connect, e.g.
    /// `https://login.plant.example/realms/plant`; what they may do goes by their groups (--role)
    #[arg(
        long,
        env = "GREYBOX_OIDC_ISSUER",
        value_name = "URL",
        requires_all = ["oidc_client_id", "public_url"]
    )]
    pub oidc_issuer: Option<String>,

    /// The name of this server at the provider
    #[arg(
        long,
        env = "GREYBOX_OIDC_CLIENT_ID",
        value_name = "NAME",
        requires = "oidc_issuer"
    )]
    pub oidc_client_id: Option<String>,

    /// A file with the secret of this server at the provider [default: the provider gave none]
    #[arg(
        long,
        env = "GREYBOX_OIDC_CLIENT_SECRET_FILE",
        value_name = "FILE",
        requires = "oidc_issuer"
    )]
    pub oidc_client_secret_file: Option<PathBuf>,

    /// A scope that the provider is asked for beside `openid`, so that it tells name and groups; repeat the flag or
    /// separate scopes by commas
    #[arg(
        long = "oidc-scope",
        env = "GREYBOX_OIDC_SCOPES",
        value_name = "SCOPE",
        value_delimiter = ',',
        default_value = DEFAULT_SCOPE
    )]
    pub oidc_scopes: Vec<String>,

    /// The claim with the name of a person; the subject's identifier where there is no such claim
    #[arg(
        long,
        env = "GREYBOX_OIDC_NAME_CLAIM",
        value_name = "CLAIM",
        default_value = DEFAULT_NAME_CLAIM
    )]
    pub oidc_name_claim: String,

    /// The claim with the groups of a person, a list or one text
    #[arg(
        long,
        env = "GREYBOX_OIDC_GROUPS_CLAIM",
        value_name = "CLAIM",
        default_value = DEFAULT_GROUPS_CLAIM
    )]
    pub oidc_groups_claim: String,

    /// Authorities that are trusted for the provider beside the system's, a file in PEM
    #[arg(
        long,
        env = "GREYBOX_OIDC_CA",
        value_name = "FILE",
        requires = "oidc_issuer"
    )]
    pub oidc_ca: Option<PathBuf>,

    /// The address under which people open the page, e.g. `https://greybox.plant.example`. The provider has to know
    /// `/v1/session/callback` below it as an address to return to
    #[arg(long, env = "GREYBOX_PUBLIC_URL", value_name = "URL")]
    pub public_url: Option<String>,
}

impl Default for OidcArguments {
    fn default() -> Self {
        Self {
            oidc_issuer: None,
            oidc_client_id: None,
            oidc_client_secret_file: None,
            oidc_scopes: vec![DEFAULT_SCOPE.to_owned()],
            oidc_name_claim: DEFAULT_NAME_CLAIM.to_owned(),
            oidc_groups_claim: DEFAULT_GROUPS_CLAIM.to_owned(),
            oidc_ca: None,
            public_url: None,
        }
    }
}

impl OidcArguments {
    /// The provider, where one is named.
    ///
    /// # Errors
    /// An address cannot be used, or a file.
    pub fn provider(&self) -> Result<Option<ProviderSettings>, SettingsError> {
        let (Some(issuer), Some(client_id), Some(server)) =
            (&self.oidc_issuer, &self.oidc_client_id, &self.public_url)
        else {
            return Ok(None);
        };
        secure_address(issuer)?;
        let secret = self.oidc_client_secret_file.as_deref();
        let scopes = self.oidc_scopes.iter().map(|scope| scope.trim());
        Ok(Some(ProviderSettings {
            issuer: issuer.clone(),
            client_id: client_id.clone(),
            client_secret: secret.map(read_secret).transpose()?,
            scopes: scopes
                .filter(|scope| !scope.is_empty())
                .map(str::to_owned)
                .collect(),
            name_claim: self.oidc_name_claim.clone(),
            groups_claim: self.oidc_groups_claim.clone(),
            callback: callback(server, CALLBACK)?,
            authorities: trust::of_the_system_and(self.oidc_ca.as_deref())?,
        }))
    }

    /// The name in the address under which people open the page.
    pub(super) fn public_name(&self) -> Option<String> {
        let url = secure_address(self.public_url.as_deref()?).ok()?;
        url.host_str().map(str::to_owned)
    }
}

/// The secret in a file: its first line.
fn read_secret(file: &Path) -> Result<String, SettingsError> {
    let unusable = |why: String| SettingsError::ClientSecret {
        path: file.to_owned(),
        why,
    };
    let text = std::fs::read_to_string(file).map_err(|error| unusable(error.to_string()))?;
    let secret = text.lines().next().unwrap_or_default().trim();
    match secret.is_empty() {
        true => Err(unusable("its first line is empty".to_owned())),
        false => Ok(secret.to_owned()),
    }
}
