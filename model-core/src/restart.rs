//! Why the simulator has started.
//!
//! Not here: who watches, and how a board finds out.

/// What its last start was for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Restart {
    /// Power came.
    #[default]
    PowerOn,
    /// The plant's task hung.
    Plant,
    /// The regulators' task hung.
    Drive,
    /// The logic's task hung.
    Logic,
    /// The network's task hung.
    Network,
    /// Logic and network hung, so that something in the background did not let go.
    Background,
    /// It gave up.
    GaveUp,
    /// A reset from outside.
    Outside,
}

impl Restart {
    /// All of them, by their numbers.
    pub const ALL: [Self; 8] = [
        Self::PowerOn,
        Self::Plant,
        Self::Drive,
        Self::Logic,
        Self::Network,
        Self::Background,
        Self::GaveUp,
        Self::Outside,
    ];

    /// A line for each, by its number.
    pub const TEXTS: [&str; 8] = [
        "power came",
        "the plant's task hung",
        "the regulators' task hung",
        "the logic's task hung",
        "the network's task hung",
        "the background hung",
        "the firmware gave up",
        "reset from outside",
    ];

    /// Its number.
    pub fn number(self) -> u8 {
        self as u8
    }

    /// Nobody has asked for it.
    pub fn is_by_itself(self) -> bool {
        !matches!(self, Self::PowerOn | Self::Outside)
    }
}
