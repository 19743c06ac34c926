//! Control and status words of PROFIdrive, speed-control mode.
//!
//! Not here: the words of positioning mode. Bits 0–10 only; all but the two of jogging also match the ABB Drives
//! profile. Source: PROFIdrive profile 4.2 (PNO 3.172), STW1, ZSW1 and the general state machine.

use crate::signal::Bit;

/// Control word 1, from the PLC to a drive.
pub mod stw1 {
    /// 1 = ON, 0 = OFF1: ramp down and switch off.
    pub const ON: u16 = 1 << 0;
    /// 0 = OFF2: coast stop.
    pub const NO_COAST: u16 = 1 << 1;
    /// 0 = OFF3: quick stop.
    pub const NO_QUICK_STOP: u16 = 1 << 2;
    /// Enable operation.
    pub const ENABLE_OPERATION: u16 = 1 << 3;
    /// Enable the ramp generator; 0 takes the speed reference to zero.
    pub const ENABLE_RAMP: u16 = 1 << 4;
    /// 0 freezes the ramp generator.
    pub const UNFREEZE_RAMP: u16 = 1 << 5;
    /// Enable the set-point; 0 ramps to zero.
    pub const ENABLE_SETPOINT: u16 = 1 << 6;
    /// Rising edge acknowledges faults.
    pub const ACKNOWLEDGE: u16 = 1 << 7;
    /// Jog 1; counts while ramp generator and set-point are not enabled (bits 4 to 6 are 0).
    pub const JOG_1: u16 = 1 << 8;
    /// Jog 2, likewise.
    pub const JOG_2: u16 = 1 << 9;
    /// The PLC has control; 0 keeps the last valid word.
    pub const CONTROL_BY_PLC: u16 = 1 << 10;
    /// Everything enabled, not on: the first word of the start sequence.
    pub const READY: u16 = 0x047e;
    /// On: the second word of the start sequence.
    pub const RUN: u16 = READY | ON;
}

/// Status word 1, from a drive to the PLC.
pub mod zsw1 {
    /// Ready to switch on.
    pub const READY_TO_SWITCH_ON: u16 = 1 << 0;
    /// Ready to operate: switched on.
    pub const READY_TO_OPERATE: u16 = 1 << 1;
    /// Operation enabled: the drive follows its set-point.
    pub const OPERATION_ENABLED: u16 = 1 << 2;
    /// A fault is present.
    pub const FAULT: u16 = 1 << 3;
    /// 0 = OFF2 is active.
    pub const NO_COAST: u16 = 1 << 4;
    /// 0 = OFF3 is active.
    pub const NO_QUICK_STOP: u16 = 1 << 5;
    /// Switching on is inhibited until ON has been taken back.
    pub const SWITCHING_ON_INHIBITED: u16 = 1 << 6;
    /// A warning is present.
    pub const WARNING: u16 = 1 << 7;
    /// The speed error is within its tolerance.
    pub const SPEED_WITHIN_TOLERANCE: u16 = 1 << 8;
    /// The PLC is asked to take control.
    pub const CONTROL_REQUESTED: u16 = 1 << 9;
    /// The speed set-point is reached.
    pub const SETPOINT_REACHED: u16 = 1 << 10;
}

/// The bits of control word 1 by name.
pub const STW1_BITS: &[Bit] = &[
    Bit::new(0, "on", "ON; 0 = OFF1, ramp down and switch off"),
    Bit::new(1, "no_coast", "0 = OFF2, coast stop"),
    Bit::new(2, "no_quick_stop", "0 = OFF3, quick stop"),
    Bit::new(3, "enable_operation", "enable operation"),
    Bit::new(4, "enable_ramp", "enable the ramp generator"),
    Bit::new(5, "unfreeze_ramp", "0 freezes the ramp generator"),
    Bit::new(6, "enable_setpoint", "enable the set-point"),
    Bit::new(7, "acknowledge", "rising edge acknowledges faults"),
    Bit::new(8, "jog_1", "jog 1 while bits 4 to 6 are 0: unwind forward"),
    Bit::new(9, "jog_2", "jog 2 while bits 4 to 6 are 0: unwind backward"),
    Bit::new(10, "control_by_plc", "the PLC has control"),
];

/// The bits of status word 1 by name.
pub const ZSW1_BITS: &[Bit] = &[
    Bit::new(0, "ready_to_switch_on", "ready to switch on"),
    Bit::new(1, "ready_to_operate", "switched on"),
    Bit::new(2, "operation_enabled", "the drive follows its set-point"),
    Bit::new(3, "fault", "a fault is present"),
    Bit::new(4, "no_coast", "0 = OFF2 is active"),
    Bit::new(5, "no_quick_stop", "0 = OFF3 is active"),
    Bit::new(6, "switching_on_inhibited", "ON must be taken back first"),
    Bit::new(7, "warning", "a warning is present"),
    Bit::new(8, "speed_within_tolerance", "speed error within tolerance"),
    Bit::new(9, "control_requested", "the PLC is asked to take control"),
    Bit::new(10, "setpoint_reached", "speed set-point reached"),
];
