//! The fixed-step Runge–Kutta method of `simulation::explicit` for a document's plant.
//!
//! The first stage of a step is also where the switches are read, so a step costs four
//! derivatives. How fast the plant moves is read off two stages at the same instant:
//! ‖k3 − k2‖ / (h/2·‖k2 − k1‖) (E. Hairer, G. Wanner, *Solving Ordinary Differential Equations
//! II*, 1996, section IV.2), in a norm that the balanced Jacobian at the start gives.

use super::jacobian;
use super::plant::DocumentPlant;
use super::simulator::Machine;
use crate::simulation::explicit::Steps;
use crate::simulation::lanes::{LANES, Lanes, Real};
use crate::simulation::width::{self, Wide};

/// Differences of slopes below this share of the slope, or below that share of the state's scale,
/// are rounding and say nothing.
const ROUNDING_SHARE: f64 = 1e-6;
const ROUNDING_OF_SCALE: f64 = 1e-12;

/// A stretch of time within a segment.
#[derive(Clone, Copy)]
struct Stretch {
    from: Lanes,
    length: Lanes,
}

/// Derivatives of a step beyond that at its start: three stages, and that at its end, where the
/// next step starts.
const LAST: usize = 4;

/// Room for the stages of a step.
pub struct Explicit {
    slopes: [Vec<Lanes>; LAST + 1],
    point: Vec<Lanes>,
    next: Vec<Lanes>,
    switches: Vec<Lanes>,
    switches_after: Vec<Lanes>,
    /// What a change of each state is divided by.
    weights: Vec<Lanes>,
    /// The state's scale in that norm.
    floor: Lanes,
}

impl Explicit {
    /// Room for a plant whose candidates have `parameters(lane, index)`.
    pub fn new(plant: &DocumentPlant, parameters: impl Fn(usize, usize) -> f64) -> Self {
        let n = plant.scales.len();
        let zeros = || vec![Lanes::splat(0.0); n];
        let n_switches = plant.tape.roots.switches.len();
        let mut weights = zeros();
        let mut floor = Lanes([0.0; LANES]);
        for lane in 0..LANES {
            let mut matrix = plant.initial_jacobian(|index| parameters(lane, index));
            let balanced = jacobian::balance(&mut matrix, n);
            for (state, size) in balanced.iter().enumerate() {
                let weight = 1.0 / size;
                let weight = Some(weight).filter(|w| w.is_finite() && *w > 0.0);
                let weight = weight.unwrap_or(1.0);
                weights[state].0[lane] = weight;
                floor.0[lane] = floor.0[lane].max(plant.scales[state] * weight);
            }
        }
        Explicit {
            slopes: std::array::from_fn(|_| zeros()),
            point: zeros(),
            next: zeros(),
            switches: vec![Lanes::splat(0.0); n_switches],
            switches_after: vec![Lanes::splat(0.0); n_switches],
            weights,
            floor,
        }
    }

    /// Takes every lane's steps; answers the fastest step times rate of each.
    pub fn integrate(
        &mut self,
        machine: &mut Machine<'_, Lanes>,
        state: &mut [Lanes],
        steps: &Steps,
    ) -> Lanes {
        machine.rates(state, Lanes::splat(0.0), &mut self.slopes[0]);
        machine.switches(&mut self.switches);
        width::at_full_width(Integration {
            explicit: self,
            machine,
            state,
            steps,
        })
    }

    /// One step from a state whose first slope is known; the end is `next`, its slope the last.
    #[inline(always)]
    fn step(
        &mut self,
        machine: &mut Machine<'_, Lanes>,
        state: &[Lanes],
        Stretch { from, length }: Stretch,
    ) {
        let half = length * Lanes::splat(0.5);
        let sixth = length * Lanes::splat(1.0 / 6.0);
        let third = length * Lanes::splat(1.0 / 3.0);
        let reaches = [half, half, length, length];
        let weights = [sixth, third, third, sixth];
        self.next.copy_from_slice(state);
        for (stage, (reach, weight)) in reaches.into_iter().zip(weights).enumerate() {
            let [before, slope] = &mut self.slopes[stage..stage + 2] else {
                return;
            };
            along(&mut self.next, weight, before);
            if stage + 1 < LAST {
                self.point.copy_from_slice(state);
                along(&mut self.point, reach, before);
            } else {
                self.point.copy_from_slice(&self.next);
            }
            machine.rates_wide(&self.point, from + reach, slope);
        }
    }

    /// The step anew in two parts that meet near the kink, for the lanes that have one.
    #[inline(never)]
    fn step_in_two(
        &mut self,
        machine: &mut Machine<'_, Lanes>,
        state: &[Lanes],
        whole: Stretch,
        kink: &Kink,
    ) {
        let straight = self.next.clone();
        let first = Stretch {
            length: whole.length * kink.share,
            ..whole
        };
        let second = Stretch {
            from: whole.from + first.length,
            length: whole.length - first.length,
        };
        width::at_full_width(TwoSteps {
            explicit: self,
            machine,
            state: state.to_vec(),
            parts: [first, second],
        });
        replace_lanes(&mut self.next, &straight, |lane| !kink.is_in[lane]);
        machine.rates(
            &self.next,
            whole.from + whole.length,
            &mut self.slopes[LAST],
        );
        machine.switches(&mut self.switches_after);
    }

    /// The step times the rate that the stages of the last step show.
    #[inline(always)]
    fn step_times_rate(&self, length: Lanes) -> Lanes {
        let zero = Lanes::splat(0.0);
        let (mut size, mut before, mut after) = (zero, zero, zero);
        for (state, weight) in self.weights.iter().enumerate() {
            let [k1, k2, k3, ..] = &self.slopes;
            size = size.max((k1[state] * *weight).abs());
            before = before.max(((k2[state] - k1[state]) * *weight).abs());
            after = after.max(((k3[state] - k2[state]) * *weight).abs());
        }
        let noise = (size * Lanes::splat(ROUNDING_SHARE))
            .max(self.floor * Lanes::splat(ROUNDING_OF_SCALE) / length);
        let two = Lanes::splat(2.0);
        before.select_ge(noise, two * after / before, zero)
    }
}

/// Takes over the chosen lanes.
#[inline(always)]
fn replace_lanes(to: &mut [Lanes], from: &[Lanes], chosen: impl Fn(usize) -> bool) {
    for (to, from) in to.iter_mut().zip(from) {
        for lane in (0..LANES).filter(|&lane| chosen(lane)) {
            to.0[lane] = from.0[lane];
        }
    }
}

#[inline(always)]
fn along(to: &mut [Lanes], reach: Lanes, slope: &[Lanes]) {
    for (to, slope) in to.iter_mut().zip(slope) {
        *to += reach * *slope;
    }
}

/// Every lane's steps, from a state whose slope and switches are known.
struct Integration<'e, 'm, 'p> {
    explicit: &'e mut Explicit,
    machine: &'m mut Machine<'p, Lanes>,
    state: &'e mut [Lanes],
    steps: &'e Steps,
}

impl Wide for Integration<'_, '_, '_> {
    type Output = Lanes;

    #[inline(always)]
    fn work(self) -> Lanes {
        let Integration {
            explicit,
            machine,
            state,
            steps,
        } = self;
        let at_most = steps.count.iter().copied().max().unwrap_or(0);
        let mut worst = Lanes([0.0; LANES]);
        let mut elapsed = Lanes::splat(0.0);
        for taken in 0..at_most {
            let whole = Stretch {
                from: elapsed,
                length: steps.length,
            };
            explicit.step(machine, state, whole);
            machine.switches_wide(&mut explicit.switches_after);
            // A lane that has taken its steps is only carried along: what it shows no longer counts.
            let rate = explicit.step_times_rate(steps.length);
            for lane in (0..LANES).filter(|&lane| taken < steps.count[lane]) {
                worst.0[lane] = worst.0[lane].max(rate.0[lane]);
            }
            if let Some(kink) = Kink::between(&explicit.switches, &explicit.switches_after) {
                explicit.step_in_two(machine, state, whole, &kink);
            }
            replace_lanes(state, &explicit.next, |lane| taken < steps.count[lane]);
            elapsed += steps.length;
            std::mem::swap(&mut explicit.switches, &mut explicit.switches_after);
            explicit.slopes.swap(0, LAST);
        }
        worst
    }
}

/// One step after the other.
struct TwoSteps<'e, 'm, 'p> {
    explicit: &'e mut Explicit,
    machine: &'m mut Machine<'p, Lanes>,
    state: Vec<Lanes>,
    parts: [Stretch; 2],
}

impl Wide for TwoSteps<'_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn work(mut self) {
        for part in self.parts {
            self.explicit.step(self.machine, &self.state, part);
            self.state.copy_from_slice(&self.explicit.next);
            self.explicit.slopes.swap(0, LAST);
        }
    }
}

/// Where in a step the first switch changes its sign.
struct Kink {
    is_in: [bool; LANES],
    /// The part of the step before the kink, by linear interpolation; 1 in lanes without one.
    share: Lanes,
}

impl Kink {
    #[inline(always)]
    fn between(before: &[Lanes], after: &[Lanes]) -> Option<Kink> {
        let mut lowest = Lanes::splat(0.0);
        for (before, after) in before.iter().zip(after) {
            lowest = Real::min(*before * *after, lowest);
        }
        if !lowest.any(|product| product < 0.0) {
            return None;
        }
        let mut kink = Kink {
            is_in: [false; LANES],
            share: Lanes::splat(1.0),
        };
        for (before, after) in before.iter().zip(after) {
            for lane in (0..LANES).filter(|&lane| before.0[lane] * after.0[lane] < 0.0) {
                let share = before.0[lane] / (before.0[lane] - after.0[lane]);
                kink.is_in[lane] = true;
                kink.share.0[lane] = kink.share.0[lane].min(share);
            }
        }
        Some(kink)
    }
}
