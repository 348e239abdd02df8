//! The `method` section.

use crate::estimation::Settings;
use greybox_numerics::parsing::reader::Field;
use greybox_numerics::parsing::settings::Section as _;

/// The settings, which a method has to be able to work with.
pub(super) fn read(field: &Field<'_>) -> Settings {
    let settings = Settings::read(field);
    if let Some(detail) = settings.contradiction() {
        field.fault("contradiction", detail);
    }
    settings
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::uncertainty;
    use greybox_numerics::parsing::reader::Faults;
    use serde_json::json;

    #[test]
    fn too_few_fits_for_an_interval_are_refused_where_they_are_asked_for() {
        for (asked, is_refused) in [(0, false), (3, true), (100, false), (100_001, true)] {
            let document = json!({"monte_carlo_samples": asked});
            let faults = Faults::default();
            uncertainty::Settings::read(&Field::root(&document, &faults));
            let faults = faults.into_vec();
            assert_eq!(!faults.is_empty(), is_refused, "{asked}: {faults:?}");
            assert!(
                faults
                    .iter()
                    .all(|fault| fault.pointer() == "/monte_carlo_samples")
            );
        }
    }
}
