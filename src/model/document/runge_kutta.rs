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

/// Room for the stages of a step.
pub struct Explicit {
    slopes: [Vec<Lanes>; 4],
    point: Vec<Lanes>,
    next: Vec<Lanes>,
    whole: Vec<Lanes>,
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
        let mut floor = Lanes::splat(0.0);
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
            whole: zeros(),
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
        let at_most = steps.count.iter().copied().max().unwrap_or(0);
        let mut worst = Lanes::splat(0.0);
        let mut elapsed = Lanes::splat(0.0);
        self.begin(machine, state, elapsed);
        for taken in 0..at_most {
            let whole = Stretch {
                from: elapsed,
                length: steps.length,
            };
            self.step(machine, state, whole);
            // A lane that has taken its steps is only carried along: what it shows no longer counts.
            let rate = self.step_times_rate(steps.length);
            for lane in (0..LANES).filter(|&lane| taken < steps.count[lane]) {
                worst.0[lane] = worst.0[lane].max(rate.0[lane]);
            }
            let end = elapsed + steps.length;
            machine.rates(&self.next, end, &mut self.slopes[0]);
            machine.switches(&mut self.switches_after);
            if let Some(kink) = Kink::between(&self.switches, &self.switches_after) {
                self.step_in_two(machine, state, whole, &kink);
            }
            replace_lanes(state, &self.next, |lane| taken < steps.count[lane]);
            elapsed = end;
            std::mem::swap(&mut self.switches, &mut self.switches_after);
        }
        worst
    }

    /// The first slope and the switches at a state.
    fn begin(&mut self, machine: &mut Machine<'_, Lanes>, state: &[Lanes], elapsed: Lanes) {
        machine.rates(state, elapsed, &mut self.slopes[0]);
        machine.switches(&mut self.switches);
    }

    /// One step from a state whose first slope is known; the end is `next`.
    fn step(
        &mut self,
        machine: &mut Machine<'_, Lanes>,
        state: &[Lanes],
        Stretch { from, length }: Stretch,
    ) {
        let half = length * Lanes::splat(0.5);
        let sixth = length * Lanes::splat(1.0 / 6.0);
        let third = length * Lanes::splat(1.0 / 3.0);
        along(&mut self.next, state, sixth, &self.slopes[0]);
        for (stage, (reach, weight)) in [(half, third), (half, third), (length, sixth)]
            .into_iter()
            .enumerate()
        {
            along(&mut self.point, state, reach, &self.slopes[stage]);
            let [.., slope] = &mut self.slopes[..stage + 2] else {
                return;
            };
            machine.rates(&self.point, from + reach, slope);
            for (value, slope) in self.next.iter_mut().zip(slope.iter()) {
                *value += weight * *slope;
            }
        }
    }

    /// The step anew in two parts that meet near the kink, for the lanes that have one.
    fn step_in_two(
        &mut self,
        machine: &mut Machine<'_, Lanes>,
        state: &[Lanes],
        whole: Stretch,
        kink: &Kink,
    ) {
        std::mem::swap(&mut self.whole, &mut self.next);
        let first = Stretch {
            length: whole.length * kink.share,
            ..whole
        };
        let second = Stretch {
            from: whole.from + first.length,
            length: whole.length - first.length,
        };
        machine.rates(state, first.from, &mut self.slopes[0]);
        self.step(machine, state, first);
        let middle = self.next.clone();
        machine.rates(&middle, second.from, &mut self.slopes[0]);
        self.step(machine, &middle, second);
        replace_lanes(&mut self.next, &self.whole, |lane| !kink.is_in[lane]);
        let next = std::mem::take(&mut self.next);
        machine.rates(&next, whole.from + whole.length, &mut self.slopes[0]);
        self.next = next;
        machine.switches(&mut self.switches_after);
    }

    /// The step times the rate that the stages of the last step show.
    fn step_times_rate(&self, length: Lanes) -> Lanes {
        let zero = Lanes::splat(0.0);
        let (mut size, mut before, mut after) = (zero, zero, zero);
        for (state, weight) in self.weights.iter().enumerate() {
            let [k1, k2, k3, _] = &self.slopes;
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
fn along(to: &mut [Lanes], from: &[Lanes], reach: Lanes, slope: &[Lanes]) {
    for ((to, from), slope) in to.iter_mut().zip(from).zip(slope) {
        *to = *from + reach * *slope;
    }
}

/// Where in a step the first switch changes its sign.
struct Kink {
    is_in: [bool; LANES],
    /// The part of the step before the kink, by linear interpolation; 1 in lanes without one.
    share: Lanes,
}

impl Kink {
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
