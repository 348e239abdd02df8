//! What the servo says of itself in the catalogue.
//!
//! The defaults are the nominal rig of the method description §1: bore, rod and stroke
//! 40/22/140 mm, 7 MPa supply, and the paper's identified mass, damping, spring and bulk modulus.

use crate::model::{
    InitialState, ModelDescription, ParameterDescription, SignalDescription, StateDescription,
    Tolerance,
};

type P = ParameterDescription;

/// A part of the value, in per cent.
const fn per_cent(share: f64) -> Tolerance {
    Tolerance::Percent(share)
}

/// A number in the unit of the value.
const fn about(deviation: f64) -> Tolerance {
    Tolerance::Absolute(deviation)
}

const GAUGE: &str = "pressure gauge of class 1 (EN 837-1)";
const BORE: &str = "bore within H8, rod within f7 (ISO 286)";
const ESTIMATED: &str = "hoses and manifold, taken from a drawing";
const MEASURED_LENGTH: &str = "length measured with a rule";
const RATED_FLOW: &str = "rated flow within 10 % (data sheets of servovalves), as 95 %";
const VALVE_CURVES: &str = "typical curves of a data sheet";
const NULL: &str =
    "null bias within 2 % of the rated command (data sheets of servovalves), as 95 %";
const OVERLAP: &str = "a critically lapped spool (Merritt, ch. 5)";
const SEALS: &str = "seals: up to 1 % of the largest force, as 95 %";
const LEAKAGE: &str = "seals and spool clearance of a servovalve (Merritt, ch. 5)";
const FREE_AIR: &str = "oil left standing holds up to 1 % of free air (Merritt, ch. 2)";
const ROUGH: &str = "a constant of the model that no data sheet gives";
const CONTROLLER: &str = "gain of an analogue loop";
const SAMPLING: &str = "conversion and transport of a sampled loop";
const WEIGHT: &str = "weight and friction of hoses and cables";
const PUMP: &str = "supply line and regulator at the largest flow";

/// The catalogue's entry.
pub(super) fn describe() -> ModelDescription {
    ModelDescription {
        name: "single_rod_servo".into(),
        title: "Electro-hydraulic servo with a single-rod cylinder".into(),
        summary: "A servovalve drives a single-rod cylinder that moves a mass on a spring. Driven \
                  by the position reference (the sampled position loop is simulated, so drift \
                  cannot build up) or by the recorded valve command. Effects that are off at \
                  their neutral value: servovalve dynamics, dead band, valve offset, Coulomb and \
                  Stribeck friction, leakage, entrained air, end stops, input delay, constant \
                  load, supply droop."
            .into(),
        inputs: vec![
            signal("reference", "m", "set point of the piston position"),
            signal("valve_command", "1", "command to the servovalve, -1 to 1"),
        ],
        input_sets: vec![vec!["reference".into()], vec!["valve_command".into()]],
        states: states(),
        sampled: Vec::new(),
        outputs: vec![
            signal(
                "position",
                "m",
                "position of the piston from the retracted end",
            ),
            signal("velocity", "m/s", "velocity of the piston"),
            signal(
                "chamber_pressure_1",
                "Pa",
                "absolute pressure on the piston side",
            ),
            signal(
                "chamber_pressure_2",
                "Pa",
                "absolute pressure on the rod side",
            ),
        ],
        parameters: [unknowns(), hydraulics(), control_and_valve(), effects()].concat(),
        equations: [
            "psi(d) = d / (d^2 + d0^2)^(1/4)",
            "u >= 0: Q1 = Kq*u*psi(ps - p1), Q2 = Kq*u*psi(p2 - pt)",
            "u < 0: Q1 = Kq*u*psi(p1 - pt), Q2 = Kq*u*psi(ps - p2)",
            "V1 = V01 + A1*x, V2 = V02 + A2*(L - x)",
            "p1' = Km/V1 * (Q1 - A1*v - ci*(p1 - p2) - ce*(p1 - pt))",
            "p2' = Km/V2 * (A2*v - Q2 + ci*(p1 - p2) - ce*(p2 - pt))",
            "x' = v",
            "v' = (A1*p1 - A2*p2 - B*v - Ks*(x - xs0) - Ff(v) - FL - Fstop(x, v)) / M",
            "Ff(v) = (Fc + Fs*exp(-(v/vst)^2)) * tanh(v/vs)",
            "reference mode: command = clip(Kp*(r - x), -1, 1) + u0, once a sample, held",
            "spool: s'' = wv^2*(command - s) - 2*zv*wv*s', opening u = s beyond the dead band",
        ]
        .map(Into::into)
        .to_vec(),
        source: "Study of Parameter Identification Using Hybrid Neural-Genetic Algorithm in \
                 Electro-Hydraulic Servo System, Eq. 1-6, corrected; H. E. Merritt, Hydraulic \
                 Control Systems, 1967; M. Jelali, A. Kroll, Hydraulic Servo-systems, 2003"
            .into(),
    }
}

fn signal(name: &'static str, unit: &'static str, meaning: &'static str) -> SignalDescription {
    SignalDescription::new(name, unit, meaning)
}

fn states() -> Vec<StateDescription> {
    [
        (
            "chamber_pressure_1",
            "Pa",
            "absolute pressure on the piston side",
        ),
        (
            "chamber_pressure_2",
            "Pa",
            "absolute pressure on the rod side",
        ),
        (
            "position",
            "m",
            "position of the piston; starts at the spring's neutral position",
        ),
        ("velocity", "m/s", "velocity of the piston"),
        (
            "spool_position",
            "1",
            "position of the spool as a share of its stroke",
        ),
        (
            "spool_velocity",
            "1/s",
            "rate of change of the spool position",
        ),
    ]
    .map(|(name, unit, meaning)| StateDescription {
        name: name.into(),
        unit: unit.into(),
        meaning: meaning.into(),
        initial: InitialState::Model,
    })
    .to_vec()
}

fn unknowns() -> Vec<P> {
    const MASS: [&str; 3] = ["M", "kg", "moving mass"];
    const DAMPING: [&str; 3] = ["B", "N*s/m", "viscous damping of the piston and the load"];
    const STIFFNESS: [&str; 3] = ["Ks", "N/m", "stiffness of the load spring"];
    const BULK: [&str; 3] = ["Km", "Pa", "effective bulk modulus of the oil"];
    let positive = Some(f64::MIN_POSITIVE);
    vec![
        P::known("mass", MASS, 58.0, [20.0, 120.0])
            .log_scale()
            .unknown()
            .within(positive, None),
        P::known("damping", DAMPING, 370.0, [50.0, 2000.0])
            .log_scale()
            .unknown(),
        P::known("stiffness", STIFFNESS, 21_412.0, [5e3, 60e3])
            .log_scale()
            .unknown(),
        P::known("bulk_modulus", BULK, 1.6009e9, [0.4e9, 2.4e9])
            .log_scale()
            .unknown()
            .within(positive, None),
    ]
}

fn hydraulics() -> Vec<P> {
    const FLOW: [&str; 3] = [
        "Kq",
        "m^3/(s*sqrt(Pa))",
        "flow gain of the fully open valve",
    ];
    const SUPPLY: [&str; 3] = ["ps", "Pa", "absolute supply pressure"];
    const RETURN: [&str; 3] = ["pt", "Pa", "absolute return pressure"];
    const TRANSITION: [&str; 3] = ["d0", "Pa", "pressure drop below which a port is laminar"];
    const AREA_1: [&str; 3] = ["A1", "m^2", "piston area"];
    const AREA_2: [&str; 3] = ["A2", "m^2", "annulus area of the rod side"];
    const STROKE: [&str; 3] = ["L", "m", "stroke of the cylinder"];
    const DEAD_1: [&str; 3] = ["V01", "m^3", "dead volume of the piston side"];
    const DEAD_2: [&str; 3] = ["V02", "m^3", "dead volume of the rod side"];
    const NEUTRAL: [&str; 3] = ["xs0", "m", "position at which the spring is unloaded"];
    let positive = Some(f64::MIN_POSITIVE);
    vec![
        P::known("flow_gain", FLOW, 8.91e-8, [4e-8, 2e-7])
            .log_scale()
            .within_tolerance(per_cent(5.0), RATED_FLOW),
        P::known("supply_pressure", SUPPLY, 7e6, [3e6, 2.1e7])
            .log_scale()
            .within_tolerance(per_cent(1.0), GAUGE),
        P::known("return_pressure", RETURN, 1e5, [0.0, 1e6]).within_tolerance(about(2e4), GAUGE),
        P::known("transition_pressure", TRANSITION, 2e4, [1e3, 5e5])
            .log_scale()
            .within(positive, None)
            .within_tolerance(per_cent(50.0), ROUGH),
        P::known("piston_area", AREA_1, 1.2566e-3, [6e-4, 2.5e-3])
            .within(positive, None)
            .within_tolerance(per_cent(0.1), BORE),
        P::known("annulus_area", AREA_2, 8.765e-4, [4e-4, 1.8e-3])
            .within(positive, None)
            .within_tolerance(per_cent(0.1), BORE),
        P::known("stroke", STROKE, 0.14, [0.07, 0.28])
            .within(positive, None)
            .within_tolerance(about(5e-4), MEASURED_LENGTH),
        P::known("dead_volume_1", DEAD_1, 3e-5, [1e-5, 2e-4])
            .log_scale()
            .within(positive, None)
            .within_tolerance(per_cent(30.0), ESTIMATED),
        P::known("dead_volume_2", DEAD_2, 3e-5, [1e-5, 2e-4])
            .log_scale()
            .within(positive, None)
            .within_tolerance(per_cent(30.0), ESTIMATED),
        P::known("spring_neutral_position", NEUTRAL, 0.07, [0.0, 0.14])
            .within(None, None)
            .within_tolerance(about(5e-4), MEASURED_LENGTH),
    ]
}

fn control_and_valve() -> Vec<P> {
    const GAIN: [&str; 3] = [
        "Kp",
        "1/m",
        "gain of the position loop, used in reference mode",
    ];
    const FREQUENCY: [&str; 3] = [
        "wv",
        "rad/s",
        "natural frequency of the spool; 0: none of second order",
    ];
    const RATIO: [&str; 3] = ["zv", "1", "damping ratio of the spool"];
    const TIME: [&str; 3] = [
        "tv",
        "s",
        "time constant of the spool where its natural frequency is 0; 0: none",
    ];
    const BAND: [&str; 3] = ["db", "1", "half width of the spool's dead band"];
    const OFFSET: [&str; 3] = ["u0", "1", "offset added to the valve command"];
    vec![
        P::known("position_gain", GAIN, 100.0, [20.0, 500.0])
            .log_scale()
            .within_tolerance(per_cent(0.5), CONTROLLER),
        P::known(
            "spool_natural_frequency",
            FREQUENCY,
            200.0 * std::f64::consts::PI,
            [60.0, 2000.0],
        )
        .log_scale()
        .within_tolerance(per_cent(10.0), VALVE_CURVES),
        P::known("spool_damping_ratio", RATIO, 0.7, [0.3, 1.5])
            .within_tolerance(per_cent(20.0), VALVE_CURVES),
        P::known("spool_time_constant", TIME, 0.0, [2e-4, 2e-2]).log_scale(),
        P::known("dead_band", BAND, 0.0, [0.0, 0.1])
            .within(Some(0.0), Some(1.0))
            .within_tolerance(about(5e-3), OVERLAP),
        P::known("valve_offset", OFFSET, 0.0, [-0.1, 0.1])
            .within(Some(-1.0), Some(1.0))
            .within_tolerance(about(1e-2), NULL),
    ]
}

fn effects() -> Vec<P> {
    const COULOMB: [&str; 3] = ["Fc", "N", "Coulomb friction"];
    const VELOCITY: [&str; 3] = ["vs", "m/s", "velocity over which friction changes its sign"];
    const STRIBECK: [&str; 3] = ["Fs", "N", "excess of the friction at low speed"];
    const STRIBECK_V: [&str; 3] = ["vst", "m/s", "velocity over which that excess fades"];
    const INTERNAL: [&str; 3] = ["ci", "m^3/(s*Pa)", "leakage across the piston"];
    const EXTERNAL: [&str; 3] = ["ce", "m^3/(s*Pa)", "leakage of each chamber to the return"];
    const AIR: [&str; 3] = [
        "alpha",
        "1",
        "share of air in the oil at atmospheric pressure",
    ];
    const STOP_K: [&str; 3] = ["kst", "N/m", "stiffness of the end stops; 0: none"];
    const STOP_C: [&str; 3] = ["cst", "s/m", "loss of the end stops"];
    const DELAY: [&str; 3] = ["td", "s", "time until a valve command acts"];
    const LOAD: [&str; 3] = ["FL", "N", "constant load against extension"];
    const DROOP: [&str; 3] = [
        "Rs",
        "Pa*s/m^3",
        "fall of the supply pressure per flow taken",
    ];
    let positive = Some(f64::MIN_POSITIVE);
    vec![
        P::known("coulomb_friction", COULOMB, 0.0, [0.0, 500.0])
            .within_tolerance(about(50.0), SEALS),
        P::known("friction_velocity", VELOCITY, 2e-3, [5e-4, 2e-2])
            .log_scale()
            .within(positive, None)
            .within_tolerance(per_cent(50.0), ROUGH),
        P::known("stribeck_friction", STRIBECK, 0.0, [0.0, 500.0])
            .within_tolerance(about(25.0), SEALS),
        P::known("stribeck_velocity", STRIBECK_V, 1e-2, [2e-3, 0.1])
            .log_scale()
            .within(positive, None)
            .within_tolerance(per_cent(50.0), ROUGH),
        P::known("internal_leakage", INTERNAL, 0.0, [0.0, 1e-11])
            .within_tolerance(about(5e-13), LEAKAGE),
        P::known("external_leakage", EXTERNAL, 0.0, [0.0, 1e-11])
            .within_tolerance(about(1e-13), LEAKAGE),
        P::known("air_fraction", AIR, 0.0, [0.0, 0.05])
            .within(Some(0.0), Some(1.0))
            .within_tolerance(about(5e-3), FREE_AIR),
        P::known("end_stop_stiffness", STOP_K, 0.0, [1e6, 1e9]).log_scale(),
        P::known("end_stop_damping", STOP_C, 1.0, [0.0, 10.0]),
        P::known("input_delay", DELAY, 0.0, [0.0, 0.05]).within_tolerance(about(2e-4), SAMPLING),
        P::known("load_force", LOAD, 0.0, [-2000.0, 2000.0])
            .within(None, None)
            .within_tolerance(about(20.0), WEIGHT),
        P::known("supply_droop", DROOP, 0.0, [0.0, 5e9]).within_tolerance(about(1e8), PUMP),
    ]
}
