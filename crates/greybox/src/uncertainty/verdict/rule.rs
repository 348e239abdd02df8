//! The table of the rules: the code of each rule, how far it lowers the trust, when it speaks, what
//! it means and what to do. The guide, the page, the reports and the clients show this table.

use serde::{Deserialize, Serialize};
use std::fmt;
use utoipa::ToSchema;

/// What the table says of a rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ToSchema)]
#[schema(as = VerdictRule)]
pub struct RuleEntry {
    /// The word for programs, as in the reasons of a verdict.
    pub code: Rule,
    /// A few words for people.
    #[schema(example = "At an end of its search range")]
    pub title: &'static str,
    /// The rule that says the same thing most gravely, often the rule itself: reasons of one family
    /// about the same parameters are one conclusion.
    pub family: Rule,
    /// How far the rule lowers the trust.
    #[schema(example = "Low; moderate for an initial state.")]
    pub grades: &'static str,
    /// When the rule speaks.
    pub when: &'static str,
    /// What the reason means for the numbers.
    pub meaning: &'static str,
    /// What to do next.
    pub advice: &'static str,
}

impl RuleEntry {
    /// The chapter of the guide, in Markdown.
    #[must_use]
    pub fn chapter(&self) -> String {
        let RuleEntry {
            code,
            title,
            grades,
            when,
            meaning,
            advice,
            ..
        } = self;
        format!("## {code}\n\n**{title}.** {when} {meaning} {advice} *{grades}*\n")
    }
}

/// Declares the rules and what the table says of each.
macro_rules! rules {
    ($($rule:ident = $code:literal, $family:ident {
        title: $title:literal,
        grades: $grades:literal,
        when: $when:literal,
        meaning: $meaning:literal,
        advice: $advice:literal,
    })+) => {
        /// A rule of the verdict.
        #[derive(
            Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema,
        )]
        #[serde(rename_all = "snake_case")]
        #[schema(as = VerdictRuleCode)]
        pub enum Rule {
            $(#[doc = $title] $rule,)+
        }

        impl Rule {
            /// Every rule, in the order of the guide.
            pub const ALL: &'static [Rule] = &[$(Rule::$rule),+];

            /// The word for programs.
            #[must_use]
            pub fn code(self) -> &'static str {
                match self {
                    $(Rule::$rule => $code,)+
                }
            }

            /// What the table says of the rule.
            #[must_use]
            pub fn entry(self) -> RuleEntry {
                match self {
                    $(Rule::$rule => RuleEntry {
                        code: Rule::$rule,
                        title: $title,
                        family: Rule::$family,
                        grades: $grades,
                        when: $when,
                        meaning: $meaning,
                        advice: $advice,
                    },)+
                }
            }
        }
    };
}

impl fmt::Display for Rule {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.code())
    }
}

rules! {
    NotFinished = "not_finished", NotFinished {
        title: "Not finished",
        grades: "Low.",
        when: "The run was ended by its time limit, cancelled or paused before its refinement had finished.",
        meaning: "The numbers are the best so far.",
        advice: "Let the job run to its end.",
    }
    NotAnalysed = "not_analysed", NotFinished {
        title: "Not analysed",
        grades: "Low.",
        when: "The run was stopped before its estimate was analysed.",
        meaning: "Nothing is known of the errors of the numbers.",
        advice: "Let the job run to its end.",
    }
    SimulationFails = "simulation_fails", SimulationFails {
        title: "The simulation fails",
        grades: "Low.",
        when: "The model cannot be simulated at the estimate over the whole record.",
        meaning: "Nothing can be said of the errors of the numbers.",
        advice: "Look at the search ranges and at the equations for values at which the model has no solution.",
    }
    AtBound = "at_bound", AtBound {
        title: "At an end of its search range",
        grades: "Low; moderate for an initial state.",
        when: "An estimate stands at an end of its search range.",
        meaning: "The true value may be outside, or the estimate makes up for an effect that the model leaves out.",
        advice: "Widen the range; if the estimate runs to the end again, look for the effect.",
    }
    NotIdentifiable = "not_identifiable", NotIdentifiable {
        title: "Not fixed by the data",
        grades: "Low for the unknowns that it concerns; for all where no standard error can be had.",
        when: "The interval of an unknown is wider than its search range, or the outputs do not change along a \
               combination of unknowns.",
        meaning: "The data do not see an unknown, or see only a combination of several.",
        advice: "Give the value of one, or record an experiment that moves them separately: `POST /v1/designs` looks \
                 for it. A narrower range would only hide it.",
    }
    Correlated = "correlated", NotIdentifiable {
        title: "Known better together than apart",
        grades: "Moderate for the two.",
        when: "The errors of two unknowns are correlated by more than 0.95, and one of them is known to no more \
               than 2 %.",
        meaning: "The data fix a combination of the two better than either.",
        advice: "The value of one from a data sheet settles both.",
    }
    WideInterval = "wide_interval", NotIdentifiable {
        title: "Known too coarsely",
        grades: "Moderate beyond 10 % of the value; low beyond 50 %.",
        when: "Noise leaves a parameter a total standard error beyond 10 % of its value. Where a linear search range \
               holds or touches 0, the error is measured by a quarter of the largest magnitude of the range if the \
               value is smaller.",
        meaning: "The interval holds, and says little.",
        advice: "Record longer, or an experiment that excites the parameter more: `POST /v1/designs` looks for it.",
    }
    Misfit = "misfit", Misfit {
        title: "The model misses an effect",
        grades: "Low; moderate where noise models were compared and the free run explains 90 % of the output or more: the \
                 total intervals cover what each noise model says.",
        when: "What is left over is larger than the declared noise (χ² per sample above 1.5) and no plain noise, or, \
               where no noise is declared, neighbouring residuals are correlated by more than 0.3.",
        meaning: "The model misses an effect, and the parameters pay for it.",
        advice: "Free an effect such as friction, dead band, offset or gain, or let the data choose with \
                 `model_search`.",
    }
    SlightMisfit = "slight_misfit", Misfit {
        title: "Somewhat more than the noise is left over",
        grades: "Moderate.",
        when: "χ² per sample is between 1.15 and 1.5.",
        meaning: "The declared noise is too small, or the model misses a small effect.",
        advice: "Check the noise level and try a richer model.",
    }
    NoiseContradicted = "noise_contradicted", Misfit {
        title: "The declared noise is too large or too small for what is left",
        grades: "Too large: low where neighbouring residuals are correlated by more than 0.3, moderate where they have \
                 another memory or the fit is below 90 %, else a remark. Too small: moderate.",
        when: "Of more than 100 residuals no more than half of the declared variance can be white noise: χ² per sample \
               is below 0.5, or residuals that follow each other leave no room for it. Or the residuals are white, \
               follow no input, and χ² per sample is above 1.5.",
        meaning: "The declared noise is not believed: the intervals are made with what is left, and what has a memory is \
                  taken for what the model misses.",
        advice: "Give the noise that the sensor has from sample to sample. Errors of its gain, offset or lag belong into \
                 the tolerances of the output.",
    }
    NoiseUnknown = "noise_unknown", NoiseUnknown {
        title: "The noise is not declared",
        grades: "Moderate.",
        when: "No noise level is declared and the fit is below 90 %.",
        meaning: "Noise cannot be told from what the model misses.",
        advice: "Give `outputs.….noise_std` from the sensor's data sheet.",
    }
    ResidualsNotWhite = "residuals_not_white", Misfit {
        title: "Residuals with a memory",
        grades: "Moderate.",
        when: "Residuals up to 25 samples apart are correlated: two lags lie outside what chance allows at the 1 % level \
               and 0.1, one lag lies 1.5 times as far outside, or many lags are correlated a little (Ljung and Box).",
        meaning: "The model misses dynamics. The intervals are widened for it.",
        advice: "Free an effect that the model leaves out.",
    }
    ResidualsFollowInput = "residuals_follow_input", Misfit {
        title: "Residuals that follow an input",
        grades: "Moderate; low where noise models were compared and the correlation is beyond 0.25.",
        when: "The residuals are correlated with what an input was, at some lag.",
        meaning: "The model misses a part of the input's effect, such as a gain, an offset or a delay.",
        advice: "Free that part, or add it to the model.",
    }
    OppositeSign = "opposite_sign", OppositeSign {
        title: "The output moves the wrong way",
        grades: "Low.",
        when: "The simulated output moves against the measured one (a correlation below −0.5).",
        meaning: "A sign is wrong, of a signal in the recording or of a gain in the model.",
        advice: "Turn the sign of the signal or of the gain.",
    }
    WorseOnValidation = "worse_on_validation", WorseOnValidation {
        title: "Worse on the data held back",
        grades: "Moderate; low beyond twice, or where a constant would explain the data held back better.",
        when: "The error on the data that were held back is more than 1.3 times that on the data estimated from; \
               under a disturbance, fewer than 90 % of the samples held back lie within the 95 % band expected of them.",
        meaning: "The estimate does not carry over.",
        advice: "Use a longer or richer recording.",
    }
    StartsDisagree = "starts_disagree", StartsDisagree {
        title: "Only one start found the minimum",
        grades: "Moderate.",
        when: "No second start of the refinement reached the lowest cost.",
        meaning: "There may be a better minimum.",
        advice: "Search longer, with more candidates.",
    }
    Plateau = "plateau", StartsDisagree {
        title: "No better than a constant",
        grades: "Low.",
        when: "A constant explains the data as well as the estimate does.",
        meaning: "The search found nothing that follows the data.",
        advice: "Look at the search ranges and the initial states, or search longer, with more candidates.",
    }
    TwinMinima = "twin_minima", TwinMinima {
        title: "Two answers",
        grades: "Low for the parameters that differ.",
        when: "Another minimum, with other parameters, explains the data as well.",
        meaning: "The data alone do not say which of the two is true.",
        advice: "Say with the ranges or with a prior which one is meant.",
    }
    AssumptionContradicted = "assumption_contradicted", AssumptionContradicted {
        title: "The data contradict what was taken as known",
        grades: "By how far each parameter would move: low beyond three standard errors and 2 % of its value, \
                 moderate beyond one and 0.2 %, else a remark; low for what the data do not fix. Where noise models were \
                 compared, the total intervals cover the move, and low begins at 25 % of the value or where half an \
                 interval is more than half of the value; what explains no more than 5 % of what is left is moderate \
                 at worst.",
        when: "The residuals pull at a value that was taken as known by more than four standard deviations of noise, \
               to beyond what its tolerance allows: more than three standard deviations of it.",
        meaning: "The value is wrong, or something looks like it.",
        advice: "Free the value, or measure it.",
    }
    Drift = "drift", Drift {
        title: "Something changes within the record",
        grades: "By how far each parameter would move, as for `assumption_contradicted`; where noise models were \
                 compared, by how far windows of the record scatter.",
        when: "An unknown that is larger in one half of the record than in the other, or in the middle third than in \
               the rest, would explain what is left over, by more than four standard deviations of noise. The reason \
               says by how much.",
        meaning: "Something warms up, wears or was adjusted.",
        advice: "Estimate from a shorter window, or from parts of the record one by one.",
    }
    AssumptionsDominate = "assumptions_dominate", AssumptionsDominate {
        title: "What was taken as known leaves most open",
        grades: "Moderate beyond 10 % of the value; low beyond 50 %, or where the total interval is wider than the search \
                 range.",
        when: "What was taken as known adds more to the error of a parameter than the noise does, and the total \
               standard error is beyond 10 % of the value, measured as for `wide_interval`, or the total interval is \
               wider than the search range.",
        meaning: "More data would not help. The reason names the value whose better knowledge helps most, and by how \
                  much.",
        advice: "Measure that value.",
    }
    Disturbance = "disturbance", Disturbance {
        title: "Something that was not recorded moves the plant",
        grades: "A remark.",
        when: "A noise model with a disturbance was taken, by the data or by the job.",
        meaning: "The parameters and their intervals hold for the disturbance, if it follows neither the inputs nor \
                  the states: then its effect would be taken for the plant's.",
        advice: "Record what moves the plant, and give it to the model as an input.",
    }
    DisturbanceDominates = "disturbance_dominates", Disturbance {
        title: "The disturbance makes most of the movement",
        grades: "A remark.",
        when: "A disturbance makes more than half of the variance of an output.",
        meaning: "The parameters may hold, but a simulation from the inputs alone predicts little.",
        advice: "Record what moves the plant, or excite the plant more strongly.",
    }
    NoiseNotNeeded = "noise_not_needed", NoiseNotNeeded {
        title: "The disturbance is not needed",
        grades: "A remark.",
        when: "The record is about as likely without the disturbances that the job lists (twice the logarithm of the \
               likelihood ratio is below 2.71).",
        meaning: "Nothing is seen of them; the parameters are those of the free run.",
        advice: "Leave `process_noise` out.",
    }
    NoiseModelsDisagree = "noise_models_disagree", NoiseModelsDisagree {
        title: "Noise models disagree",
        grades: "By how far a parameter moves: moderate beyond one standard error and 0.2 % of the value, low beyond \
                 three and 25 %, or where half of the total interval is more than half of the value.",
        when: "Another noise model is within 10 of the lowest Bayesian criterion, or no noise model leaves white \
               innovations, and another moves a parameter. Or the free run, which knows of no disturbance, puts a \
               parameter further off than four standard deviations of both errors.",
        meaning: "The data do not say what moves the plant. The total interval covers what each of them says. A noise \
                  model whose disturbance would have left more than a hundred times as much in the free run as was left \
                  is no explanation, and is not counted.",
        advice: "Say in `process_noise` what is known to act, or record it.",
    }
    WindowsDisagree = "windows_disagree", WindowsDisagree {
        title: "Windows of the record disagree",
        grades: "Moderate; low where half of the total interval, which covers the scatter of the windows, is more than \
                 half of the value.",
        when: "Four windows of the record differ by more than chance makes them one time in a thousand, or what each \
               makes of a parameter spreads by more than twice what noise allows.",
        meaning: "Something changes within the record, or the model misses an effect that shows more in some windows.",
        advice: "Estimate from each window alone and look at what changes.",
    }
    PosteriorNotConverged = "posterior_not_converged", PosteriorNotConverged {
        title: "The draws from the posterior have not converged",
        grades: "Moderate for the parameters that it names.",
        when: "Draws from the posterior were asked for, and R̂ of the chains of an unknown is 1.01 or more, an \
               effective sample size of the middle or of the tails is 400 or less, or no chain could begin.",
        meaning: "The chains have not seen all of the distribution: its quantiles may be off.",
        advice: "Ask for more `uncertainty.posterior_generations`.",
    }
    NoBudget = "no_budget", NoBudget {
        title: "No uncertainty budget",
        grades: "Moderate.",
        when: "What is taken as known was not looked at: the run was stopped, or the recording is too long.",
        meaning: "The errors are those of noise alone.",
        advice: "Estimate from a window of the recording.",
    }
    ConstraintBinds = "constraint_binds", ConstraintBinds {
        title: "A constraint holds the estimate",
        grades: "A remark.",
        when: "A constraint holds with equality, and the data would go beyond it by up to three standard deviations \
               of noise.",
        meaning: "Noise alone can do that, and the intervals end there.",
        advice: "Nothing is to be done.",
    }
    ConstraintContradicted = "constraint_contradicted", ConstraintContradicted {
        title: "The data contradict a constraint",
        grades: "Low for the parameters in the constraint.",
        when: "The data would go beyond a constraint by more than three standard deviations of noise.",
        meaning: "The constraint is wrong, or the model misses an effect.",
        advice: "Check the constraint; see what the data say without it.",
    }
    PriorContradicted = "prior_contradicted", PriorContradicted {
        title: "The data contradict a prior",
        grades: "Moderate for the parameter.",
        when: "The data move a parameter by more than three standard deviations of its prior.",
        meaning: "The prior is wrong, or the parameter makes up for an effect that the model leaves out.",
        advice: "Check the prior; see what the data say without it.",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rule_is_told_by_its_code_and_has_a_chapter_that_says_what_to_do() {
        for rule in Rule::ALL {
            let entry = rule.entry();
            assert_eq!(serde_json::to_value(rule).unwrap(), rule.code());
            assert_eq!(entry.family.entry().family, entry.family, "{rule}");
            let chapter = entry.chapter();
            assert!(chapter.starts_with(&format!("## {rule}\n")), "{chapter}");
            for part in [
                entry.title,
                entry.grades,
                entry.when,
                entry.meaning,
                entry.advice,
            ] {
                assert!(!part.is_empty() && !part.contains("  "), "{rule}: {part}");
                assert!(chapter.contains(part), "{chapter}");
            }
        }
    }
}
