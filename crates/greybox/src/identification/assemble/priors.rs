//! What is known of several parameters together.

use crate::estimation::prior::JointPrior;
use crate::identification::JobSpec;
use greybox_simulation::model::ModelDescription;

/// The joint priors of a specification that exists, whose covariances are so sound.
pub(super) fn joint(spec: &JobSpec, description: &ModelDescription) -> Vec<JointPrior> {
    let joint = spec.priors.iter().filter_map(|prior| {
        let place = |name: &String| description.parameter_index(name);
        let places = prior.parameters.iter().map(place).collect::<Option<_>>()?;
        JointPrior::new(places, prior.scale, &prior.mean, &prior.covariance)
    });
    joint.collect()
}
