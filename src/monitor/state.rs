//! What a monitor knows from one step to the next, and what a result adds to it.

use std::collections::BTreeMap;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::detector::{Change, Detector, DetectorPoint, Thresholds};
use super::doubts::Doubts;
use super::record::{
    Alarm, AlarmKind, MonitorWindow, ParameterChange, Start, WatchedEstimate, WindowStatus,
};
use super::spec::{MonitorSpec, WindowPlan};
use super::warm::{self, ErrorScope, JointEstimate, WindowEstimate};
use greybox::identification::outcome::{Outcome, Trust};
use greybox::identification::spec::SearchRange;
use greybox::model::Scale;
use greybox::recording::{RowSignal, Rows, shown};

/// Nanoseconds in a second.
const NS: f64 = 1e9;

/// What a monitor knows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// When the first window begins, nanoseconds since 1970.
    pub origin_ns: i64,
    /// The number of the next window, or of the one that is worked.
    pub next: i64,
    /// The least and the largest value of signals that should move, over all windows.
    pub ranges: BTreeMap<String, [f64; 2]>,
    /// When the last window that was estimated began, and what is known since.
    #[serde(default)]
    pub known: Option<(i64, JointEstimate)>,
    /// Residual of each output in the last window that was estimated, SI (root mean square).
    #[serde(default)]
    pub left: BTreeMap<String, f64>,
    /// How far estimates can be trusted.
    pub trust: Option<Trust>,
    /// How often the estimates of windows could be trusted less than usual.
    #[serde(default)]
    pub doubts: Doubts,
    /// Whether the last window that was worked came to no estimate.
    pub failing: bool,
    /// The window that is worked.
    pub worked: Option<Worked>,
    /// The detectors of the parameters.
    pub detectors: BTreeMap<String, Detector>,
}

/// A window that a job works.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Worked {
    /// Where the search of the window began.
    pub start: Start,
    /// With which prior.
    #[serde(default)]
    pub prior: Option<JointEstimate>,
    /// The ranges of the parameters, as the monitor's job has them.
    pub ranges: BTreeMap<String, SearchRange>,
}

/// A parameter whose value a detector saw change.
struct ChangedParameter<'w> {
    /// The estimate of the parameter in the window.
    parameter: &'w WatchedEstimate,
    /// The scale along which the parameter is looked for.
    scale: Scale,
    /// The change that the detector saw.
    change: Change,
}

impl State {
    /// What a monitor knows before its first window.
    #[must_use]
    pub fn new(origin_ns: i64) -> Self {
        Self {
            origin_ns,
            next: 0,
            ranges: BTreeMap::new(),
            known: None,
            left: BTreeMap::new(),
            trust: None,
            doubts: Doubts::default(),
            failing: false,
            worked: None,
            detectors: BTreeMap::new(),
        }
    }

    /// The first instant of the next window and the first after it, nanoseconds since 1970.
    #[must_use]
    pub fn span(&self, plan: &WindowPlan) -> (i64, i64) {
        let from = self.begin_of(plan, self.next);
        (from, from.saturating_add(nanoseconds(plan.length_s)))
    }

    fn begin_of(&self, plan: &WindowPlan, number: i64) -> i64 {
        let every = nanoseconds(plan.every_s);
        self.origin_ns.saturating_add(every.saturating_mul(number))
    }

    /// When a stream must have a sample for the next window to be worked.
    #[must_use]
    pub fn due(&self, plan: &WindowPlan) -> i64 {
        let (_, to) = self.span(plan);
        to.saturating_add(nanoseconds(plan.delay_s))
    }

    /// The next window, as long as nothing is known of it.
    #[must_use]
    pub fn window(&self, plan: &WindowPlan, status: WindowStatus) -> MonitorWindow {
        let (from, to) = self.span(plan);
        MonitorWindow {
            number: self.next,
            from: instant(from),
            to: instant(to),
            status,
            reason: None,
            start: None,
            trust: None,
            doubts: Vec::new(),
            parameters: Vec::new(),
        }
    }

    /// Goes on to the window after this, or to the first that has a sample from `resumes` on.
    pub fn go_on(&mut self, plan: &WindowPlan, resumes: Option<i64>) {
        self.worked = None;
        self.next += 1;
        if let Some(resumes) = resumes {
            let late = resumes.saturating_sub(nanoseconds(plan.length_s));
            let late = late.saturating_sub(self.origin_ns);
            self.next = self
                .next
                .max(late.div_euclid(nanoseconds(plan.every_s)) + 1);
        }
    }

    /// Goes on with the first window that begins at an instant or later.
    pub fn move_to(&mut self, plan: &WindowPlan, from: Timestamp) {
        let from = i64::try_from(from.as_nanosecond()).unwrap_or(i64::MAX);
        let every = nanoseconds(plan.every_s).max(1);
        let before = self.origin_ns.saturating_sub(from).max(i64::MIN + 1);
        self.next = (-before.div_euclid(every)).max(0);
    }

    /// Looks at how far signals move in a window; says whether one moves by more than a share of its
    /// range over all windows.
    pub fn moves(
        &mut self,
        signals: &[RowSignal],
        rows: &Rows,
        names: &[String],
        share: f64,
    ) -> bool {
        let mut moves = false;
        for name in names {
            let Some(column) = signals.iter().position(|signal| signal.name == *name) else {
                continue;
            };
            let values = rows.columns[column].values.iter();
            let values = values.copied().filter(|value| !value.is_nan());
            let [low, high] = values
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
                    [low.min(value), high.max(value)]
                });
            if low > high {
                continue;
            }
            let ever = self.ranges.entry(name.clone()).or_insert([low, high]);
            *ever = [ever[0].min(low), ever[1].max(high)];
            moves |= high - low > share * (ever[1] - ever[0]);
        }
        moves
    }

    /// Ends the window that is worked as one that says nothing; says what is shown of it.
    pub fn quiet(&mut self, plan: &WindowPlan, reason: String) -> MonitorWindow {
        let mut window = self.window(plan, WindowStatus::Quiet);
        window.start = self.worked.take().map(|worked| worked.start);
        window.reason = Some(reason);
        window
    }

    /// Takes the result of the window that is worked; says what is shown of it and what somebody
    /// should look at.
    pub fn take(
        &mut self,
        spec: &MonitorSpec,
        outcome: &Outcome,
        now: Timestamp,
    ) -> (MonitorWindow, Vec<Alarm>) {
        let mut window = self.window(&spec.window, WindowStatus::Estimated);
        let mut alarms = Vec::new();
        window.parameters = WatchedEstimate::all(outcome);
        window.trust = Some(outcome.verdict.trust);
        let reasons = outcome.verdict.reasons.iter();
        window.doubts = reasons.map(|reason| reason.code.to_string()).collect();
        if let Some(worked) = self.worked.take() {
            window.start = Some(worked.start);
            let correlation = outcome.correlation.as_ref();
            let estimated =
                |errors| warm::estimated(&window.parameters, correlation, &worked.ranges, errors);
            let alone =
                WindowEstimate::new(estimated(ErrorScope::Statistical), worked.prior.as_ref());
            for changed in self.changes(spec, &window, &worked, &alone) {
                alarms.push(self.alarm_of_change(spec, &changed, now));
            }
            self.known = Some((self.span(&spec.window).0, estimated(ErrorScope::Total)));
            let fits = outcome.fit.estimation.iter();
            self.left = fits
                .filter_map(|(output, fit)| Some((output.clone(), fit.rmse?)))
                .collect();
        }
        alarms.extend(self.trusted(spec, &window, outcome.verdict.trust, now));
        self.failing = false;
        (window, alarms)
    }

    /// Looks at how far an estimate can be trusted; says whether that has fallen.
    fn trusted(
        &mut self,
        spec: &MonitorSpec,
        window: &MonitorWindow,
        trust: Trust,
        now: Timestamp,
    ) -> Option<Alarm> {
        let usual = self.trust.unwrap_or(trust);
        let has_fallen = self.doubts.take(trust, usual, spec.alarms.false_alarm_rate);
        self.trust = Some(if has_fallen { trust } else { usual.max(trust) });
        has_fallen.then(|| Alarm {
            id: 0,
            kind: AlarmKind::TrustFell,
            raised_at: now,
            window: Some(window.number),
            change: None,
            detail: format!(
                "estimates can be trusted less than before: {}, it was {}",
                trust.name(),
                usual.name()
            ),
        })
    }

    /// What has changed, by what the window itself says of each parameter.
    fn changes<'w>(
        &mut self,
        spec: &MonitorSpec,
        window: &'w MonitorWindow,
        worked: &Worked,
        alone: &WindowEstimate<'_>,
    ) -> Vec<ChangedParameter<'w>> {
        let watched = worked.ranges.len().max(1);
        let rate = spec.alarms.false_alarm_rate / watched as f64;
        let thresholds = Thresholds::of_rate(rate);
        let mut changes = Vec::new();
        for parameter in &window.parameters {
            // What cannot be trusted says nothing of a change.
            if parameter.trust.or(window.trust) == Some(Trust::Low) {
                continue;
            }
            let Some((value, variance)) = alone.of(&parameter.name) else {
                continue;
            };
            let point = DetectorPoint {
                window: window.number,
                value,
                variance,
            };
            let detector = self.detectors.entry(parameter.name.clone()).or_default();
            let change = detector.take(point, &thresholds);
            changes.extend(change.map(|change| ChangedParameter {
                parameter,
                scale: worked.ranges[&parameter.name].scale,
                change,
            }));
        }
        changes
    }

    fn alarm_of_change(
        &self,
        spec: &MonitorSpec,
        changed: &ChangedParameter<'_>,
        now: Timestamp,
    ) -> Alarm {
        let (parameter, scale, change) = (changed.parameter, changed.scale, &changed.change);
        let side = |mean: &super::detector::Mean| {
            let value = warm::value_at(scale, mean.value);
            (
                value,
                warm::deviation_of_value(scale, value, mean.deviation()),
            )
        };
        let (before, before_standard_error) = side(&change.before);
        let (after, after_standard_error) = side(&change.after);
        let since = instant(self.begin_of(&spec.window, change.since));
        let percent = 100.0 * (after / before - 1.0);
        Alarm {
            id: 0,
            kind: AlarmKind::Change,
            raised_at: now,
            window: Some(self.next),
            detail: format!(
                "{} has changed since {since}: {} ± {} {unit} after {} ± {} {unit} ({percent:+.1} %)",
                parameter.name,
                shown(after),
                shown(after_standard_error),
                shown(before),
                shown(before_standard_error),
                unit = parameter.unit
            ),
            change: Some(ParameterChange {
                parameter: parameter.name.clone(),
                unit: parameter.unit.clone(),
                detector: change.detector,
                statistic: change.statistic,
                threshold: change.threshold,
                since_window: change.since,
                since,
                before,
                before_standard_error,
                after,
                after_standard_error,
            }),
        }
    }

    /// Notes that the window that is worked came to no estimate; says what is shown of it, and what
    /// somebody should look at where the one before had come to one.
    pub fn fail(
        &mut self,
        spec: &MonitorSpec,
        reason: String,
        now: Timestamp,
    ) -> (MonitorWindow, Vec<Alarm>) {
        let mut window = self.window(&spec.window, WindowStatus::Failed);
        let alarm = Alarm {
            id: 0,
            kind: AlarmKind::NoEstimate,
            raised_at: now,
            window: Some(window.number),
            change: None,
            detail: format!("windows no longer come to an estimate: {reason}"),
        };
        window.start = self.worked.as_ref().map(|worked| worked.start);
        window.reason = Some(reason);
        let alarms = if self.failing {
            Vec::new()
        } else {
            vec![alarm]
        };
        self.failing = true;
        (window, alarms)
    }
}

/// Says that data stopped.
#[must_use]
pub fn silence(received_at: Timestamp, now: Timestamp) -> Alarm {
    Alarm {
        id: 0,
        kind: AlarmKind::DataStopped,
        raised_at: now,
        window: None,
        change: None,
        detail: format!("no data have come since {received_at}"),
    }
}

/// A time as nanoseconds, one at the least.
fn nanoseconds(seconds: f64) -> i64 {
    ((seconds * NS).round() as i64).max(0)
}

/// The instant of so many nanoseconds since 1970; the last that there is where it is beyond.
#[must_use]
pub fn instant(ns: i64) -> Timestamp {
    Timestamp::from_nanosecond(ns.into()).unwrap_or(Timestamp::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use greybox::recording::{Class, RowColumn};

    const PLAN: WindowPlan = WindowPlan {
        length_s: 10.0,
        every_s: 20.0,
        delay_s: 1.0,
        from: None,
    };

    fn seconds(seconds: i64) -> i64 {
        seconds * 1_000_000_000
    }

    #[test]
    fn windows_follow_each_other_and_a_gap_leaves_numbers_out() {
        let mut state = State::new(seconds(100));
        assert_eq!(state.span(&PLAN), (seconds(100), seconds(110)));
        assert_eq!(state.due(&PLAN), seconds(111));
        state.go_on(&PLAN, None);
        assert_eq!(state.span(&PLAN), (seconds(120), seconds(130)));
        // The window from 180 to 190 is the first that holds a sample at 185 …
        state.go_on(&PLAN, Some(seconds(185)));
        assert_eq!((state.next, state.span(&PLAN).0), (4, seconds(180)));
        // … and one at 190 belongs to no window but comes before the one from 200.
        let mut state = State::new(seconds(100));
        state.go_on(&PLAN, Some(seconds(190)));
        assert_eq!(state.span(&PLAN).0, seconds(200));
    }

    #[test]
    fn a_monitor_that_is_moved_goes_on_with_the_first_window_from_then_on() {
        let mut state = State::new(seconds(100));
        for (from, next) in [(0, 0), (100, 0), (101, 1), (120, 1), (121, 2)] {
            state.next = 5_260_320;
            state.move_to(&PLAN, instant(seconds(from)));
            assert_eq!(state.next, next, "from {from} s");
        }
    }

    #[test]
    fn a_signal_moves_by_what_it_has_ever_moved() {
        let mut state = State::new(0);
        let signals = [RowSignal {
            name: "u".to_owned(),
            unit: String::new(),
            recorded_unit: String::new(),
            interpolation: None,
        }];
        let names = ["u".to_owned()];
        let mut moves = |values: &[f64]| {
            let rows = Rows {
                instants: (0..).take(values.len()).collect(),
                columns: vec![RowColumn {
                    values: values.to_vec(),
                    classes: vec![Class::Good; values.len()],
                }],
            };
            state.moves(&signals, &rows, &names, 0.2)
        };
        assert!(!moves(&[1.0, 1.0, 1.0]), "it never moved");
        assert!(moves(&[0.0, f64::NAN, 10.0]));
        assert!(!moves(&[4.0, 5.9]), "less than a fifth of 10");
        assert!(moves(&[4.0, 6.1]));
        assert!(!moves(&[f64::NAN, f64::NAN]));
    }
}
