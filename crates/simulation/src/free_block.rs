//! Candidates of a plant on which nothing acts from outside: each goes from sample to sample by itself, and
//! where one has come to the end of the recording another takes its lane.
//!
//! A step takes a row of lanes as long for one candidate as for all, and candidates of one generation may
//! take a hundred times the steps of each other. A row that waits at each sample for its slowest candidate
//! takes 2.6 times the steps for those of a published problem (`benches/studies/tried.md`).

use super::equations::{Equations, HeldQuantities, Sample, System};
use super::impossible::ImpossibleRow;
use super::steps::{Arrivals, FirstStretch, Integrator, RowCandidates};
use super::{BlockSimulator, DrivingInputs, SimulatedCandidate, SimulationFailure};
use greybox_numerics::lanes::{LANES, Lanes, Real};
use greybox_numerics::width::{Wide, Width};
use std::sync::atomic::AtomicBool;

/// A block of any number of candidates.
pub struct FreeBlock<'a, P> {
    plant: &'a P,
    excitation: DrivingInputs<'a>,
    members: Vec<QueuedCandidate>,
    failures: Vec<Option<SimulationFailure>>,
    width: Width,
}

/// A candidate, and what became of it.
struct QueuedCandidate {
    parameters: Vec<f64>,
    initial_state: Vec<Option<f64>>,
    derivatives: u64,
    /// The states at the last sample.
    states: Vec<f64>,
}

impl<'a, P: System + 'a> FreeBlock<'a, P> {
    /// A block of one or more candidates, none of which takes the steps of another.
    pub fn new(
        plant: &'a P,
        excitation: DrivingInputs<'a>,
        candidates: &[SimulatedCandidate<'_>],
        width: Width,
    ) -> Self {
        let member = |candidate: &SimulatedCandidate<'_>| QueuedCandidate {
            parameters: candidate.parameters.to_vec(),
            initial_state: candidate.initial_state.to_vec(),
            derivatives: 0,
            states: vec![f64::NAN; candidate.initial_state.len()],
        };
        FreeBlock {
            plant,
            excitation,
            members: candidates.iter().map(member).collect(),
            failures: vec![None; candidates.len()],
            width,
        }
    }
}

/// The candidates that are at work, and those that wait.
struct Queue<'q, 'a> {
    excitation: DrivingInputs<'a>,
    held: &'q HeldQuantities<Lanes>,
    members: &'q mut [QueuedCandidate],
    failures: &'q mut [Option<SimulationFailure>],
    /// The member that goes next.
    next: usize,
    /// The member in each lane, where there is one at work.
    at_work: [Option<usize>; LANES],
    /// The sample that each lane has come to.
    samples: [usize; LANES],
    /// `[(group of members · samples + sample) · n_outputs + output]`, NaN where nothing is written.
    outputs: &'q mut [Lanes],
    /// The outputs of the row.
    row: Vec<Lanes>,
}

impl<'a> Queue<'_, 'a> {
    /// Writes the outputs of lanes that have come to a sample, and puts the next member into the place of those
    /// that are at the end. Answers the time to the next sample of each.
    fn settle<P: System + 'a>(
        &mut self,
        integrator: &mut Integrator<'a, P, Lanes>,
        equations: &mut P::Row<'a, Lanes>,
        mut is_at_sample: [bool; LANES],
    ) -> Lanes {
        let mut durations = Lanes::splat(0.0);
        while is_at_sample.contains(&true) {
            let impossible = ImpossibleRow::at(equations, &integrator.states, &mut self.row);
            let lanes = std::mem::take(&mut is_at_sample).into_iter().enumerate();
            for (lane, _) in lanes.filter(|(_, is_due)| *is_due) {
                let failure = impossible.and_then(|row| row.failure(lane));
                let interval = self.interval_after(lane, failure, integrator);
                durations.set_lane(lane, interval);
                is_at_sample[lane] =
                    interval == 0.0 && self.place_next::<P>(lane, integrator, equations);
            }
        }
        durations
    }

    /// Writes the outputs of a lane. Answers the time to its next sample, 0 where the recording ends or the member
    /// cannot be where it is.
    fn interval_after<P: System + 'a>(
        &mut self,
        lane: usize,
        failure: Option<SimulationFailure>,
        integrator: &mut Integrator<'a, P, Lanes>,
    ) -> f64 {
        if let Some(failure) = failure {
            integrator.fail(lane, failure);
        }
        if integrator.failures()[lane].is_some() {
            return 0.0;
        }
        self.write(lane);
        self.excitation.interval(self.samples[lane])
    }

    /// Writes the outputs of the member in a lane.
    fn write(&mut self, lane: usize) {
        let Some(member) = self.at_work[lane] else {
            return;
        };
        let place = member / LANES * self.excitation.samples + self.samples[lane];
        let outputs = &mut self.outputs[place * self.row.len()..][..self.row.len()];
        for (output, value) in outputs.iter_mut().zip(&self.row) {
            output.set_lane(member % LANES, value.lane(lane));
        }
    }

    /// Notes what became of the member in a lane and puts the next one there, if there is one.
    fn place_next<P: System + 'a>(
        &mut self,
        lane: usize,
        integrator: &mut Integrator<'a, P, Lanes>,
        equations: &mut P::Row<'a, Lanes>,
    ) -> bool {
        if let Some(member) = self.at_work[lane].take() {
            self.failures[member] = integrator.failures()[lane];
            let member = &mut self.members[member];
            member.derivatives = integrator.derivatives_of(lane);
            let states = integrator.states.as_ref().iter();
            member.states = states.map(|state| state.lane(lane)).collect();
        }
        let Some(member) = self.members.get(self.next) else {
            return false;
        };
        let candidate = SimulatedCandidate {
            parameters: &member.parameters,
            initial_state: &member.initial_state,
        };
        integrator.replace(lane, candidate, equations, self.held);
        self.at_work[lane] = Some(self.next);
        self.samples[lane] = 0;
        self.next += 1;
        true
    }
}

impl<'a, P: System + 'a> Arrivals<'a, P, Lanes> for Queue<'_, 'a> {
    fn next(
        &mut self,
        integrator: &mut Integrator<'a, P, Lanes>,
        equations: &mut P::Row<'a, Lanes>,
        has_arrived: &[bool],
    ) -> Lanes {
        let mut is_at_sample = [false; LANES];
        for lane in (0..LANES).filter(|lane| has_arrived[*lane]) {
            is_at_sample[lane] = if integrator.failures()[lane].is_some() {
                self.place_next::<P>(lane, integrator, equations)
            } else {
                self.samples[lane] += 1;
                true
            };
        }
        self.settle::<P>(integrator, equations, is_at_sample)
    }
}

/// A whole recording.
struct WholeRecording<'b, 'a, P> {
    block: &'b mut FreeBlock<'a, P>,
    outputs: &'b mut [Lanes],
    stop: &'b AtomicBool,
}

impl<'a, P: System + 'a> Wide for WholeRecording<'_, 'a, P> {
    type Output = Option<()>;

    #[inline(always)]
    fn work(self) -> Option<()> {
        let FreeBlock {
            plant,
            excitation,
            members,
            failures,
            width,
        } = self.block;
        let n_groups = members.len().div_ceil(LANES);
        let of_sample = self.outputs.len() / (n_groups * excitation.samples);
        let at_work: [Option<usize>; LANES] =
            std::array::from_fn(|lane| (lane < members.len()).then_some(lane));
        // Lanes that are left over repeat the first member and do nothing.
        let members_of_lanes = at_work.map(|member| &members[member.unwrap_or(0)]);
        let parameters: Vec<Lanes> = (0..members[0].parameters.len())
            .map(|index| Lanes(members_of_lanes.map(|member| member.parameters[index])))
            .collect();
        let mut equations = plant.row(&parameters, excitation.sample_time);
        let mut states = equations.initial_states();
        for (index, state) in states.as_mut().iter_mut().enumerate() {
            let given = members_of_lanes.map(|member| member.initial_state[index]);
            *state = Lanes(std::array::from_fn(|lane| {
                given[lane].unwrap_or(state.lane(lane))
            }));
        }
        let source = RowCandidates {
            plant: *plant,
            parameters,
            sample_time: excitation.sample_time,
            accuracy: excitation.accuracy,
            width: *width,
            follow: false,
        };
        let mut integrator = Integrator::new(source, &equations, states, excitation.samples);
        let mut held = HeldQuantities {
            values: Vec::new(),
            slopes: Vec::new(),
        };
        let sample = Sample {
            input_set: excitation.input_set,
            inputs: excitation.inputs,
            index: 0,
            interval: excitation.interval(0),
        };
        equations.hold(&sample, &integrator.states, &mut held);
        equations.act(&held);
        let mut queue = Queue {
            excitation: *excitation,
            held: &held,
            next: members.len().min(LANES),
            members,
            failures,
            at_work,
            samples: [0; LANES],
            outputs: self.outputs,
            row: vec![Lanes::splat(0.0); of_sample],
        };
        let is_at_work = at_work.map(|member| member.is_some());
        let duration = queue.settle::<P>(&mut integrator, &mut equations, is_at_work);
        let stretch = FirstStretch {
            held: &held,
            duration,
        };
        integrator.integrate(&mut equations, stretch, Some(&mut queue), self.stop)
    }
}

impl<'a, P: System + 'a> BlockSimulator for FreeBlock<'a, P> {
    fn advance(&mut self, samples: usize, outputs: &mut [Lanes], stop: &AtomicBool) -> Option<()> {
        assert_eq!(
            samples, self.excitation.samples,
            "it takes recordings whole"
        );
        outputs.fill(Lanes::splat(f64::NAN));
        self.width.does(WholeRecording {
            block: self,
            outputs,
            stop,
        })
    }

    fn failures(&self) -> &[Option<SimulationFailure>] {
        &self.failures
    }

    fn derivative_evaluations(&self) -> u64 {
        self.members.iter().map(|member| member.derivatives).sum()
    }

    fn states(&self) -> Vec<Lanes> {
        let of_group = |group: &[QueuedCandidate]| {
            let lane = |place: usize, state: usize| match group.get(place) {
                Some(member) => member.states[state],
                None => f64::NAN,
            };
            let n_states = group[0].states.len();
            let row = |state| Lanes(std::array::from_fn(|place| lane(place, state)));
            (0..n_states).map(row).collect::<Vec<Lanes>>()
        };
        self.members.chunks(LANES).flat_map(of_group).collect()
    }
}

#[cfg(test)]
mod tests;
