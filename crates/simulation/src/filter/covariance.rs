//! What a measured output tells of the states.

use super::transition::Matrix;
use greybox_numerics::lanes::{Lanes, Real};

/// The covariance of the states, and what the outputs of one sample have moved them by.
pub struct StateCovariance {
    /// The states that disturbances or an uncertain start can move, by their place.
    pub states: Vec<usize>,
    /// P: `matrix[row · n + column]` over these states.
    pub matrix: Matrix,
    /// What the outputs of the sample so far have moved each state by.
    pub moved: Vec<Lanes>,
    /// P·cᵀ of the output at hand.
    pub gain: Vec<Lanes>,
}

/// The expectation of an output before the output is read.
#[derive(Clone, Copy)]
pub struct PredictedOutput {
    /// The output.
    pub value: Lanes,
    /// The variance of its error, that of the sensor among it.
    pub variance: Lanes,
}

impl StateCovariance {
    /// States that are known.
    pub fn new(states: Vec<usize>) -> StateCovariance {
        let n = states.len();
        let zero = Lanes::splat(0.0);
        StateCovariance {
            states,
            matrix: vec![zero; n * n],
            moved: vec![zero; n],
            gain: vec![zero; n],
        }
    }

    /// Forgets what the outputs of the sample before have moved.
    #[inline(always)]
    pub fn begin_sample(&mut self) {
        self.moved.fill(Lanes::splat(0.0));
    }

    /// Makes the state at a place follow the other states with these derivatives, by their places; its own
    /// derivative is 0.
    #[inline(always)]
    pub fn replace(&mut self, place: usize, derivatives: &[Lanes]) {
        let n = self.states.len();
        for column in (0..n).filter(|column| *column != place) {
            let mut sum = Lanes::splat(0.0);
            for (row, derivative) in derivatives.iter().enumerate() {
                sum += self.matrix[row * n + column] * *derivative;
            }
            self.gain[column] = sum;
        }
        let mut variance = Lanes::splat(0.0);
        for column in (0..n).filter(|column| *column != place) {
            variance += self.gain[column] * derivatives[column];
            self.matrix[place * n + column] = self.gain[column];
            self.matrix[column * n + place] = self.gain[column];
        }
        self.matrix[place * (n + 1)] = variance;
    }

    /// The state at a place is known.
    #[inline(always)]
    pub fn fix(&mut self, place: usize) {
        let n = self.states.len();
        for index in 0..n {
            self.matrix[place * n + index] = Lanes::splat(0.0);
            self.matrix[index * n + place] = Lanes::splat(0.0);
        }
    }

    /// Makes the state at the place `to` the state at the place `from`.
    #[inline(always)]
    pub fn copy(&mut self, from: usize, to: usize) {
        let n = self.states.len();
        for index in 0..n {
            self.matrix[to * n + index] = self.matrix[from * n + index];
        }
        for index in 0..n {
            self.matrix[index * n + to] = self.matrix[index * n + from];
        }
    }

    /// The expectation of an output: its value at the states before the sample's correction, its
    /// derivatives by all states, and the variance of its sensor.
    #[inline(always)]
    pub fn predict(&mut self, value: Lanes, by_state: &[Lanes], sensor: Lanes) -> PredictedOutput {
        let n = self.states.len();
        let mut predicted = PredictedOutput {
            value,
            variance: sensor,
        };
        for row in 0..n {
            let mut sum = Lanes::splat(0.0);
            for (column, state) in self.states.iter().enumerate() {
                sum += self.matrix[row * n + column] * by_state[*state];
            }
            self.gain[row] = sum;
            let derivative = by_state[self.states[row]];
            predicted.variance += derivative * sum;
            predicted.value += derivative * self.moved[row];
        }
        predicted
    }

    /// Corrects the states by the output that was predicted last: P ← P − Kgᵀ − gKᵀ + S·KKᵀ with
    /// g = Pcᵀ, in which an error of K does no harm to first order.
    #[inline(always)]
    pub fn correct(&mut self, predicted: PredictedOutput, measured: f64) {
        let n = self.states.len();
        let error = Lanes::splat(measured) - predicted.value;
        for row in 0..n {
            self.moved[row] += self.gain[row] / predicted.variance * error;
        }
        for row in 0..n {
            for column in row..n {
                let (left, right) = (self.gain[row], self.gain[column]);
                let gains = (left / predicted.variance, right / predicted.variance);
                let less =
                    gains.0 * right + left * gains.1 - predicted.variance * gains.0 * gains.1;
                let value = self.matrix[row * n + column] - less;
                self.matrix[row * n + column] = value;
                self.matrix[column * n + row] = value;
            }
        }
    }
}
