//! Command and status words of the winder, and the codes of modes, refusals and faults.

use crate::signal::Bit;

/// Bits of the winder's command word.
pub mod command {
    /// Thread: a rising edge starts it, 0 ends it.
    pub const THREAD: u16 = 1 << 0;
    /// Stall tension at standstill: a rising edge starts it, 0 ends it.
    pub const STALL: u16 = 1 << 1;
    /// Run: a rising edge starts it, 0 is a normal stop.
    pub const RUN: u16 = 1 << 2;
    /// Rising edge: take over the unwind's diameter preset.
    pub const PRESET_ACCEPT: u16 = 1 << 3;
    /// Rising edge: the operator has led the web through the machine.
    pub const WEB_THREADED: u16 = 1 << 4;
    /// Close the drum brakes at standstill.
    pub const DRUM_BRAKES: u16 = 1 << 5;
    /// Rising edge: acknowledge faults.
    pub const ACKNOWLEDGE: u16 = 1 << 6;
    /// Rising edge: the operator has put in an empty core.
    pub const NEW_CORE: u16 = 1 << 7;
    /// Rising edge: the operator has put in a full parent roll.
    pub const NEW_PARENT_ROLL: u16 = 1 << 8;
    /// Rising edge: forget the worst task times and overruns.
    pub const RESET_TIMES: u16 = 1 << 9;
}

/// Bits of the winder's status word.
pub mod status {
    /// All drives follow their set-points.
    pub const DRIVES_ON: u16 = 1 << 0;
    /// The web is under tension.
    pub const TENSION_DETECTED: u16 = 1 << 1;
    /// The web is led through the machine.
    pub const WEB_THREADED: u16 = 1 << 2;
    /// A web break has been detected and not acknowledged.
    pub const WEB_BREAK: u16 = 1 << 3;
    /// The web runs at its set speed.
    pub const AT_SPEED: u16 = 1 << 4;
    /// The web stands still.
    pub const ZERO_SPEED: u16 = 1 << 5;
    /// The unwind's brake is closed.
    pub const BRAKE_UW: u16 = 1 << 6;
    /// The rear drum's brake is closed.
    pub const BRAKE_RD: u16 = 1 << 7;
    /// The front drum's brake is closed.
    pub const BRAKE_FD: u16 = 1 << 8;
    /// A diameter preset has been taken over.
    pub const PRESET_TAKEN: u16 = 1 << 9;
    /// A fault is latched.
    pub const FAULT: u16 = 1 << 10;
    /// The last command was refused.
    pub const REFUSED: u16 = 1 << 11;
}

/// The bits of the command word by name.
pub const COMMAND_BITS: &[Bit] = &[
    Bit::new(0, "thread", "rising edge starts thread; 0 ends it"),
    Bit::new(
        1,
        "stall",
        "rising edge puts stall tension on the standing web; 0 takes it off",
    ),
    Bit::new(2, "run", "rising edge starts run; 0 is a normal stop"),
    Bit::new(
        3,
        "preset_accept",
        "rising edge takes over the unwind's diameter preset",
    ),
    Bit::new(
        4,
        "web_threaded",
        "rising edge: the operator has led the web through the machine",
    ),
    Bit::new(5, "drum_brakes", "closes the drum brakes at standstill"),
    Bit::new(6, "acknowledge", "rising edge acknowledges faults"),
    Bit::new(
        7,
        "new_core",
        "rising edge: the operator has put in an empty core",
    ),
    Bit::new(
        8,
        "new_parent_roll",
        "rising edge: the operator has put in a full parent roll",
    ),
    Bit::new(
        9,
        "reset_times",
        "rising edge forgets the worst task times and overruns",
    ),
];

/// The bits of the status word by name.
pub const STATUS_BITS: &[Bit] = &[
    Bit::new(0, "drives_on", "all drives follow their set-points"),
    Bit::new(1, "tension_detected", "the web is under tension"),
    Bit::new(2, "web_threaded", "the web is led through the machine"),
    Bit::new(
        3,
        "web_break",
        "a web break has been detected and not acknowledged",
    ),
    Bit::new(4, "at_speed", "the web runs at its set speed"),
    Bit::new(5, "zero_speed", "the web stands still"),
    Bit::new(6, "brake_uw", "the unwind's brake is closed"),
    Bit::new(7, "brake_rd", "the rear drum's brake is closed"),
    Bit::new(8, "brake_fd", "the front drum's brake is closed"),
    Bit::new(9, "preset_taken", "a diameter preset has been taken over"),
    Bit::new(10, "fault", "a fault is latched"),
    Bit::new(11, "refused", "the last command was refused"),
];

/// Writes an enum of codes with their texts from one table.
macro_rules! codes {
    ($(#[$doc:meta])* $name:ident { $first:ident: $first_text:literal, $($id:ident: $text:literal,)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        #[repr(u16)]
        pub enum $name {
            #[doc = $first_text]
            #[default]
            $first,
            $(#[doc = $text] $id,)*
        }
        impl $name {
            /// The text of every code; the index is the code.
            pub const NAMES: &[&str] = &[$first_text, $($text),*];
            /// Every code in order.
            pub const ALL: &[Self] = &[Self::$first, $(Self::$id),*];
                /// The text of this code.
            pub fn name(self) -> &'static str {
                Self::NAMES[self as usize]
            }
        }
    };
}

codes! {
    /// Operating mode of the winder.
    Mode {
        Off: "drives off, brakes closed",
        Ready: "drives on, standing, no tension",
        Thread: "thread",
        Stall: "stall tension at standstill",
        Run: "run",
        NormalStop: "normal stop",
        EmergencyStop: "emergency stop",
        CoastStop: "coast stop",
        WebBreakStop: "web-break stop",
    }
}

codes! {
    /// Why a command was refused.
    Refusal {
        None: "none",
        DrivesNotOn: "not all drives are in operation",
        FaultLatched: "a fault is latched: acknowledge it first",
        NotAtStandstill: "the machine is not at standstill",
        WebNotThreaded: "the web is not threaded",
        NoTension: "no web tension",
        NoPreset: "no diameter preset has been taken over",
        PresetOutOfRange: "the diameter preset is not between spool and full roll",
        WrongMode: "not permitted in this mode",
    }
}

codes! {
    /// What has gone wrong.
    Fault {
        None: "none",
        HeartbeatLost: "the PLC's heartbeat stands still",
        WebBreak: "web break",
    }
}
