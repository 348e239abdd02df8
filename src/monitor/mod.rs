//! What is watched in recordings that grow: what a monitor is asked, what it knows, and what is shown of
//! its windows.

pub mod detector;
pub mod doubts;
pub mod information;
pub mod record;
pub mod spec;
pub mod state;
pub mod template;
pub mod warm;

pub use record::{Alarm, MonitorWindow, ShownWindow, WindowStatus};
pub use spec::MonitorSpec;
pub use state::State;
pub use template::JobTemplate;

/// Instants in a window at the most.
pub const MAX_WINDOW_SAMPLES: usize = 2_000_000;
