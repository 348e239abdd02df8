//! Whether the draws from a posterior can be relied on.

use super::{Case, short};
use crate::uncertainty::posterior::{CoordinatePosterior, LARGEST_R_HAT, LEAST_ESS, Posterior};
use crate::uncertainty::verdict::{Doubt, Rule, Trust};
use greybox_numerics::convergence::Convergence;

impl Case<'_> {
    /// Chains that have not converged, where draws from the posterior were asked for.
    pub(super) fn posterior(&self) -> Option<Doubt> {
        let posterior = self.analysis.posterior.as_deref()?;
        if posterior.draws == 0 {
            let detail = "no chain of the posterior could begin: the simulation fails at draws near the \
                          estimate, and the intervals are those of the curvature; look at the search ranges";
            return Some(Doubt::new(
                Rule::PosteriorNotConverged,
                Trust::Moderate,
                detail,
            ));
        }
        let has_not = |(_, coordinate): &(usize, &CoordinatePosterior)| !coordinate.has_converged();
        let open = posterior.coordinates.iter().enumerate().filter(has_not);
        let open: Vec<usize> = open.map(|(index, _)| index).collect();
        if open.is_empty() {
            return None;
        }
        let names: Vec<String> = open
            .iter()
            .map(|index| format!("`{}`", self.problem.coordinates[*index].name))
            .collect();
        let detail = format!(
            "after {} generations the chains of the posterior have not converged for {}{}: the quantiles may be \
             off; ask for more `posterior_generations`",
            posterior.generations,
            names.join(", "),
            figures(posterior, &open)
        );
        let doubt = Doubt::new(Rule::PosteriorNotConverged, Trust::Moderate, detail);
        Some(doubt.concerning(open))
    }
}

/// The worst figures of some coordinates in words; empty where a chain has not moved at all.
fn figures(posterior: &Posterior, coordinates: &[usize]) -> String {
    let each = coordinates
        .iter()
        .map(|index| posterior.coordinates[*index].convergence);
    let Some(each) = each.collect::<Option<Vec<Convergence>>>() else {
        return String::new();
    };
    let r_hat = each.iter().map(|of| of.r_hat).fold(0.0, f64::max);
    let sizes = each.iter().map(|of| of.ess_bulk.min(of.ess_tail));
    let size = sizes.fold(f64::INFINITY, f64::min);
    format!(
        " (R̂ {r_hat:.3}, where less than {LARGEST_R_HAT} is asked for, and an effective sample size of {}, where \
         more than {LEAST_ESS} is)",
        short(size)
    )
}
