//! A Runge–Kutta method of eighth order: where the tolerance is small its steps are so much longer
//! than those of fourth order that their twelve derivatives pay.
//!
//! DOP853 of J. R. Dormand and P. J. Prince with the weights of E. Hairer, S. P. Nørsett and
//! G. Wanner, *Solving Ordinary Differential Equations I*, 1993, sections II.5 and II.10, whose
//! estimate of the error puts a method of fifth and one of third order together. The last two
//! slopes are taken at the same instant, as those of the method of fourth order are.

use crate::equations::Equations;
use greybox_numerics::lanes::Real;

/// Derivatives that one step takes.
pub const STAGES: usize = 12;

/// A step times the fastest rate beyond which stability limits it, over that of the method of
/// fourth order. The methods end to be stable at 6.1 and at 2.78; this one is so accurate that its
/// steps come nearer to its end where accuracy limits them.
pub const STABLE_FOR: f64 = 3.2;

/// A slope by its number, and its share.
type Term = (usize, f64);

/// What leads to the point at which each slope but the first is taken.
const POINTS: [&[Term]; STAGES - 1] = [
    &[(0, 0.052_600_151_958_767_73)],
    &[(0, 0.019_725_056_984_537_9), (1, 0.059_175_170_953_613_7)],
    &[(0, 0.029_587_585_476_806_85), (2, 0.088_762_756_430_420_54)],
    &[
        (0, 0.241_365_134_159_266_7),
        (2, -0.884_549_479_328_286_1),
        (3, 0.924_834_003_261_792),
    ],
    &[
        (0, 0.037_037_037_037_037_035),
        (3, 0.170_828_608_729_473_86),
        (4, 0.125_467_687_566_822_42),
    ],
    &[
        (0, 0.037_109_375),
        (3, 0.170_252_211_019_544_05),
        (4, 0.060_216_538_980_455_96),
        (5, -0.017_578_125),
    ],
    &[
        (0, 0.037_092_000_118_504_79),
        (3, 0.170_383_925_712_239_98),
        (4, 0.107_262_030_446_373_28),
        (5, -0.015_319_437_748_624_402),
        (6, 0.008_273_789_163_814_023),
    ],
    &[
        (0, 0.624_110_958_716_075_7),
        (3, -3.360_892_629_446_941_4),
        (4, -0.868_219_346_841_726),
        (5, 27.592_099_699_446_71),
        (6, 20.154_067_550_477_894),
        (7, -43.489_884_181_069_96),
    ],
    &[
        (0, 0.477_662_536_438_264_34),
        (3, -2.488_114_619_971_667_7),
        (4, -0.590_290_826_836_843),
        (5, 21.230_051_448_181_193),
        (6, 15.279_233_632_882_423),
        (7, -33.288_210_968_984_86),
        (8, -0.020_331_201_708_508_627),
    ],
    &[
        (0, -0.937_142_430_085_987_3),
        (3, 5.186_372_428_844_064),
        (4, 1.091_437_348_996_729_5),
        (5, -8.149_787_010_746_927),
        (6, -18.520_065_659_996_96),
        (7, 22.739_487_099_350_505),
        (8, 2.493_605_552_679_652_3),
        (9, -3.046_764_471_898_219_6),
    ],
    &[
        (0, 2.273_310_147_516_538),
        (3, -10.534_495_466_737_25),
        (4, -2.000_872_058_224_862_5),
        (5, -17.958_931_863_118_8),
        (6, 27.948_884_529_419_96),
        (7, -2.858_998_277_135_023_5),
        (8, -8.872_856_933_530_63),
        (9, 12.360_567_175_794_303),
        (10, 0.643_392_746_015_763_6),
    ],
];

/// The times at which the slopes of `POINTS` are taken, as shares of the step.
const TIMES: [f64; STAGES - 1] = [
    0.052_600_151_958_767_73,
    0.078_900_227_938_151_6,
    0.118_350_341_907_227_4,
    0.281_649_658_092_772_6,
    0.333_333_333_333_333_3,
    0.25,
    0.307_692_307_692_307_7,
    0.651_282_051_282_051_3,
    0.6,
    0.857_142_857_142_857_1,
    1.0,
];

/// What leads to the end.
const END: &[Term] = &[
    (0, 0.054_293_734_116_568_765),
    (5, 4.450_312_892_752_409),
    (6, 1.891_517_899_314_500_3),
    (7, -5.801_203_960_010_585),
    (8, 0.311_164_366_957_819_9),
    (9, -0.152_160_949_662_516_1),
    (10, 0.201_365_400_804_030_34),
    (11, 0.044_710_615_727_772_59),
];

/// The error of the method of fifth order, and of that of third order.
const FIFTH: &[Term] = &[
    (0, 0.013_120_044_994_194_88),
    (5, -1.225_156_446_376_204_4),
    (6, -0.495_758_949_657_250_2),
    (7, 1.664_377_182_454_986_4),
    (8, -0.350_328_848_749_973_66),
    (9, 0.334_179_118_713_017_5),
    (10, 0.081_923_206_485_115_71),
    (11, -0.022_355_307_863_886_294),
];
const THIRD: &[Term] = &[
    (0, -0.189_800_754_072_407_62),
    (5, 4.450_312_892_752_409),
    (6, 1.891_517_899_314_500_3),
    (7, -5.801_203_960_010_585),
    (8, -0.422_682_321_323_791_9),
    (9, -0.152_160_949_662_516_1),
    (10, 0.201_365_400_804_030_34),
    (11, 0.022_651_792_198_360_82),
];

/// The slopes of a step, and where it leads.
#[derive(Clone, Debug)]
pub struct EighthOrderStages<S> {
    slopes: [S; STAGES],
    /// Where the last slope is taken.
    pub point: S,
    /// The states at the end.
    pub next: S,
    /// The slope at the end.
    pub end: S,
}

impl<S: Clone> EighthOrderStages<S> {
    /// Room for the slopes of such states.
    pub fn like(states: &S) -> EighthOrderStages<S> {
        EighthOrderStages {
            slopes: std::array::from_fn(|_| states.clone()),
            point: states.clone(),
            next: states.clone(),
            end: states.clone(),
        }
    }
}

/// Where a step starts.
pub struct StepStart<'a, S, R> {
    /// The states at the start.
    pub states: &'a S,
    /// The slope of the states at the start.
    pub slope: &'a S,
    /// The time since the held quantities began to act `[s]`.
    pub elapsed: R,
}

/// A step of `length`: writes the states at the end and the slope there.
#[inline(always)]
pub fn step<R: Real, E: Equations<R>>(
    equations: &mut E,
    start: StepStart<'_, E::States, R>,
    stages: &mut EighthOrderStages<E::States>,
    length: R,
) {
    let EighthOrderStages {
        slopes,
        point,
        next,
        end,
    } = stages;
    let StepStart {
        states,
        slope,
        elapsed,
    } = start;
    slopes[0].as_mut().copy_from_slice(slope.as_ref());
    for (stage, (terms, time)) in POINTS.into_iter().zip(TIMES).enumerate() {
        combine(point, states, length, terms, slopes);
        let time = elapsed + length * R::splat(time);
        equations.rates(point, time, &mut slopes[stage + 1]);
    }
    combine(next, states, length, END, slopes);
    equations.rates(next, elapsed + length, end);
}

impl<S> EighthOrderStages<S> {
    /// The slope at the end by way of the point before.
    pub fn last(&self) -> &S {
        &self.slopes[STAGES - 1]
    }

    /// The square of the step's estimated error, each state's times its weight: the mean over the
    /// states.
    #[inline(always)]
    pub fn squared_error<R: Real>(&self, weights: &S, length: R) -> R
    where
        S: AsRef<[R]>,
    {
        let zero = R::splat(0.0);
        let (mut fifth, mut third) = (zero, zero);
        for (index, weight) in weights.as_ref().iter().enumerate() {
            let (a, b) = (
                sum(FIFTH, &self.slopes, index) * *weight,
                sum(THIRD, &self.slopes, index) * *weight,
            );
            fifth += a * a;
            third += b * b;
        }
        // Not 0, and then the error is 0.
        let least = R::splat(f64::from(f32::MIN_POSITIVE));
        let both = (fifth + third * R::splat(0.01)).max(least);
        let n = R::splat(1.0 / weights.as_ref().len() as f64);
        fifth * (fifth / both) * (length * length) * n
    }
}

/// `to = from + length · Σ share · slope`
#[inline(always)]
fn combine<R: Real, S: AsRef<[R]> + AsMut<[R]>>(
    to: &mut S,
    from: &S,
    length: R,
    terms: &[Term],
    slopes: &[S; STAGES],
) {
    for (index, (to, from)) in to.as_mut().iter_mut().zip(from.as_ref()).enumerate() {
        *to = *from + length * sum(terms, slopes, index);
    }
}

/// `Σ share · slope` of one state.
#[inline(always)]
fn sum<R: Real, S: AsRef<[R]>>(terms: &[Term], slopes: &[S; STAGES], state: usize) -> R {
    let mut sum = R::splat(0.0);
    for (slope, share) in terms {
        sum += slopes[*slope].as_ref()[state] * R::splat(*share);
    }
    sum
}
