//! Figures of convergence beside those of an independent program.

use super::*;

/// Numbers that any program can draw again: a linear congruential generator with Knuth's constants
/// (*The Art of Computer Programming*, vol. 2, 1998, §3.3.4, MMIX), of which the upper 53 bits count.
struct Congruential(u64);

impl Congruential {
    fn unit(&mut self) -> f64 {
        const FACTOR: u64 = 6_364_136_223_846_793_005;
        const SUMMAND: u64 = 1_442_695_040_888_963_407;
        self.0 = self.0.wrapping_mul(FACTOR).wrapping_add(SUMMAND);
        (self.0 >> 11) as f64 / 2.0_f64.powi(53)
    }
}

/// Chains `y = (x + c·shift)·(1 + c·spread)`, c from 0, of x that remember `memory` of the draw before
/// and receive a uniform number from −½ to ½.
struct Rule {
    chains: u64,
    draws: usize,
    memory: f64,
    shift: f64,
    spread: f64,
    /// The power of y that is taken: 1, or −1 for a distribution without a mean.
    power: i32,
    seed: u64,
}

impl Rule {
    fn draw(&self) -> Vec<Vec<f64>> {
        let chain = |place: u64| {
            let mut numbers = Congruential(self.seed + place);
            let mut x = 0.0;
            let draws = (0..self.draws).map(|_| {
                x = self.memory * x + (numbers.unit() - 0.5);
                let place = place as f64;
                let y = (x + self.shift * place) * (1.0 + self.spread * place);
                y.powi(self.power)
            });
            draws.collect()
        };
        (0..self.chains).map(chain).collect()
    }

    fn check(&self, r_hat: f64, ess_bulk: f64, ess_tail: f64) {
        let convergence = Convergence::of(&self.draw()).expect("chains that can be judged");
        let pairs = [
            (convergence.r_hat, r_hat),
            (convergence.ess_bulk, ess_bulk),
            (convergence.ess_tail, ess_tail),
        ];
        for (figure, expected) in pairs {
            let off = figure / expected - 1.0;
            assert!(off.abs() < 1e-9, "{figure} beside {expected}");
        }
    }
}

const PLAIN: Rule = Rule {
    chains: 4,
    draws: 400,
    memory: 0.7,
    shift: 0.0,
    spread: 0.0,
    power: 1,
    seed: 1,
};

/// The figures are those of ArviZ 0.23.4 (`rhat`, `ess(method="bulk")`, `ess(method="tail")`) for
/// the same chains.
#[test]
fn the_figures_are_those_of_an_independent_program() {
    PLAIN.check(
        1.011_011_850_906_075_3,
        275.137_894_991_741_86,
        503.954_621_912_750_1,
    );
    let apart = Rule {
        draws: 300,
        memory: 0.3,
        shift: 0.05,
        seed: 11,
        ..PLAIN
    };
    apart.check(
        1.032_808_346_929_981,
        176.698_094_458_457_35,
        290.569_498_020_776_6,
    );
    let of_other_widths = Rule {
        draws: 300,
        memory: 0.3,
        spread: 0.5,
        seed: 51,
        ..PLAIN
    };
    of_other_widths.check(
        1.112_789_012_202_953,
        580.804_082_227_455,
        70.745_089_445_711_13,
    );
    let without_a_mean = Rule {
        draws: 500,
        memory: 0.5,
        power: -1,
        seed: 21,
        ..PLAIN
    };
    without_a_mean.check(
        1.002_457_840_665_668_6,
        1_699.014_562_229_385,
        1_915.443_552_109_294_8,
    );
    let odd = Rule {
        chains: 3,
        draws: 201,
        memory: 0.9,
        seed: 31,
        ..PLAIN
    };
    odd.check(
        1.060_485_725_734_809,
        31.309_423_101_777_504,
        99.677_843_316_140_84,
    );
    // Draws that alternate are worth more than independent ones; how much more has an end.
    let alternating = Rule {
        memory: -0.6,
        seed: 41,
        ..PLAIN
    };
    alternating.check(
        1.001_128_675_863_731_7,
        5_126.591_972_249_479,
        1_479.854_318_218_254_5,
    );
}

#[test]
fn chains_that_say_nothing_are_not_judged() {
    assert_eq!(Convergence::of(&[]), None);
    assert_eq!(Convergence::of(&[vec![1.0, 2.0, 3.0]]), None);
    assert_eq!(Convergence::of(&[vec![1.0; 8], vec![1.0; 8]]), None);
    assert_eq!(Convergence::of(&[vec![1.0, 2.0, 3.0, f64::NAN]]), None);
    assert_eq!(
        Convergence::of(&[vec![1.0, 2.0, 3.0, 4.0], vec![1.0, 2.0]]),
        None
    );
}
