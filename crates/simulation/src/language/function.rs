//! The functions that an expression may call, with their numbers of arguments.

/// A function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Function {
    If,
    Minimum,
    Maximum,
    Absolute,
    Sign,
    SquareRoot,
    Exponential,
    Logarithm,
    Sine,
    Cosine,
    Tangent,
    ArcTangent,
    ArcTangent2,
    HyperbolicTangent,
    SoftSign,
    SignedRoot,
    DeadBand,
    Clip,
}

/// How each function is written, and its arguments.
#[rustfmt::skip]
pub const ALL: [(&str, &[&str], Function); 18] = [
    ("if", &["condition", "then", "else"], Function::If),
    ("min", &["a", "b"], Function::Minimum),
    ("max", &["a", "b"], Function::Maximum),
    ("abs", &["a"], Function::Absolute),
    ("sign", &["a"], Function::Sign),
    ("sqrt", &["a"], Function::SquareRoot),
    ("exp", &["a"], Function::Exponential),
    ("log", &["a"], Function::Logarithm),
    ("sin", &["a"], Function::Sine),
    ("cos", &["a"], Function::Cosine),
    ("tan", &["a"], Function::Tangent),
    ("atan", &["a"], Function::ArcTangent),
    ("atan2", &["y", "x"], Function::ArcTangent2),
    ("tanh", &["a"], Function::HyperbolicTangent),
    ("soft_sign", &["v", "width"], Function::SoftSign),
    ("signed_sqrt", &["d", "width"], Function::SignedRoot),
    ("dead_band", &["x", "width"], Function::DeadBand),
    ("clip", &["x", "lower", "upper"], Function::Clip),
];

/// A function and the names of its arguments.
#[must_use]
pub fn find(name: &str) -> Option<(Function, &'static [&'static str])> {
    let (_, arguments, function) = ALL
        .iter()
        .find(|(function_name, ..)| *function_name == name)?;
    Some((*function, arguments))
}
