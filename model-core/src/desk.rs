//! The operator's desk: push-buttons and set-points that are wired to the winder PLC, and what it shows there.
//!
//! Not here: anything that acts on the winder. The desk's words stand in the image for the PLC to read and for whoever
//! plays the operator to write; the drive logic looks at none of them.

use crate::signal::Bit;

/// Push-buttons of the desk.
pub mod request {
    /// Switch the drives on.
    pub const DRIVES_ON: u16 = 1 << 0;
    /// Switch the drives off.
    pub const DRIVES_OFF: u16 = 1 << 1;
    /// Thread.
    pub const THREAD: u16 = 1 << 2;
    /// Run.
    pub const RUN: u16 = 1 << 3;
    /// Stop.
    pub const STOP: u16 = 1 << 4;
    /// Emergency stop, as long as it stands.
    pub const EMERGENCY_STOP: u16 = 1 << 5;
    /// Acknowledge.
    pub const ACKNOWLEDGE: u16 = 1 << 6;
    /// An empty core is in.
    pub const NEW_CORE: u16 = 1 << 7;
    /// A parent roll is in.
    pub const NEW_PARENT_ROLL: u16 = 1 << 8;
    /// The web is led through.
    pub const WEB_LED: u16 = 1 << 9;
    /// The web is taken out.
    pub const WEB_REMOVED: u16 = 1 << 10;
    /// Turn the parent roll forward, as long as it stands.
    pub const JOG_FORWARD: u16 = 1 << 11;
    /// Turn the parent roll backward, as long as it stands.
    pub const JOG_BACKWARD: u16 = 1 << 12;
    /// Begin to count the sets from 0.
    pub const RESET_SETS: u16 = 1 << 13;
}

/// The push-buttons by name.
pub const REQUEST_BITS: &[Bit] = &[
    Bit::new(0, "drives_on", "pressed: switch the drives on"),
    Bit::new(1, "drives_off", "pressed: switch the drives off"),
    Bit::new(2, "thread", "pressed: thread"),
    Bit::new(3, "run", "pressed: run"),
    Bit::new(4, "stop", "pressed: stop"),
    Bit::new(5, "emergency_stop", "stands: emergency stop"),
    Bit::new(6, "acknowledge", "pressed: acknowledge"),
    Bit::new(7, "new_core", "pressed: an empty core is in"),
    Bit::new(
        8,
        "new_parent_roll",
        "pressed: a parent roll is in, its diameter is in operator_parent",
    ),
    Bit::new(9, "web_led", "pressed: the web is led through the machine"),
    Bit::new(10, "web_removed", "pressed: the web is cut and taken out"),
    Bit::new(11, "jog_forward", "stands: turn the parent roll forward"),
    Bit::new(12, "jog_backward", "stands: turn the parent roll backward"),
    Bit::new(13, "reset_sets", "pressed: count the sets from 0"),
];

/// Alarms that a PLC shows.
pub mod alarm {
    /// The web has broken.
    pub const WEB_BREAK: u16 = 1 << 0;
    /// The unwind's drive has tripped.
    pub const TRIP_UW: u16 = 1 << 1;
    /// The rear drum's.
    pub const TRIP_RD: u16 = 1 << 2;
    /// The front drum's.
    pub const TRIP_FD: u16 = 1 << 3;
    /// The rider roll's.
    pub const TRIP_RR: u16 = 1 << 4;
    /// The load cells cannot be believed.
    pub const LOAD_CELL: u16 = 1 << 5;
    /// An encoder is silent.
    pub const ENCODER: u16 = 1 << 6;
    /// A brake does not follow.
    pub const BRAKE: u16 = 1 << 7;
    /// A motor is too warm.
    pub const MOTOR_HOT: u16 = 1 << 8;
    /// The drives cannot be heard, or do not hear the PLC.
    pub const LINK: u16 = 1 << 9;
    /// The parent roll is used up.
    pub const PARENT_ROLL_END: u16 = 1 << 10;
    /// Emergency stop.
    pub const EMERGENCY_STOP: u16 = 1 << 11;
}

/// The alarms by name.
pub const ALARM_BITS: &[Bit] = &[
    Bit::new(0, "web_break", "the web has broken"),
    Bit::new(1, "trip_uw", "the unwind's drive has tripped"),
    Bit::new(2, "trip_rd", "the rear drum's drive has tripped"),
    Bit::new(3, "trip_fd", "the front drum's drive has tripped"),
    Bit::new(4, "trip_rr", "the rider roll's drive has tripped"),
    Bit::new(5, "load_cell", "the load cells cannot be believed"),
    Bit::new(6, "encoder", "an encoder is silent"),
    Bit::new(7, "brake", "a brake does not follow its command"),
    Bit::new(8, "motor_hot", "a motor is too warm"),
    Bit::new(9, "link", "drives and PLC do not hear each other"),
    Bit::new(10, "parent_roll_end", "the parent roll is used up"),
    Bit::new(
        11,
        "emergency_stop",
        "the emergency stop is pressed, or has been",
    ),
];

/// What a winder's sequence does, by its code.
pub const STATES: &[&str] = &[
    "off",
    "drives being switched on",
    "ready",
    "threading",
    "web tight",
    "running",
    "stopping",
    "set wound",
    "fault",
];
