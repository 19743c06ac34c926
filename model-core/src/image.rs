//! The process image: every signal between the winder PLC and the simulator, defined once.
//!
//! Not here: how a signal travels (that is a link's) and what it does (that is the logic's). Modbus registers,
//! the HMI's interface and the signal list all come from [`SIGNALS`].
//!
//! Two blocks of 16-bit words, commands from the PLC and feedback to it, without holes. The commands of a winder PLC
//! come first; behind them stand the faults that a test puts in, out of reach of a PLC that writes its own words, behind
//! those the PLC's words that were added since, then the operator's desk ([`crate::desk`]), and then what else a test
//! puts in. In all words but the first 20, 0 changes nothing, so that a PLC
//! may write the whole block as well as its two parts. A block is only ever added to: an address keeps its meaning. A value is a scaled
//! integer; a 32-bit counter takes two words, high word first. Bit `b` of word `w` is also the single bit
//! `16·w + b` of the block, so that a PLC can use coils or words as it likes.

use crate::desk;
use crate::exchange::{TuneAbort, TuneStep};
use crate::link_words;
use crate::logic;
use crate::machine::Machine;
use crate::profidrive;
use crate::real::Real;
use crate::restart::Restart;
pub use crate::signal::{Bit, Direction, Kind, Section, Signal};

const fn lower<const N: usize>(name: &str) -> [u8; N] {
    let (mut out, bytes, mut i) = ([0; N], name.as_bytes(), 0);
    while i < N {
        out[i] = bytes[i].to_ascii_lowercase();
        i += 1;
    }
    out
}

/// Writes the constants and their list from one table.
macro_rules! signals {
    ($($id:ident: $dir:ident $word:literal, $section:ident, $kind:expr, $unit:literal, $counts:literal, $low:literal ..= $high:literal, $text:literal;)*) => {
        $(
            #[doc = $text]
            pub const $id: Signal = {
                const NAME: [u8; stringify!($id).len()] = lower(stringify!($id));
                Signal {
                    name: match core::str::from_utf8(&NAME) { Ok(name) => name, Err(_) => "" },
                    direction: Direction::$dir,
                    section: Section::$section,
                    kind: $kind,
                    unit: $unit,
                    counts: $counts,
                    limits: ($low, $high),
                    word: $word,
                    description: $text,
                }
            };
        )*
        /// Every signal, in the order of its words, commands first.
        pub const SIGNALS: &[Signal] = &[$($id),*];
    };
}

use Kind::{Bits, Code, I16, U16, U32};

signals! {
    // what the PLC commands
    HEARTBEAT_PLC:    Command 0,  Winder, U16, "", 1.0, 0.0 ..= 65535.0, "Counts up while the PLC lives; when it stands still the drives stop (drives on) after the heartbeat time";
    WINDER_COMMAND:   Command 1,  Winder, Bits(logic::COMMAND_BITS), "", 1.0, 0.0 ..= 65535.0, "Commands to the winder's drive logic";
    STW1_UW:          Command 2,  Unwind, Bits(profidrive::STW1_BITS), "", 1.0, 0.0 ..= 65535.0, "PROFIdrive control word 1 of the unwind";
    STW1_RD:          Command 3,  RearDrum, Bits(profidrive::STW1_BITS), "", 1.0, 0.0 ..= 65535.0, "PROFIdrive control word 1 of the rear drum";
    STW1_FD:          Command 4,  FrontDrum, Bits(profidrive::STW1_BITS), "", 1.0, 0.0 ..= 65535.0, "PROFIdrive control word 1 of the front drum";
    STW1_RR:          Command 5,  RiderRoll, Bits(profidrive::STW1_BITS), "", 1.0, 0.0 ..= 65535.0, "PROFIdrive control word 1 of the rider roll";
    V_SET:            Command 6,  Winder, U16, "m/min", 10.0, 0.0 ..= 2500.0, "Web speed to run at";
    V_THREAD_SET:     Command 7,  Winder, U16, "m/min", 10.0, 5.0 ..= 60.0, "Web speed to thread at";
    TENSION_SET:      Command 8,  Winder, U16, "N/m", 1.0, 50.0 ..= 1000.0, "Web tension per width in run";
    STALL_SET:        Command 9,  Winder, U16, "N/m", 1.0, 20.0 ..= 500.0, "Web tension per width at standstill and in thread";
    ACCEL_SET:        Command 10, Winder, U16, "m/s²", 1000.0, 0.05 ..= 1.0, "Acceleration and normal deceleration";
    JERK_SET:         Command 11, Winder, U16, "m/s³", 1000.0, 0.05 ..= 2.0, "Rate of change of the acceleration";
    D_PRESET_UW:      Command 12, Unwind, U16, "mm", 10.0, 100.0 ..= 4000.0, "Parent-roll diameter that the drive takes over with preset_accept";
    TORQUE_LIMIT_UW:  Command 13, Unwind, U16, "%", 10.0, 0.0 ..= 150.0, "Torque limit of the unwind motor, of rated torque";
    TORQUE_LIMIT_DRUMS: Command 14, RearDrum, U16, "%", 10.0, 0.0 ..= 150.0, "Torque limit of both drum motors, of rated torque";
    FRONT_SHARE_TRIM: Command 15, FrontDrum, I16, "%", 10.0, -20.0 ..= 20.0, "Added to the drive's own table of the front drum's share of the drum torque";

    D_PRESET_2_UW:    Command 16, Unwind, U16, "mm", 10.0, 100.0 ..= 4000.0, "Second parent-roll diameter, taken over with preset_accept while preset_2 is set";
    V_JOG_SET:        Command 17, Unwind, U16, "m/min", 10.0, 10.0 ..= 25.0, "Surface speed of the parent roll in the unwind maneuver";
    AUTOTUNE_LOOP:    Command 18, Winder, Code(logic::LOOPS), "", 1.0, 0.0 ..= 2.0, "Loop that autotune tunes";
    HEARTBEAT_TIME:   Command 19, Winder, U16, "ms", 1.0, 100.0 ..= 10000.0, "The PLC's heartbeat may stand still for this long";

    // what a test puts in: beyond the words of a winder PLC, so that its writes do not touch it; 0 is always sound
    FAULT_MACHINE:    Command 20, Simulator, Bits(logic::MACHINE_FAULT_BITS), "", 1.0, 0.0 ..= 65535.0, "Faults of the machine";
    FAULT_WEB_BREAK:  Command 21, Simulator, U16, "", 1.0, 0.0 ..= 16.0, "Breaks the web in this span, counted from the unwind; 0 leaves it whole";
    FAULT_DRUM_WEAR:  Command 22, Simulator, U16, "%", 10.0, 0.0 ..= 100.0, "Friction that the drums have lost; the rolls of the windup may slip from then on";
    FAULT_ECCENTRICITY_UW: Command 23, Simulator, U16, "mm", 10.0, 0.0 ..= 20.0, "Eccentricity of the parent roll beside the machine's own";
    FAULT_SENSORS:    Command 24, Simulator, Bits(logic::SENSOR_FAULT_BITS), "", 1.0, 0.0 ..= 65535.0, "Faults of sensors";
    FAULT_WRAP_ANGLE: Command 25, Simulator, I16, "°", 10.0, -20.0 ..= 20.0, "Error of the wrap angle on the load cells";
    FAULT_LOAD_CELL_DRIFT: Command 26, Simulator, I16, "N/m/min", 1.0, -1000.0 ..= 1000.0, "The load cells' zero wanders off, per width and minute; 0 puts it back";
    FAULT_DRIVES:     Command 27, Simulator, Bits(logic::DRIVE_FAULT_BITS), "", 1.0, 0.0 ..= 65535.0, "Faults of the drives";
    FAULT_PRESET:     Command 28, Simulator, I16, "%", 10.0, -10.0 ..= 10.0, "Error of a diameter preset when the drive takes it over";
    BUS_DELAY:        Command 29, Simulator, U16, "", 1.0, 1.0 ..= 10.0, "Drive cycles from a command to its effect, and from a feedback to its sight";

    // more of the PLC's, where no address moves for them; 0 in all of them is what a PLC without them gets
    WINDER_COMMAND_2: Command 30, Winder, Bits(logic::COMMAND_2_BITS), "", 1.0, 0.0 ..= 65535.0, "More commands to the winder's drive logic";
    RIDER_LOAD_SET:   Command 31, RiderRoll, U16, "%", 10.0, 0.0 ..= 200.0, "Load of the rider roll, of the machine's table; 0 is the table's own, as 100 is";

    // what a winder PLC shows its operator: nothing in the drives hears it
    PLC_STATE:        Command 32, Winder, Code(desk::STATES), "", 1.0, 0.0 ..= 65535.0, "What the PLC's sequence is doing, for its operator";
    PLC_ALARMS:       Command 33, Winder, Bits(desk::ALARM_BITS), "", 1.0, 0.0 ..= 65535.0, "Alarms that the PLC shows its operator";
    PLC_SETS:         Command 34, Winder, U16, "", 1.0, 0.0 ..= 65535.0, "Sets that the PLC has counted";
    PLC_LENGTH:       Command 35, Winder, U32, "m", 100.0, 0.0 ..= 42949672.0, "Length of the set, as the PLC counts it";

    // the operator's desk, wired to the winder PLC: what it asks for, which the PLC reads here
    OPERATOR_REQUEST: Command 37, Simulator, Bits(desk::REQUEST_BITS), "", 1.0, 0.0 ..= 65535.0, "Push-buttons of the operator's desk";
    OPERATOR_V_SET:   Command 38, Simulator, U16, "m/min", 10.0, 0.0 ..= 6553.5, "Web speed that the operator asks for";
    OPERATOR_TENSION_SET: Command 39, Simulator, U16, "N/m", 1.0, 0.0 ..= 65535.0, "Web tension per width that the operator asks for, at the core";
    OPERATOR_TAPER:   Command 40, Simulator, U16, "%", 10.0, 0.0 ..= 100.0, "Tension taken off from the core to the set's diameter, in proportion to the diameter";
    OPERATOR_LENGTH_SET: Command 41, Simulator, U16, "m", 1.0, 0.0 ..= 65535.0, "Length of the set; 0 does not stop at a length";
    OPERATOR_DIAMETER_SET: Command 42, Simulator, U16, "mm", 10.0, 0.0 ..= 6553.5, "Diameter of the set; 0 does not stop at a diameter";
    OPERATOR_PARENT:  Command 43, Simulator, U16, "mm", 10.0, 0.0 ..= 6553.5, "Diameter of the parent roll, as the operator has measured it";
    OPERATOR_PARENT_END: Command 44, Simulator, U16, "mm", 10.0, 0.0 ..= 6553.5, "Diameter at which the parent roll is used up; 0 is a diameter of the PLC's own";
    OPERATOR_FORCE:   Command 45, Simulator, I16, "%", 10.0, -20.0 ..= 20.0, "Winding force at the set's diameter: trim of the front drum's share, in proportion to the diameter";
    OPERATOR_RIDER:   Command 46, Simulator, U16, "%", 10.0, 0.0 ..= 200.0, "Rider load at the set's diameter, of the machine's table, in proportion to the diameter from 100 at the core; 0 is the table's own";

    // more that a test puts in
    PARENT_ROLL_PUT_IN: Command 47, Simulator, U16, "mm", 10.0, 0.0 ..= 6553.5, "Diameter of the parent roll that is put in next; 0 is a full one";
    PULSES_AHEAD:     Command 48, Simulator, U16, "", 1.0, 0.0 ..= 65535.0, "Added to the high word of pulses_rd, so that it wraps soon";
    RESPONSE_DELAY:   Command 49, Simulator, U16, "ms", 1.0, 0.0 ..= 1000.0, "A request over Modbus waits this long before it is done and answered";

    // what the drive system answers
    HEARTBEAT:        Feedback 0,  Winder, U16, "", 1.0, 0.0 ..= 65535.0, "Counts up by one each drive cycle of 10 ms";
    WINDER_STATUS:    Feedback 1,  Winder, Bits(logic::STATUS_BITS), "", 1.0, 0.0 ..= 65535.0, "State of the winder's drive logic";
    MODE:             Feedback 2,  Winder, Code(logic::Mode::NAMES), "", 1.0, 0.0 ..= 65535.0, "Operating mode";
    REFUSAL:          Feedback 3,  Winder, Code(logic::Refusal::NAMES), "", 1.0, 0.0 ..= 65535.0, "Why the last command was refused; 0 when the last one was taken";
    FAULT:            Feedback 4,  Winder, Code(logic::Fault::NAMES), "", 1.0, 0.0 ..= 65535.0, "First fault that is latched; cleared by an acknowledge";
    ZSW1_UW:          Feedback 5,  Unwind, Bits(profidrive::ZSW1_BITS), "", 1.0, 0.0 ..= 65535.0, "PROFIdrive status word 1 of the unwind";
    ZSW1_RD:          Feedback 6,  RearDrum, Bits(profidrive::ZSW1_BITS), "", 1.0, 0.0 ..= 65535.0, "PROFIdrive status word 1 of the rear drum";
    ZSW1_FD:          Feedback 7,  FrontDrum, Bits(profidrive::ZSW1_BITS), "", 1.0, 0.0 ..= 65535.0, "PROFIdrive status word 1 of the front drum";
    ZSW1_RR:          Feedback 8,  RiderRoll, Bits(profidrive::ZSW1_BITS), "", 1.0, 0.0 ..= 65535.0, "PROFIdrive status word 1 of the rider roll";
    V_WEB:            Feedback 9,  Winder, I16, "m/min", 10.0, -3276.7 ..= 3276.7, "Web speed, from the rear drum's encoder";
    V_REF:            Feedback 10, Winder, I16, "m/min", 10.0, -3276.7 ..= 3276.7, "Web speed reference after the ramp";
    A_REF:            Feedback 11, Winder, I16, "m/s²", 1000.0, -32.767 ..= 32.767, "Acceleration of the speed reference";
    TENSION:          Feedback 12, Winder, U16, "N/m", 1.0, 0.0 ..= 65535.0, "Measured web tension per width (load cells on a slitter-table roll)";
    TENSION_REF:      Feedback 13, Winder, U16, "N/m", 1.0, 0.0 ..= 65535.0, "Web tension reference per width after its ramp";
    N_UW:             Feedback 14, Unwind, I16, "1/min", 10.0, -3276.7 ..= 3276.7, "Speed of the parent roll";
    N_RD:             Feedback 15, RearDrum, I16, "1/min", 10.0, -3276.7 ..= 3276.7, "Speed of the rear drum";
    N_FD:             Feedback 16, FrontDrum, I16, "1/min", 10.0, -3276.7 ..= 3276.7, "Speed of the front drum";
    N_RR:             Feedback 17, RiderRoll, I16, "1/min", 10.0, -3276.7 ..= 3276.7, "Speed of the rider roll";
    TORQUE_UW:        Feedback 18, Unwind, I16, "%", 10.0, -3276.7 ..= 3276.7, "Motor torque of the unwind, of rated torque; negative holds the web back";
    TORQUE_RD:        Feedback 19, RearDrum, I16, "%", 10.0, -3276.7 ..= 3276.7, "Motor torque of the rear drum, of rated torque";
    TORQUE_FD:        Feedback 20, FrontDrum, I16, "%", 10.0, -3276.7 ..= 3276.7, "Motor torque of the front drum, of rated torque";
    TORQUE_RR:        Feedback 21, RiderRoll, I16, "%", 10.0, -3276.7 ..= 3276.7, "Motor torque of the rider roll, of rated torque";
    POWER_UW:         Feedback 22, Unwind, I16, "kW", 10.0, -3276.7 ..= 3276.7, "Shaft power of the unwind motor; negative is fed back to the line";
    POWER_RD:         Feedback 23, RearDrum, I16, "kW", 10.0, -3276.7 ..= 3276.7, "Shaft power of the rear drum motor";
    POWER_FD:         Feedback 24, FrontDrum, I16, "kW", 10.0, -3276.7 ..= 3276.7, "Shaft power of the front drum motor";
    POWER_RR:         Feedback 25, RiderRoll, I16, "kW", 10.0, -3276.7 ..= 3276.7, "Shaft power of the rider roll motor";
    D_UW:             Feedback 26, Unwind, U16, "mm", 10.0, 0.0 ..= 6553.5, "Parent-roll diameter as the drive estimates it";
    D_WU:             Feedback 27, Winder, U16, "mm", 10.0, 0.0 ..= 6553.5, "Shipping-roll diameter, from the position of the rider-roll beam";
    LENGTH_WU:        Feedback 28, Winder, U32, "m", 100.0, 0.0 ..= 42949672.0, "Length on the shipping roll, from the rear drum's encoder";
    PULSES_RD:        Feedback 30, RearDrum, U32, "", 1.0, 0.0 ..= 4294967295.0, "Encoder pulses of the rear drum since power-up; wraps";

    // what the simulator tells of itself
    PLANT_TICKS:      Feedback 32, Simulator, U32, "", 1.0, 0.0 ..= 4294967295.0, "Plant steps of 4 ms since power-up; wraps";
    TRAJECTORY:       Feedback 34, Simulator, U32, "", 1.0, 0.0 ..= 4294967295.0, "Hash over every plant state of every step: equal runs have equal hashes";
    PLANT_OVERRUNS:   Feedback 36, Simulator, U16, "", 1.0, 0.0 ..= 65535.0, "Plant activations not done before the next was due";
    PLANT_TIME_MAX:   Feedback 37, Simulator, U16, "µs", 1.0, 0.0 ..= 65535.0, "Longest plant activation";
    PLANT_JITTER_MAX: Feedback 38, Simulator, U16, "µs", 1.0, 0.0 ..= 65535.0, "Latest start of a plant activation";
    DRIVE_OVERRUNS:   Feedback 39, Simulator, U16, "", 1.0, 0.0 ..= 65535.0, "Regulator activations not done before the next was due";
    DRIVE_TIME_MAX:   Feedback 40, Simulator, U16, "µs", 1.0, 0.0 ..= 65535.0, "Longest regulator activation";
    DRIVE_JITTER_MAX: Feedback 41, Simulator, U16, "µs", 1.0, 0.0 ..= 65535.0, "Latest start of a regulator activation";
    LOGIC_OVERRUNS:   Feedback 42, Simulator, U16, "", 1.0, 0.0 ..= 65535.0, "Drive cycles in which the drive logic did not get its turn";

    // more of the drive system
    WARNINGS:         Feedback 43, Winder, Bits(logic::WARNING_BITS), "", 1.0, 0.0 ..= 65535.0, "Warnings that stand";
    BROKEN_SPAN:      Feedback 44, Simulator, U16, "", 1.0, 0.0 ..= 16.0, "Span in which the web has parted, counted from the unwind; 0 while it is whole";
    WINDING:          Feedback 45, Simulator, Bits(logic::WINDING_BITS), "", 1.0, 0.0 ..= 65535.0, "How the shipping roll is being wound, where slip is computed";
    WOUND_ON_TENSION: Feedback 46, Simulator, U16, "N/m", 1.0, 0.0 ..= 65535.0, "Wound-on tension per width, where slip or compression is computed";
    AUTOTUNE_STEP:    Feedback 47, Winder, Code(&TuneStep::TEXTS), "", 1.0, 0.0 ..= 65535.0, "Step of auto-tune";
    AUTOTUNE_PROGRESS: Feedback 48, Winder, U16, "%", 10.0, 0.0 ..= 100.0, "How far auto-tune is";
    AUTOTUNE_ABORT:   Feedback 49, Winder, Code(&TuneAbort::TEXTS), "", 1.0, 0.0 ..= 65535.0, "Why auto-tune ended without a result";
    AUTOTUNE_INERTIA: Feedback 50, Winder, U32, "kg·m²", 1000.0, 0.0 ..= 4.0e6, "Inertia that auto-tune has found, at the shaft of the unwind or the rear drum";
    AUTOTUNE_FRICTION: Feedback 52, Winder, U32, "N·m·s/rad", 1000.0, 0.0 ..= 4.0e6, "Friction that auto-tune has found, at the same shaft";
    AUTOTUNE_STIFFNESS: Feedback 54, Winder, U32, "N/m", 1.0, 0.0 ..= 4.0e9, "Stiffness of the web path that auto-tune has found";
    AUTOTUNE_GAIN_OLD: Feedback 56, Winder, U32, "", 1000.0, 0.0 ..= 4.0e6, "Proportional gain before auto-tune: N·m·s/rad of a speed loop, N/N of the tension loop";
    AUTOTUNE_GAIN_NEW: Feedback 58, Winder, U32, "", 1000.0, 0.0 ..= 4.0e6, "Proportional gain that auto-tune has found";
    AUTOTUNE_TIME_OLD: Feedback 60, Winder, U16, "s", 1000.0, 0.0 ..= 65.0, "Integral action time before auto-tune";
    AUTOTUNE_TIME_NEW: Feedback 61, Winder, U16, "s", 1000.0, 0.0 ..= 65.0, "Integral action time that auto-tune has found";
    RIDER_LOAD:       Feedback 62, RiderRoll, U16, "N/m", 1.0, 0.0 ..= 65535.0, "Load of the rider roll per width, as it is set";
    NIP_LOAD_RD:      Feedback 63, Simulator, U16, "N/m", 1.0, 0.0 ..= 65535.0, "Load of the rear drum's nip per width, where slip or compression is computed";
    NIP_LOAD_FD:      Feedback 64, Simulator, U16, "N/m", 1.0, 0.0 ..= 65535.0, "Load of the front drum's nip per width, where slip or compression is computed";

    // what the link tells of itself, after each request
    LINK_STATUS:      Feedback 65, Simulator, Bits(link_words::LINK_STATUS_BITS), "", 1.0, 0.0 ..= 65535.0, "State of the link";
    LIMITED_REGISTER: Feedback 66, Simulator, U16, "", 1.0, 0.0 ..= 65535.0, "First holding register that was written outside its limits, counted from 1; 0 when none is";
    LINK_CLIENTS:     Feedback 67, Simulator, U16, "", 1.0, 0.0 ..= 65535.0, "Clients that are connected";
    LINK_REQUESTS:    Feedback 68, Simulator, U32, "", 1.0, 0.0 ..= 4294967295.0, "Requests since power-up; wraps";
    LINK_EXCEPTIONS:  Feedback 70, Simulator, U32, "", 1.0, 0.0 ..= 4294967295.0, "Requests since power-up that were refused with an exception; wraps";
    LINK_WRITE_AGE:   Feedback 72, Simulator, U16, "ms", 1.0, 0.0 ..= 65535.0, "Time since the winder's commands were last written; 65535 when it is longer or they never were";
    LINE_ERRORS:      Feedback 73, Simulator, U16, "", 1.0, 0.0 ..= 65535.0, "Frames of the serial line since power-up that were not whole; stays at its largest";
    POLLS_5_MS:       Feedback 74, Simulator, U32, "", 1.0, 0.0 ..= 4294967295.0, "Polls up to 5 ms after the client's last one; wraps, as all polls do";
    POLLS_10_MS:      Feedback 76, Simulator, U32, "", 1.0, 0.0 ..= 4294967295.0, "Polls after 5 to 10 ms";
    POLLS_20_MS:      Feedback 78, Simulator, U32, "", 1.0, 0.0 ..= 4294967295.0, "Polls after 10 to 20 ms";
    POLLS_50_MS:      Feedback 80, Simulator, U32, "", 1.0, 0.0 ..= 4294967295.0, "Polls after 20 to 50 ms";
    POLLS_100_MS:     Feedback 82, Simulator, U32, "", 1.0, 0.0 ..= 4294967295.0, "Polls after 50 to 100 ms";
    POLLS_200_MS:     Feedback 84, Simulator, U32, "", 1.0, 0.0 ..= 4294967295.0, "Polls after 100 to 200 ms";
    POLLS_500_MS:     Feedback 86, Simulator, U32, "", 1.0, 0.0 ..= 4294967295.0, "Polls after 200 to 500 ms";
    POLLS_LONGER:     Feedback 88, Simulator, U32, "", 1.0, 0.0 ..= 4294967295.0, "Polls after more than 500 ms";

    // more of what the simulator tells of itself
    PLANT_TIME:       Feedback 90, Simulator, U16, "µs", 10.0, 0.0 ..= 6553.5, "Last plant activation";
    DRIVE_TIME:       Feedback 91, Simulator, U16, "µs", 10.0, 0.0 ..= 6553.5, "Last regulator activation";
    LOGIC_TIME:       Feedback 92, Simulator, U16, "µs", 10.0, 0.0 ..= 6553.5, "Last logic activation";
    LOGIC_TIME_MAX:   Feedback 93, Simulator, U16, "µs", 1.0, 0.0 ..= 65535.0, "Longest logic activation";
    LOGIC_JITTER_MAX: Feedback 94, Simulator, U16, "µs", 1.0, 0.0 ..= 65535.0, "Latest start of a logic activation after its drive cycle was due";
    RESTART:          Feedback 95, Simulator, Code(&Restart::TEXTS), "", 1.0, 0.0 ..= 65535.0, "Why the simulator has started";
    RESTARTS:         Feedback 96, Simulator, U16, "", 1.0, 0.0 ..= 65535.0, "Starts by itself since power came";
}

/// Control word 1 of every section.
pub const STW1: [&Signal; 4] = [&STW1_UW, &STW1_RD, &STW1_FD, &STW1_RR];
/// Status word 1 of every section.
pub const ZSW1: [&Signal; 4] = [&ZSW1_UW, &ZSW1_RD, &ZSW1_FD, &ZSW1_RR];

/// Jog speed at power-up, m/min.
const JOG_M_MIN: f32 = 15.0;
/// Heartbeat time at power-up, ms: a dozen cycles of a slow PLC.
const HEARTBEAT_MS: f32 = 500.0;

/// Words in the block of commands.
pub const COMMAND_WORDS: usize = block_words(Direction::Command);
/// Words at its beginning that are a winder PLC's; the simulator's own follow.
pub const PLC_COMMAND_WORDS: usize = FAULT_MACHINE.word as usize;
/// Words in the block of feedback.
pub const FEEDBACK_WORDS: usize = block_words(Direction::Feedback);

const fn block_words(direction: Direction) -> usize {
    let (mut words, mut i) = (0, 0);
    while i < SIGNALS.len() {
        let s = &SIGNALS[i];
        let end = s.word + s.kind.words();
        if s.direction as u8 == direction as u8 && end > words {
            words = end;
        }
        i += 1;
    }
    words as usize
}

/// One block of words; always a whole, consistent set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block<const N: usize> {
    /// The words as they travel.
    pub words: [u16; N],
}

/// What the PLC commands.
pub type Commands = Block<COMMAND_WORDS>;
/// What the simulator answers.
pub type Feedback = Block<FEEDBACK_WORDS>;

impl<const N: usize> Default for Block<N> {
    fn default() -> Self {
        Self { words: [0; N] }
    }
}

impl<const N: usize> Block<N> {
    /// The word of a signal as it travels.
    pub fn word(&self, signal: &Signal) -> u16 {
        self.words[usize::from(signal.word)]
    }

    /// Both words of a 32-bit signal.
    pub fn double(&self, signal: &Signal) -> u32 {
        let w = usize::from(signal.word);
        u32::from(self.words[w]) << 16 | u32::from(self.words[w + 1])
    }

    /// The value in the signal's unit, within its limits. Inlined, so that what is known of the signal costs nothing.
    #[inline(always)]
    pub fn get<R: Real>(&self, signal: &Signal) -> R {
        let raw = match signal.kind {
            Kind::I16 => f32::from(self.word(signal) as i16),
            Kind::U32 => self.double(signal) as f32,
            _ => f32::from(self.word(signal)),
        };
        let (low, high) = signal.limits;
        R::of_f32((raw / signal.counts).clamp(low, high))
    }

    /// Sets the word as it travels.
    pub fn set_word(&mut self, signal: &Signal, word: u16) {
        self.words[usize::from(signal.word)] = word;
    }

    /// Sets both words of a 32-bit signal.
    pub fn set_double(&mut self, signal: &Signal, value: u32) {
        let w = usize::from(signal.word);
        self.words[w] = (value >> 16) as u16;
        self.words[w + 1] = value as u16;
    }

    /// Sets the value, in the signal's unit, to the nearest count within its limits.
    ///
    /// Words are computed in `f32`, which holds every count of them; the counts of a 32-bit signal need `f64`.
    #[inline(always)]
    pub fn set<R: Real>(&mut self, signal: &Signal, value: R) {
        let (low, high) = signal.limits;
        // half away from zero; the casts saturate, and take NaN to 0
        match signal.kind {
            Kind::U32 => {
                let value = value.to_f64().clamp(f64::from(low), f64::from(high));
                self.set_double(signal, (value * f64::from(signal.counts) + 0.5) as u32);
            }
            Kind::I16 => {
                let counts = value.to_f32().clamp(low, high) * signal.counts;
                let half = if counts < 0.0 { -0.5 } else { 0.5 };
                self.set_word(signal, (counts + half) as i16 as u16);
            }
            _ => {
                let counts = value.to_f32().clamp(low, high) * signal.counts;
                self.set_word(signal, (counts + 0.5) as u16);
            }
        }
    }
}

impl Commands {
    /// The block at power-up: everything off, the set-points the machine's own.
    pub fn of(machine: &Machine) -> Self {
        let mut block = Self::default();
        let o = &machine.operation;
        let per_minute = 60.0;
        block.set(&V_SET, o.run_speed_m_s * per_minute);
        block.set(&V_THREAD_SET, o.thread_speed_m_s * per_minute);
        block.set(&TENSION_SET, o.tension_n_m);
        block.set(&STALL_SET, o.tension_n_m * o.stall_share);
        block.set(&ACCEL_SET, o.acceleration_m_s2);
        block.set(&JERK_SET, o.jerk_m_s3);
        block.set(&D_PRESET_UW, 2.0e3 * machine.parent_roll.full_radius_m);
        block.set(&D_PRESET_2_UW, 2.0e3 * machine.parent_roll.full_radius_m);
        block.set(&V_JOG_SET, JOG_M_MIN);
        block.set(&HEARTBEAT_TIME, HEARTBEAT_MS);
        block.set(&BUS_DELAY, 1.0);
        block.set(&TORQUE_LIMIT_UW, 150.0);
        block.set(&TORQUE_LIMIT_DRUMS, 150.0);
        block
    }
}

/// Both blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Image {
    /// Written by the PLC.
    pub commands: Commands,
    /// Written by the simulator.
    pub feedback: Feedback,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_have_neither_holes_nor_overlaps() {
        for direction in [Direction::Command, Direction::Feedback] {
            let mut next = 0;
            for s in SIGNALS.iter().filter(|s| s.direction == direction) {
                assert_eq!(s.word, next, "{}", s.name);
                next += s.kind.words();
            }
        }
    }

    /// A winder PLC writes the first words, and those behind the simulator's.
    #[test]
    fn the_words_of_the_plc_stand_before_and_behind_the_simulator_s() {
        for s in SIGNALS.iter().filter(|s| s.direction == Direction::Command) {
            let of_simulator = (FAULT_MACHINE.word..=BUS_DELAY.word).contains(&s.word)
                || s.word >= OPERATOR_REQUEST.word;
            assert_eq!(s.section == Section::Simulator, of_simulator, "{}", s.name);
        }
        assert_eq!(PLC_COMMAND_WORDS, usize::from(FAULT_MACHINE.word));
    }

    #[test]
    fn names_are_unique() {
        for (i, s) in SIGNALS.iter().enumerate() {
            assert!(SIGNALS[..i].iter().all(|t| t.name != s.name), "{}", s.name);
        }
    }

    #[test]
    fn values_round_to_the_nearest_count_and_saturate() {
        let mut f = Feedback::default();
        for (value, word) in [
            (12.34, 123),
            (-12.36, -124i16 as u16),
            (1e9, 32767),
            (-1e9, -32767i16 as u16),
        ] {
            f.set(&V_WEB, value);
            assert_eq!(f.word(&V_WEB), word, "{value}");
        }
        f.set(&LENGTH_WU, 18_758.93);
        assert_eq!(f.double(&LENGTH_WU), 1_875_893);
        f.set(&V_WEB, f32::NAN);
        assert_eq!(f.word(&V_WEB), 0);
    }
}
