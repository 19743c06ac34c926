//! Switches and relays.
//!
//! An input that is not wired reads as a machine without that switch: whoever wires none runs by the bus alone.

use model_core::exchange::Brakes;
use model_core::image::{self, Commands, Feedback, Signal};
use model_core::logic::{command, status};
use model_core::profidrive::stw1;

/// What stands at the inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Inputs {
    /// The emergency-stop circuit is closed.
    pub emergency_stop_closed: bool,
    /// The winder may run.
    pub run_permit: bool,
    /// The PLC's output for the drum brakes: closes them at standstill.
    pub drum_brakes: bool,
    /// A person acknowledges faults.
    pub acknowledge: bool,
}

impl Default for Inputs {
    /// Nothing is wired.
    fn default() -> Self {
        Self {
            emergency_stop_closed: true,
            run_permit: true,
            drum_brakes: false,
            acknowledge: false,
        }
    }
}

impl Inputs {
    /// The commands of the bus with what the wires say. A wire can only stop what the bus starts: the open
    /// emergency-stop circuit is OFF3 in every section, and a missing run permit takes the run command away.
    pub fn act_on(&self, commands: &Commands) -> Commands {
        let mut commands = *commands;
        let mut put = |signal: &Signal, bits: u16, set: bool| {
            let word = commands.word(signal);
            commands.set_word(signal, if set { word | bits } else { word & !bits });
        };
        if !self.emergency_stop_closed {
            for word in image::STW1 {
                put(word, stw1::NO_QUICK_STOP, false);
            }
        }
        if !self.run_permit {
            put(&image::WINDER_COMMAND, command::RUN, false);
        }
        if self.drum_brakes {
            put(&image::WINDER_COMMAND, command::DRUM_BRAKES, true);
        }
        if self.acknowledge {
            put(&image::WINDER_COMMAND, command::ACKNOWLEDGE, true);
        }
        commands
    }
}

/// What the outputs show.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outputs {
    /// The web-break relay; drops out when the web breaks, and without power.
    pub web_whole: bool,
    /// Brakes that are closed.
    pub brakes: Brakes<bool>,
    /// A fault is latched.
    pub fault: bool,
}

impl Outputs {
    /// What the drive system tells the bus, it tells the wires, too.
    pub fn of(feedback: &Feedback) -> Self {
        let winder = feedback.word(&image::WINDER_STATUS);
        let is = |bit| winder & bit != 0;
        Self {
            web_whole: !is(status::WEB_BREAK),
            brakes: Brakes {
                uw: is(status::BRAKE_UW),
                rd: is(status::BRAKE_RD),
                fd: is(status::BRAKE_FD),
            },
            fault: feedback.word(&image::FAULT) != 0,
        }
    }
}
