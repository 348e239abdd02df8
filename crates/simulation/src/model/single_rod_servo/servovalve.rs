//! The servovalve: from the command to the opening of its ports.
//!
//! The spool follows the command u directly, with a lag of first order
//! (`s' = (u − s)/τ`) or of second order (`s'' = ω²(u − s) − 2ζω·s'`); an overlapped spool opens
//! only beyond its dead band (H. E. Merritt, *Hydraulic Control Systems*, 1967, ch. 7).

use greybox_numerics::lanes::Real;

/// What follows from the valve's parameters.
#[derive(Clone, Copy, Debug)]
pub struct Valve<R> {
    /// 1 where the spool is the command itself, 0 where it lags.
    direct: R,
    /// 1/τ of the first-order lag, 0 for the others [1/s].
    first_order_rate: R,
    /// 1 for the second-order lag, 0 for the others.
    second_order: R,
    /// ω² [1/s²].
    stiffness: R,
    /// 2ζω [1/s].
    damping: R,
    /// Half the width of the dead band, as a share of the full stroke [1].
    dead_band: R,
    /// Whether there is a dead band.
    pub has_dead_band: bool,
}

/// Position and velocity of the spool, or their rates of change.
#[derive(Clone, Copy, Debug)]
pub struct SpoolState<R> {
    /// Position as a share of the full stroke [1].
    pub position: R,
    /// The rate of change of the position [1/s].
    pub velocity: R,
}

impl<R: Real> Valve<R> {
    /// The second-order lag stands where `natural_frequency` > 0, else the first-order one where
    /// `time_constant` > 0, else the spool is the command.
    pub fn new([natural_frequency, damping_ratio, time_constant, dead_band]: [R; 4]) -> Self {
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let tiny = R::splat(f64::from(f32::MIN_POSITIVE));
        let second_order = natural_frequency.select_ge(tiny, one, zero);
        let lags_first = time_constant.select_ge(tiny, one - second_order, zero);
        let safe_time = time_constant.select_ge(tiny, time_constant, one);
        Valve {
            direct: one - second_order - lags_first,
            first_order_rate: lags_first / safe_time,
            second_order,
            stiffness: second_order * natural_frequency * natural_frequency,
            damping: second_order * (damping_ratio + damping_ratio) * natural_frequency,
            dead_band,
            has_dead_band: dead_band.any(|width| width > 0.0),
        }
    }

    /// The opening of the ports [1], positive towards extension: the spool beyond its dead band,
    /// at most fully open.
    #[inline(always)]
    pub fn opening<const EFFECTS: bool>(&self, command: R, spool: &SpoolState<R>) -> R {
        let spool = self.acting::<EFFECTS>(command, spool);
        if !(EFFECTS && self.has_dead_band) {
            return spool.clamp(-1.0, 1.0);
        }
        let beyond = (spool.abs() - self.dead_band).max(R::splat(0.0));
        Real::min(beyond, R::splat(1.0)).copysign(spool)
    }

    #[inline(always)]
    fn acting<const EFFECTS: bool>(&self, command: R, spool: &SpoolState<R>) -> R {
        if !EFFECTS {
            return spool.position;
        }
        self.direct * command + (R::splat(1.0) - self.direct) * spool.position
    }

    /// The spool's rates of change.
    #[inline(always)]
    pub fn rates<const EFFECTS: bool>(&self, command: R, spool: &SpoolState<R>) -> SpoolState<R> {
        let error = command - spool.position;
        let velocity = self.stiffness * error - self.damping * spool.velocity;
        let position = if EFFECTS {
            self.second_order * spool.velocity + self.first_order_rate * error
        } else {
            spool.velocity
        };
        SpoolState { position, velocity }
    }

    /// Whether the lag is of second order in every lane.
    pub fn is_of_second_order(&self) -> bool {
        !self.second_order.any(|share| share < 1.0)
    }
}
