//! Bits of the word that tells a PLC about its link.
//!
//! Not here: who sets them; that is the link.

use crate::signal::Bit;

/// Bits of the link's status word.
pub mod link_status {
    /// A holding register has been written outside its signal's limits, and is limited.
    pub const LIMITED: u16 = 1 << 0;
    /// A PLC controls the winder.
    pub const PLC_CONTROLS: u16 = 1 << 1;
    /// The operator panel controls the winder.
    pub const PANEL_CONTROLS: u16 = 1 << 2;
    /// The last write was refused, because its author may not write or somebody else controls the winder.
    pub const WRITE_REFUSED: u16 = 1 << 3;
}

/// The bits of the link's status word by name.
pub const LINK_STATUS_BITS: &[Bit] = &[
    Bit::new(
        0,
        "limited",
        "alarm: a command was written outside its limits and is limited; limited_register says which",
    ),
    Bit::new(1, "plc_controls", "a PLC controls the winder"),
    Bit::new(
        2,
        "panel_controls",
        "the operator panel controls the winder",
    ),
    Bit::new(
        3,
        "write_refused",
        "the last write was refused: its author may not write, or somebody else controls the winder",
    ),
];
