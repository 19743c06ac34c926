//! One drive section's part of the PROFIdrive general state machine.
//!
//! Not here: what the sections do together; one section that stops, stops the winder.

use crate::profidrive::{stw1, zsw1};

/// State of a section, S1 to S4 of the profile. S5, switching off, is the winder's stop mode.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum State {
    /// S1: ON must be taken back, with coast and quick stop inactive.
    #[default]
    SwitchingOnInhibited,
    /// S2
    ReadyToSwitchOn,
    /// S3
    SwitchedOn,
    /// S4
    Operation,
}

/// What the PLC's control word asks of a section in operation, the strongest first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Demand {
    /// Go on.
    #[default]
    Operate,
    /// OFF1: ramp down, then switch off.
    SwitchOff,
    /// OFF3: quick stop, then switch off.
    QuickStop,
    /// OFF2, or operation no longer enabled: coast.
    Coast,
}

/// One drive section.
#[derive(Clone, Copy, Debug, Default)]
pub struct Section {
    state: State,
    /// The last control word that came with "control by PLC".
    word: u16,
}

impl Section {
    /// The state.
    pub fn state(&self) -> State {
        self.state
    }

    /// The control word that counts.
    pub fn word(&self) -> u16 {
        self.word
    }

    /// The demand on a section in operation.
    pub fn demand(&self) -> Demand {
        let has = |bit| self.word & bit != 0;
        if !has(stw1::NO_COAST) || !has(stw1::ENABLE_OPERATION) {
            Demand::Coast
        } else if !has(stw1::NO_QUICK_STOP) {
            Demand::QuickStop
        } else if !has(stw1::ON) {
            Demand::SwitchOff
        } else {
            Demand::Operate
        }
    }

    /// Takes a control word. Switching on goes one state a cycle; a section in operation leaves it only by
    /// [`Section::switch_off`].
    pub fn step(&mut self, word: u16, fault: bool) {
        if word & stw1::CONTROL_BY_PLC != 0 {
            self.word = word;
        }
        let has = |bit| self.word & bit != 0;
        let may_start = has(stw1::NO_COAST) && has(stw1::NO_QUICK_STOP) && !fault;
        self.state = match self.state {
            State::Operation => State::Operation,
            _ if !may_start => State::SwitchingOnInhibited,
            State::SwitchingOnInhibited if !has(stw1::ON) => State::ReadyToSwitchOn,
            State::ReadyToSwitchOn if has(stw1::ON) => State::SwitchedOn,
            State::SwitchedOn if !has(stw1::ON) => State::ReadyToSwitchOn,
            State::SwitchedOn if has(stw1::ENABLE_OPERATION) => State::Operation,
            same => same,
        };
    }

    /// A fault of its own takes the section out at once.
    pub fn trip(&mut self) {
        self.state = State::SwitchingOnInhibited;
    }

    /// The direction of jogging, +1 by jog 1 and −1 by jog 2: only while the ramp generator and the set-point are
    /// not enabled. None when both are set.
    pub fn jog(&self) -> Option<i8> {
        let normal = stw1::ENABLE_RAMP | stw1::UNFREEZE_RAMP | stw1::ENABLE_SETPOINT;
        let has = |bit| self.word & bit != 0;
        match (has(stw1::JOG_1), has(stw1::JOG_2)) {
            _ if self.word & normal != 0 => Some(0),
            (true, true) => None,
            (forward, backward) => Some(i8::from(forward) - i8::from(backward)),
        }
    }

    /// Ends operation: after OFF1 the section is ready again, after anything else it is inhibited.
    pub fn switch_off(&mut self, fault: bool) {
        if self.state == State::Operation {
            self.state = if self.demand() == Demand::SwitchOff && !fault {
                State::ReadyToSwitchOn
            } else {
                State::SwitchingOnInhibited
            };
        }
    }

    /// Status word 1. `speed` holds the bits that tell of the speed.
    pub fn status(&self, fault: bool, warning: bool, speed: u16) -> u16 {
        let state = match self.state {
            State::SwitchingOnInhibited => zsw1::SWITCHING_ON_INHIBITED,
            State::ReadyToSwitchOn => zsw1::READY_TO_SWITCH_ON,
            State::SwitchedOn => zsw1::READY_TO_SWITCH_ON | zsw1::READY_TO_OPERATE,
            State::Operation => {
                zsw1::READY_TO_SWITCH_ON | zsw1::READY_TO_OPERATE | zsw1::OPERATION_ENABLED
            }
        };
        let follow = |bit: u16, status: u16| if self.word & bit != 0 { status } else { 0 };
        state
            | follow(stw1::NO_COAST, zsw1::NO_COAST)
            | follow(stw1::NO_QUICK_STOP, zsw1::NO_QUICK_STOP)
            | if fault { zsw1::FAULT } else { 0 }
            | if warning { zsw1::WARNING } else { 0 }
            | zsw1::CONTROL_REQUESTED
            | speed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The start sequence and the stops of the profile, word by word.
    #[test]
    fn state_machine_follows_the_profile() {
        use State::*;
        let mut section = Section::default();
        let dialogue = [
            // on too early stays inhibited: ON must be seen 0 first
            (0x047f, SwitchingOnInhibited),
            (0x047e, ReadyToSwitchOn),
            (0x047f, SwitchedOn),
            (0x047f, Operation),
            // without control by PLC the last word counts
            (0x0000, Operation),
        ];
        for (word, state) in dialogue {
            section.step(word, false);
            assert_eq!(section.state(), state, "{word:04x}");
        }
        for (word, demand, after) in [
            (0x047e, Demand::SwitchOff, ReadyToSwitchOn),
            (0x047b, Demand::QuickStop, SwitchingOnInhibited),
            (0x047d, Demand::Coast, SwitchingOnInhibited),
            (0x0477, Demand::Coast, SwitchingOnInhibited),
            (0x0479, Demand::Coast, SwitchingOnInhibited),
        ] {
            let mut section = Section {
                state: Operation,
                word: 0x047f,
            };
            section.step(word, false);
            assert_eq!(section.demand(), demand, "{word:04x}");
            assert_eq!(section.state(), Operation, "the winder ends operation");
            section.switch_off(false);
            assert_eq!(section.state(), after, "{word:04x}");
        }
    }

    #[test]
    fn a_fault_inhibits_switching_on() {
        let mut section = Section::default();
        section.step(0x047e, true);
        assert_eq!(section.state(), State::SwitchingOnInhibited);
        assert_eq!(section.status(true, false, 0) & zsw1::FAULT, zsw1::FAULT);
    }
}
