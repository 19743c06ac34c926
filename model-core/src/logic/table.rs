//! Which command leads from which mode to which: the one table that the logic executes.
//!
//! Not here: how a command is recognised. The logic looks for causes in the order of the table, strongest first; the
//! first one that changes the mode ends the search, so that a cycle changes the mode once at most.
//!
//! [`TRANSITIONS`] has a row for each cause and a column for each mode. What a request needs beside the right mode
//! stands in [`Cause::needs`] and [`Cause::needs_then`]: data as well, each condition with its refusal.

use super::{Mode, Refusal};

/// What becomes of a cause in a mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The mode changes.
    Go(Mode),
    /// The mode stays: the cause has nothing to do here, or does what it does without another mode.
    Stay,
    /// The command is refused.
    Refuse(Refusal),
}

/// What a request needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// No fault is latched.
    NoFault,
    /// All drives are in operation.
    DrivesOn,
    /// The unwind's drive is in operation.
    UnwindOn,
    /// The web is threaded.
    WebThreaded,
    /// The web is not threaded.
    NoWeb,
    /// A diameter preset has been taken over.
    Preset,
    /// Tension has been detected.
    Tension,
    /// The machine stands.
    Standstill,
}

impl Condition {
    /// The answer to a request without it.
    pub fn refusal(self) -> Refusal {
        match self {
            Condition::NoFault => Refusal::FaultLatched,
            Condition::DrivesOn => Refusal::DrivesNotOn,
            Condition::UnwindOn => Refusal::UnwindNotOn,
            Condition::WebThreaded => Refusal::WebNotThreaded,
            Condition::NoWeb => Refusal::WebInMachine,
            Condition::Preset => Refusal::NoPreset,
            Condition::Tension => Refusal::NoTension,
            Condition::Standstill => Refusal::NotAtStandstill,
        }
    }
}

/// Number of modes.
pub const MODES: usize = Mode::ALL.len();

/// Writes the causes with their texts, and the table.
macro_rules! transitions {
    ($($cause:ident: $text:literal, [$($cell:ident)*];)*) => {
        /// What can change the mode, the strongest first: stops, requests, ends.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Cause {
            $(#[doc = $text] $cause,)*
        }

        impl Cause {
            /// Every cause, in the order of their strength.
            pub const ALL: &[Self] = &[$(Self::$cause),*];
            /// The texts, in the same order.
            pub const NAMES: &[&str] = &[$($text),*];
            /// What it is.
            pub fn name(self) -> &'static str {
                Self::NAMES[self as usize]
            }
        }

        /// The outcome of every cause in every mode: `TRANSITIONS[cause][mode]`.
        pub const TRANSITIONS: [[Outcome; MODES]; Cause::ALL.len()] = [$([$(cell::$cell),*]),*];
    };
}

/// The cells, short enough for a table.
#[allow(non_upper_case_globals)]
mod cell {
    use super::{Mode, Outcome, Refusal};

    pub const off: Outcome = Outcome::Go(Mode::Off);
    pub const rdy: Outcome = Outcome::Go(Mode::Ready);
    pub const thr: Outcome = Outcome::Go(Mode::Thread);
    pub const stl: Outcome = Outcome::Go(Mode::Stall);
    pub const run: Outcome = Outcome::Go(Mode::Run);
    pub const nst: Outcome = Outcome::Go(Mode::NormalStop);
    pub const est: Outcome = Outcome::Go(Mode::EmergencyStop);
    pub const cst: Outcome = Outcome::Go(Mode::CoastStop);
    pub const wbs: Outcome = Outcome::Go(Mode::WebBreakStop);
    pub const man: Outcome = Outcome::Go(Mode::UnwindManeuver);
    pub const tun: Outcome = Outcome::Go(Mode::AutoTune);
    pub const ___: Outcome = Outcome::Stay;
    pub const Mod: Outcome = Outcome::Refuse(Refusal::WrongMode);
    pub const Drv: Outcome = Outcome::Refuse(Refusal::DrivesNotOn);
    pub const Ten: Outcome = Outcome::Refuse(Refusal::NoTension);
    pub const Mov: Outcome = Outcome::Refuse(Refusal::NotAtStandstill);
}

#[rustfmt::skip]
transitions! {
    //                                                    off ready thread stall run normal emergency coast break maneuver tune
    DrumsLost:      "a fault leaves no drum to hold the web speed", [___ off cst cst cst cst cst ___ cst off cst];
    WebBreak:       "the web has broken",                           [___ ___ wbs wbs wbs wbs wbs ___ ___ ___ wbs];
    DriveLost:      "a fault takes a section out",                  [___ off est est est est ___ ___ ___ off est];
    CoastStanding:  "OFF2 at standstill",                           [___ off off off off off off off off off off];
    Coast:          "OFF2, or operation not enabled",               [___ cst cst cst cst cst cst ___ cst off cst];
    QuickStop:      "OFF3",                                         [___ off est est est est ___ ___ ___ off est];
    StopByFault:    "a fault stops the winder normally",            [___ off nst nst nst ___ ___ ___ ___ off nst];
    SwitchOff:      "OFF1",                                         [___ off nst off nst ___ ___ ___ ___ ___ nst];
    PresetAccept:   "preset_accept",                                [___ ___ Mod Mod Mod Mod Mod Mod Mod Mod Mod];
    NewCore:        "new_core",                                     [___ ___ Mod Mod Mod Mod Mod Mod Mod Mod Mod];
    NewParentRoll:  "new_parent_roll",                              [___ ___ Mod Mod Mod Mod Mod Mod Mod Mod Mod];
    WebRemoved:     "web_removed",                                  [___ ___ Mod Mod Mod Mod Mod Mod Mod Mod Mod];
    WebThreaded:    "web_threaded",                                 [___ ___ Mod Mod Mod Mod Mod Mod Mod Mod Mod];
    DrumBrakes:     "drum_brakes",                                  [___ ___ Mov ___ Mov ___ Mov Mov Mov ___ Mod];
    Jog:            "jog_forward or jog_backward",                  [man man Mod Mod Mod Mod Mod Mod Mod ___ Mod];
    Stall:          "stall",                                        [Drv stl Mod ___ Mod Mod Mod Mod Mod Mod Mod];
    Thread:         "thread",                                       [Drv thr Mod thr Mod Mod Mod Mod Mod Mod Mod];
    TuneSpeed:      "autotune of a speed loop",                     [Drv tun Mod Mod Mod Mod Mod Mod Mod Mod Mod];
    TuneTension:    "autotune of the tension loop",                 [Drv Ten tun Mod Mod Mod Mod Mod Mod Mod Mod];
    Run:            "run",                                          [Drv Ten run run Mod Mod Mod Mod Mod Mod Mod];
    Withdrawn:      "the mode's own request is taken back",         [___ ___ nst rdy nst ___ ___ ___ ___ ___ nst];
    TuneEnds:       "auto-tune has ended",                          [___ ___ ___ ___ ___ ___ ___ ___ ___ ___ nst];
    StandsDown:     "standstill, with a fault or not all drives on", [___ ___ ___ ___ ___ off off off off off ___];
    StandsTight:    "standstill, the web under tension",            [___ ___ ___ ___ ___ stl off off rdy rdy ___];
    StandsSlack:    "standstill, no tension",                       [___ ___ ___ ___ ___ rdy off off rdy rdy ___];
    DrivesOn:       "all drives are in operation",                  [rdy ___ ___ ___ ___ ___ ___ ___ ___ ___ ___];
}

impl Cause {
    /// The outcome in a mode.
    pub fn outcome(self, mode: Mode) -> Outcome {
        TRANSITIONS[self as usize][mode as usize]
    }

    /// What a request needs before its mode is looked at.
    pub fn needs(self) -> &'static [Condition] {
        use Condition::*;
        match self {
            Cause::Stall | Cause::Thread | Cause::Run => &[NoFault, DrivesOn, WebThreaded, Preset],
            Cause::TuneTension => &[NoFault, DrivesOn, WebThreaded, Preset],
            Cause::TuneSpeed => &[NoFault, DrivesOn, NoWeb, Preset],
            Cause::Jog => &[NoFault, UnwindOn, NoWeb],
            _ => &[],
        }
    }

    /// What a request needs once its mode is right.
    pub fn needs_then(self) -> &'static [Condition] {
        use Condition::*;
        match self {
            Cause::Run | Cause::TuneTension => &[Tension],
            Cause::Jog | Cause::TuneSpeed => &[Standstill],
            Cause::PresetAccept | Cause::NewCore | Cause::NewParentRoll => &[Standstill],
            Cause::WebThreaded | Cause::WebRemoved => &[Standstill],
            _ => &[],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The names of enum and rows are in one macro; the columns must be the modes.
    #[test]
    fn a_stop_never_starts_anything() {
        let stops = [
            Cause::DrumsLost,
            Cause::WebBreak,
            Cause::DriveLost,
            Cause::CoastStanding,
            Cause::Coast,
            Cause::QuickStop,
            Cause::StopByFault,
            Cause::SwitchOff,
            Cause::Withdrawn,
        ];
        let moving = [
            Mode::Thread,
            Mode::Run,
            Mode::UnwindManeuver,
            Mode::AutoTune,
        ];
        for cause in stops {
            for &mode in Mode::ALL {
                if let Outcome::Go(to) = cause.outcome(mode) {
                    assert!(!moving.contains(&to), "{cause:?} in {mode:?}");
                }
            }
        }
    }

    /// From off nothing turns the drums but all drives being on; and whatever moves can be stopped by every OFF.
    #[test]
    fn every_moving_mode_obeys_every_stop() {
        for &mode in Mode::ALL {
            let ends = |cause: Cause| matches!(cause.outcome(mode), Outcome::Go(_));
            match mode {
                Mode::Off => {
                    let mut ways = Cause::ALL.iter().filter(|cause| ends(**cause));
                    assert_eq!(ways.next(), Some(&Cause::Jog));
                    assert_eq!(ways.next(), Some(&Cause::DrivesOn));
                    assert_eq!(ways.next(), None);
                }
                Mode::Thread | Mode::Run | Mode::AutoTune => {
                    for cause in [
                        Cause::Coast,
                        Cause::QuickStop,
                        Cause::SwitchOff,
                        Cause::StopByFault,
                    ] {
                        assert!(ends(cause), "{cause:?} in {mode:?}");
                    }
                }
                _ => {}
            }
        }
    }

    /// Every mode can be reached from off, and off from every mode.
    #[test]
    fn no_mode_is_a_dead_end() {
        let next = |mode: Mode| {
            Cause::ALL
                .iter()
                .filter_map(move |cause| match cause.outcome(mode) {
                    Outcome::Go(to) => Some(to),
                    _ => None,
                })
        };
        for &start in Mode::ALL {
            let mut reached = [false; MODES];
            reached[start as usize] = true;
            for _ in 0..MODES {
                for &mode in Mode::ALL {
                    if reached[mode as usize] {
                        next(mode).for_each(|to| reached[to as usize] = true);
                    }
                }
            }
            assert!(reached.iter().all(|reached| *reached), "from {start:?}");
        }
    }
}
