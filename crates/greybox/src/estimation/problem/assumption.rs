//! Numbers that are taken as known, and how well they are.

use super::target::Target;

/// What an assumption stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Assumed {
    /// A number of the model.
    Model(Target),
    /// The size of an effect that the equations have no term for: a parameter behind those of the model.
    Probe(Target),
    /// The gain or the offset of an input: a parameter behind those of the model.
    Input(Target),
    /// A number of the sensor of an output, by the output's place among the compared ones.
    Sensor {
        /// The output.
        output: usize,
        /// Which number.
        number: SensorNumber,
    },
    /// The clock that the samples of all recordings are taken by.
    Clock,
}

impl Assumed {
    /// The number of the model, of the probe or of the input; none for sensors and the clock.
    #[must_use]
    pub fn simulated(self) -> Option<Target> {
        match self {
            Assumed::Model(target) | Assumed::Probe(target) | Assumed::Input(target) => {
                Some(target)
            }
            Assumed::Sensor { .. } | Assumed::Clock => None,
        }
    }
}

/// The numbers of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SensorNumber {
    /// What the sensor multiplies its signal by.
    Gain,
    /// What the sensor adds.
    Offset,
    /// How late the sensor is `[s]`.
    Lag,
}

/// A number that is taken as known, and how well it is: numbers of the model stand first.
#[derive(Clone, Debug)]
pub struct Assumption {
    /// The name of the number, which no other assumption has.
    pub name: String,
    /// The SI unit of the number.
    pub unit: String,
    /// What the assumption stands for.
    pub target: Assumed,
    /// The value that the job declares, SI.
    pub value: f64,
    /// The value that the problem is solved with, SI: the declared one, or where the data put the
    /// number within its tolerance.
    pub taken: f64,
    /// One standard deviation of what is not known of the number, above zero, SI.
    pub tolerance: f64,
    /// Whether the number is of an effect that is left out.
    pub is_absent_effect: bool,
    /// Whether nobody declared the tolerance: the number stays at its value in every fit.
    pub is_default: bool,
    /// The least and the largest possible value, where there are such.
    pub limits: [Option<f64>; 2],
}

impl Assumption {
    /// Whether the number belongs to one experiment, as where a state starts does.
    #[must_use]
    pub fn belongs_to_an_experiment(&self) -> bool {
        let target = self.target.simulated();
        target.is_some_and(|target| target.experiment().is_some())
    }

    /// A number of the sensor of an output, which is exact but for a tolerance, above zero, SI. `unit` is that of
    /// the output, and `place` its place among the compared ones.
    #[must_use]
    pub fn of_sensor(
        output: &str,
        unit: &str,
        place: usize,
        number: SensorNumber,
        tolerance: f64,
    ) -> Assumption {
        let (word, unit, value) = match number {
            SensorNumber::Gain => ("gain", "", 1.0),
            SensorNumber::Offset => ("offset", unit, 0.0),
            SensorNumber::Lag => ("lag", "s", 0.0),
        };
        Assumption {
            name: format!("{output}.{word}"),
            unit: unit.to_owned(),
            target: Assumed::Sensor {
                output: place,
                number,
            },
            value,
            taken: value,
            tolerance,
            is_absent_effect: false,
            is_default: false,
            limits: [(number == SensorNumber::Lag).then_some(0.0), None],
        }
    }

    /// How many standard deviations of the tolerance the value that is taken lies off the declared
    /// one.
    #[must_use]
    pub fn off(&self) -> f64 {
        (self.taken - self.value) / self.tolerance
    }
}
