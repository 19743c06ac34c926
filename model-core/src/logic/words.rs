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
    /// Unwind maneuver forward, as long as it stands.
    pub const JOG_FORWARD: u16 = 1 << 10;
    /// Unwind maneuver backward, as long as it stands.
    pub const JOG_BACKWARD: u16 = 1 << 11;
    /// The second diameter preset is the one to accept.
    pub const PRESET_2: u16 = 1 << 12;
    /// Auto-tune: a rising edge starts it, 0 ends it.
    pub const AUTOTUNE: u16 = 1 << 13;
    /// Rising edge: the operator has cut the web and taken it out.
    pub const WEB_REMOVED: u16 = 1 << 14;
}

/// Bits of the winder's second command word.
pub mod command_2 {
    /// The rider roll is lifted off the shipping roll, as long as it stands.
    pub const RIDER_UP: u16 = 1 << 0;
    /// The tension loop is open, as long as it stands.
    pub const TENSION_CONTROL_OFF: u16 = 1 << 1;
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
    /// The rider roll lies on the shipping roll.
    pub const RIDER_DOWN: u16 = 1 << 12;
    /// The tension loop is closed.
    pub const TENSION_CONTROL: u16 = 1 << 13;
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
    Bit::new(
        10,
        "jog_forward",
        "rising edge starts the unwind maneuver, forward; 0 ends it",
    ),
    Bit::new(
        11,
        "jog_backward",
        "rising edge starts the unwind maneuver, backward; 0 ends it",
    ),
    Bit::new(
        12,
        "preset_2",
        "preset_accept takes the second diameter preset",
    ),
    Bit::new(
        13,
        "autotune",
        "rising edge starts the auto-tune of autotune_loop; 0 ends it",
    ),
    Bit::new(
        14,
        "web_removed",
        "rising edge: the operator has cut the web and taken it out",
    ),
];

/// The bits of the second command word by name.
pub const COMMAND_2_BITS: &[Bit] = &[
    Bit::new(
        0,
        "rider_up",
        "lifts the rider roll off the shipping roll; its drive coasts",
    ),
    Bit::new(
        1,
        "tension_control_off",
        "opens the tension loop: the unwind pulls what the reference says",
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
    Bit::new(12, "rider_down", "the rider roll lies on the shipping roll"),
    Bit::new(
        13,
        "tension_control",
        "the unwind holds the tension by its closed loop",
    ),
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
        UnwindManeuver: "unwind maneuver",
        AutoTune: "auto-tune",
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
        Contradictory: "contradictory commands: the safer one counts",
        UnwindNotOn: "the unwind drive is not in operation",
        WebInMachine: "the web is threaded: take it out first",
        CauseStands: "the cause of a fault still stands",
    }
}

codes! {
    /// What has gone wrong.
    Fault {
        None: "none",
        HeartbeatLost: "the PLC's heartbeat stands still",
        WebBreak: "web break",
        EncoderUnwind: "no pulses from the unwind's encoder",
        EncoderRearDrum: "no pulses from the rear drum's encoder",
        TripUnwind: "the unwind's drive has tripped",
        TripRearDrum: "the rear drum's drive has tripped",
        TripFrontDrum: "the front drum's drive has tripped",
        TripRiderRoll: "the rider roll's drive has tripped",
        HotUnwind: "the unwind's motor is too hot",
        HotRearDrum: "the rear drum's motor is too hot",
        HotFrontDrum: "the front drum's motor is too hot",
        HotRiderRoll: "the rider roll's motor is too hot",
        BrakeUnwind: "the unwind's brake does not follow its command",
        BrakeRearDrum: "the rear drum's brake does not follow its command",
        BrakeFrontDrum: "the front drum's brake does not follow its command",
        UnwindDeviates: "the unwind's speed does not fit the web's",
        Restarted: "the simulator has restarted by itself",
    }
}

/// Bits of the word of warnings.
pub mod warning {
    /// The unwind's motor is hot.
    pub const HOT_UW: u16 = 1 << 0;
    /// The rear drum's motor is hot.
    pub const HOT_RD: u16 = 1 << 1;
    /// The front drum's motor is hot.
    pub const HOT_FD: u16 = 1 << 2;
    /// The rider roll's motor is hot.
    pub const HOT_RR: u16 = 1 << 3;
    /// The load cells show tension and there is no web.
    pub const LOAD_CELL_ZERO: u16 = 1 << 4;
    /// The unwind's motor has used up its overload.
    pub const OVERLOAD_UW: u16 = 1 << 5;
    /// The rear drum's motor has used up its overload.
    pub const OVERLOAD_RD: u16 = 1 << 6;
    /// The front drum's motor has used up its overload.
    pub const OVERLOAD_FD: u16 = 1 << 7;
    /// The rider roll's motor has used up its overload.
    pub const OVERLOAD_RR: u16 = 1 << 8;
}

/// The bits of the word of warnings by name.
pub const WARNING_BITS: &[Bit] = &[
    Bit::new(0, "hot_uw", "the unwind's motor is hot and will trip"),
    Bit::new(1, "hot_rd", "the rear drum's motor is hot and will trip"),
    Bit::new(2, "hot_fd", "the front drum's motor is hot and will trip"),
    Bit::new(3, "hot_rr", "the rider roll's motor is hot and will trip"),
    Bit::new(
        4,
        "load_cell_zero",
        "the load cells show tension and there is no web",
    ),
    Bit::new(
        5,
        "overload_uw",
        "the unwind's motor has used up its overload: rated torque only",
    ),
    Bit::new(
        6,
        "overload_rd",
        "the rear drum's motor has used up its overload: rated torque only",
    ),
    Bit::new(
        7,
        "overload_fd",
        "the front drum's motor has used up its overload: rated torque only",
    ),
    Bit::new(
        8,
        "overload_rr",
        "the rider roll's motor has used up its overload: rated torque only",
    ),
];

/// What a test puts in: bits of the simulator's own words.
pub mod inject {
    /// The unwind's brake does not close.
    pub const BRAKE_UW_OPEN: u16 = 1 << 0;
    /// The unwind's brake does not open.
    pub const BRAKE_UW_CLOSED: u16 = 1 << 1;
    /// The rear drum's brake does not close.
    pub const BRAKE_RD_OPEN: u16 = 1 << 2;
    /// The rear drum's brake does not open.
    pub const BRAKE_RD_CLOSED: u16 = 1 << 3;
    /// The front drum's brake does not close.
    pub const BRAKE_FD_OPEN: u16 = 1 << 4;
    /// The front drum's brake does not open.
    pub const BRAKE_FD_CLOSED: u16 = 1 << 5;
    /// The parent roll has run out of paper.
    pub const PARENT_ROLL_EXPIRED: u16 = 1 << 6;

    /// The unwind's encoder gives no pulses.
    pub const ENCODER_UW: u16 = 1 << 0;
    /// The rear drum's encoder gives no pulses.
    pub const ENCODER_RD: u16 = 1 << 1;
    /// The load cells show what they last showed.
    pub const LOAD_CELL_STUCK: u16 = 1 << 2;

    /// The unwind's drive has tripped.
    pub const TRIP_UW: u16 = 1 << 0;
    /// The rear drum's drive has tripped.
    pub const TRIP_RD: u16 = 1 << 1;
    /// The front drum's drive has tripped.
    pub const TRIP_FD: u16 = 1 << 2;
    /// The rider roll's drive has tripped.
    pub const TRIP_RR: u16 = 1 << 3;
    /// The unwind's motor is too warm.
    pub const HOT_UW: u16 = 1 << 4;
    /// The rear drum's motor is too warm.
    pub const HOT_RD: u16 = 1 << 5;
    /// The front drum's motor is too warm.
    pub const HOT_FD: u16 = 1 << 6;
    /// The rider roll's motor is too warm.
    pub const HOT_RR: u16 = 1 << 7;
    /// The diameter estimator has no interlocks.
    pub const BARE_ESTIMATOR: u16 = 1 << 8;
    /// The regulators do not compensate inertia.
    pub const NO_INERTIA_COMPENSATION: u16 = 1 << 9;
    /// Nothing passes between PLC and drives.
    pub const BUS_SILENT: u16 = 1 << 10;
}

/// The bits of the word of machine faults by name.
pub const MACHINE_FAULT_BITS: &[Bit] = &[
    Bit::new(0, "brake_uw_open", "the unwind's brake does not close"),
    Bit::new(1, "brake_uw_closed", "the unwind's brake does not open"),
    Bit::new(2, "brake_rd_open", "the rear drum's brake does not close"),
    Bit::new(3, "brake_rd_closed", "the rear drum's brake does not open"),
    Bit::new(4, "brake_fd_open", "the front drum's brake does not close"),
    Bit::new(5, "brake_fd_closed", "the front drum's brake does not open"),
    Bit::new(
        6,
        "parent_roll_expired",
        "the parent roll has run down to its expire radius",
    ),
];

/// The bits of the word of sensor faults by name.
pub const SENSOR_FAULT_BITS: &[Bit] = &[
    Bit::new(0, "encoder_uw", "the unwind's encoder gives no pulses"),
    Bit::new(1, "encoder_rd", "the rear drum's encoder gives no pulses"),
    Bit::new(
        2,
        "load_cell_stuck",
        "the load cells show what they last showed",
    ),
];

/// The bits of the word of drive faults by name.
pub const DRIVE_FAULT_BITS: &[Bit] = &[
    Bit::new(0, "trip_uw", "the unwind's drive trips"),
    Bit::new(1, "trip_rd", "the rear drum's drive trips"),
    Bit::new(2, "trip_fd", "the front drum's drive trips"),
    Bit::new(3, "trip_rr", "the rider roll's drive trips"),
    Bit::new(4, "hot_uw", "the unwind's motor is too warm"),
    Bit::new(5, "hot_rd", "the rear drum's motor is too warm"),
    Bit::new(6, "hot_fd", "the front drum's motor is too warm"),
    Bit::new(7, "hot_rr", "the rider roll's motor is too warm"),
    Bit::new(
        8,
        "bare_estimator",
        "the diameter estimator has no interlocks",
    ),
    Bit::new(
        9,
        "no_inertia_compensation",
        "the regulators do not compensate inertia",
    ),
    Bit::new(
        10,
        "bus_silent",
        "nothing passes between the PLC and the drives",
    ),
];

/// The bits of the word on the winding by name.
pub const WINDING_BITS: &[Bit] = &[
    Bit::new(0, "slides_rd", "the rear drum slides on the shipping roll"),
    Bit::new(1, "slides_fd", "the front drum slides on the shipping roll"),
    Bit::new(2, "slides_rr", "the rider roll slides on the shipping roll"),
    Bit::new(
        3,
        "burst",
        "the wound-on tension was above the web's strength",
    ),
];

/// The loops that auto-tune knows, by their code.
pub const LOOPS: &[&str] = &["drum speed", "unwind speed", "tension"];
