//! The pictures of the guides, and the recordings that their examples are about. `tests/page/pictures.mjs` makes
//! both.

/// An attachment is a file that a guide shows or links to.
pub struct Attachment {
    /// The address under which the server has the file.
    pub path: &'static str,
    /// The content of the file.
    pub bytes: &'static [u8],
}

/// Embeds the files of each folder of `docs/`, which are served as `/docs/…`.
macro_rules! attachments {
    ($($folder:literal: $($file:literal)+;)+) => {
        &[$($(Attachment {
            path: concat!("/docs/", $folder, "/", $file),
            bytes: include_bytes!(concat!("docs/", $folder, "/", $file)),
        }),+),+]
    };
}

/// The files stand in the order of the guides that show them.
#[rustfmt::skip]
pub static ATTACHMENTS: &[Attachment] = attachments! {
    "pictures": "example_bouc_wen.webp" "example_cascaded_tanks.webp" "example_dc_motor.webp"
        "example_double_rod_cylinder.webp" "example_first_order_dead_time.webp" "example_heat_exchanger.webp"
        "example_mass_spring_damper.webp" "example_positioning_drive.webp" "example_single_rod_servo.webp"
        "rule_at_bound.webp" "rule_not_identifiable.webp" "rule_correlated.webp" "rule_wide_interval.webp"
        "rule_misfit.webp" "rule_slight_misfit.webp" "rule_noise_contradicted.webp" "rule_noise_unknown.webp"
        "rule_residuals_not_white.webp" "rule_residuals_follow_input.webp" "rule_opposite_sign.webp"
        "rule_worse_on_validation.webp" "rule_starts_disagree.webp" "rule_plateau.webp" "rule_twin_minima.webp"
        "rule_assumption_contradicted.webp" "rule_drift.webp" "rule_assumptions_dominate.webp" "rule_disturbance.webp"
        "rule_disturbance_dominates.webp" "rule_noise_not_needed.webp" "rule_noise_models_disagree.webp"
        "rule_windows_disagree.webp" "rule_posterior_not_converged.webp" "rule_constraint_binds.webp"
        "rule_constraint_contradicted.webp" "rule_prior_contradicted.webp";
    "recordings": "bouc_wen.csv" "cascaded_tanks.csv" "dc_motor.csv" "double_rod_cylinder.csv" "first_order_dead_time.csv"
        "heat_exchanger.csv" "mass_spring_damper.csv" "positioning_drive.csv" "single_rod_servo.csv";
};

/// Gives the width and the height at which a picture is shown: three pixels of a picture are two of a guide. A picture
/// is a WebP (RFC 9649) whose first chunk is a lossy frame (`VP8 `), or says the size of the canvas (`VP8X`).
pub fn size(path: &str) -> Option<[u32; 2]> {
    let picture = ATTACHMENTS
        .iter()
        .find(|attachment| attachment.path == path)?;
    let head = picture.bytes.get(..30)?;
    let short = |at: usize| u32::from(u16::from_le_bytes([head[at], head[at + 1]]));
    let pixels = match &head[12..16] {
        b"VP8 " => [26, 28].map(|at| short(at) & 0x3fff),
        b"VP8X" => [24, 27].map(|at| 1 + short(at) + (u32::from(head[at + 2]) << 16)),
        _ => return None,
    };
    Some(pixels.map(|pixels| pixels * 2 / 3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_small_enough_to_be_a_part_of_the_program() {
        let sizes = |ending: &str| -> Vec<usize> {
            let files = ATTACHMENTS
                .iter()
                .filter(|file| file.path.ends_with(ending));
            files.map(|file| file.bytes.len()).collect()
        };
        let pictures = sizes(".webp");
        assert!(pictures.iter().all(|size| *size <= 25_000), "{pictures:?}");
        assert!(pictures.iter().sum::<usize>() <= 700_000, "{pictures:?}");
        assert!(sizes(".csv").iter().sum::<usize>() <= 200_000);
    }

    #[test]
    fn every_file_that_was_made_is_embedded() {
        for folder in ["pictures", "recordings"] {
            let place = concat!(env!("CARGO_MANIFEST_DIR"), "/src/dashboard/docs");
            let files = std::fs::read_dir(format!("{place}/{folder}")).unwrap();
            for file in files {
                let name = file.unwrap().file_name();
                let path = format!("/docs/{folder}/{}", name.display());
                assert!(ATTACHMENTS.iter().any(|file| file.path == path), "{path}");
            }
        }
    }
}
