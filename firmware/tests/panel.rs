//! The operator panel at the simulator, in lockstep.

use firmware::hmi::panel::{Action, Goal, Order, Panel, State, Wrong};
use firmware::lockstep::Lockstep;
use model_core::image::{self, Commands, Feedback, Image};
use model_core::logic::{Fault, Mode, status};
use model_core::machine::Machine;

/// Somebody at the panel.
struct Desk {
    simulator: Lockstep<()>,
    panel: Panel,
    image: Image,
}

impl Desk {
    fn new() -> Self {
        let machine = Machine::news_8000();
        let image = Image {
            commands: Commands::of(&machine),
            feedback: Feedback::default(),
        };
        let mut desk = Self {
            simulator: Lockstep::new(&machine, &image, ()).expect("a preset is valid"),
            panel: Panel::new(&machine),
            image,
        };
        desk.wait(100);
        desk
    }

    fn cycle(&mut self) {
        let feedback = self.image.feedback;
        self.panel.cycle(&feedback, &mut self.image.commands);
        self.simulator.cycle(&mut self.image);
    }

    fn wait(&mut self, cycles: u32) {
        (0..cycles).for_each(|_| self.cycle());
    }

    fn act(&mut self, action: Action) -> Result<(), Wrong> {
        self.panel.act(action, &self.image.feedback)
    }

    fn state(&self) -> State {
        self.panel.state(&self.image.feedback)
    }

    #[track_caller]
    fn does(&mut self, action: Action, until: State) {
        self.act(action).expect("it can be done");
        // a set of ten minutes
        for _ in 0..60_000 {
            self.cycle();
            if self.state() == until {
                return;
            }
        }
        panic!(
            "{action:?} does not lead to {until:?}: {:?}, {}, {:?}",
            self.state(),
            self.panel.message(),
            self.mode()
        );
    }

    fn mode(&self) -> Mode {
        Mode::ALL[usize::from(self.image.feedback.word(&image::MODE))]
    }

    fn value(&self, signal: &image::Signal) -> f64 {
        self.image.feedback.get(signal)
    }

    fn is(&self, bits: u16) -> bool {
        self.image.feedback.word(&image::WINDER_STATUS) & bits == bits
    }

    fn fault(&self) -> u16 {
        self.image.feedback.word(&image::FAULT)
    }

    fn threaded(&mut self) {
        self.does(Action::Prepare, State::Ready);
        self.does(Action::Thread, State::Threaded);
    }
}

fn run(v_set_m_min: f32, diameter_mm: f32) -> Action {
    Action::Run(Order {
        v_set_m_min: Some(v_set_m_min),
        goal: Goal {
            diameter_mm: Some(diameter_mm),
            length_m: None,
        },
    })
}

#[test]
fn sets_are_wound_to_their_diameter_one_after_the_other() {
    let mut desk = Desk::new();
    desk.threaded();
    for (speed, diameter) in [(400.0, 140.0), (1200.0, 200.0)] {
        desk.does(run(speed, diameter), State::Running);
        for _ in 0..60_000 {
            desk.cycle();
            if desk.state() == State::Threaded {
                break;
            }
        }
        assert_eq!(desk.mode(), Mode::Stall);
        let d_wu = desk.value(&image::D_WU);
        assert!((d_wu - f64::from(diameter)).abs() < 1.0, "{d_wu} mm");
        let parent = desk.value(&image::D_UW);
        desk.does(Action::NewSet, State::Ready);
        assert!((desk.value(&image::D_WU) - 100.0).abs() < 1.0);
        // the parent roll stays
        assert!((desk.value(&image::D_UW) - parent).abs() < 0.05);
        desk.does(Action::Thread, State::Threaded);
    }
    // its estimate has followed the larger set, and no preset has put it back
    let parent = desk.value(&image::D_UW);
    assert!(parent < 2999.0, "{parent} mm");
    assert_eq!(desk.fault(), 0);
}

#[test]
fn a_set_ends_at_its_length_too_and_takes_another_speed_in_between() {
    let mut desk = Desk::new();
    desk.threaded();
    let order = |v_set_m_min| {
        Action::Run(Order {
            v_set_m_min: Some(v_set_m_min),
            goal: Goal {
                length_m: Some(300.0),
                diameter_mm: None,
            },
        })
    };
    desk.does(order(600.0), State::Running);
    desk.wait(1_000);
    desk.does(order(300.0), State::Running);
    desk.wait(1_500);
    assert!((desk.value(&image::V_WEB) - 300.0).abs() < 5.0);
    for _ in 0..60_000 {
        desk.cycle();
        if desk.state() == State::Threaded {
            break;
        }
    }
    let length = desk.value(&image::LENGTH_WU);
    assert!((length - 300.0).abs() < 1.0, "{length} m");
}

#[test]
fn every_loop_is_tuned_from_standstill() {
    let mut desk = Desk::new();
    for (number, end) in [(0, State::Off), (1, State::Off), (2, State::Threaded)] {
        desk.does(Action::Autotune(number), State::Tuning);
        desk.does_not_end_before(end);
        assert_eq!(desk.panel.message(), "done: the new gains are in use");
        assert_eq!(desk.fault(), 0, "loop {number}");
    }
}

impl Desk {
    #[track_caller]
    fn does_not_end_before(&mut self, end: State) {
        for _ in 0..60_000 {
            self.cycle();
            if self.state() == end && self.is(status::ZERO_SPEED) {
                return;
            }
        }
        panic!("{:?}, {}", self.state(), self.panel.message());
    }
}

#[test]
fn a_web_break_ends_the_set_and_is_acknowledged() {
    let mut desk = Desk::new();
    desk.threaded();
    desk.does(run(400.0, 600.0), State::Running);
    desk.wait(1_000);
    desk.image.commands.set_word(&image::FAULT_WEB_BREAK, 1);
    desk.wait(100);
    assert_eq!(desk.fault(), Fault::WebBreak as u16);
    assert_eq!(desk.panel.message(), Fault::WebBreak.name());
    desk.image.commands.set_word(&image::FAULT_WEB_BREAK, 0);
    desk.does_not_end_before(State::Off);
    desk.does(Action::Acknowledge, State::Off);
    assert_eq!(desk.fault(), 0);
    // and the next set begins
    desk.threaded();
}

#[test]
fn stops_stop_and_the_panel_can_be_left() {
    let mut desk = Desk::new();
    desk.threaded();
    desk.does(run(400.0, 600.0), State::Running);
    desk.wait(1_000);
    desk.does(Action::Stop, State::Threaded);
    desk.does(run(400.0, 600.0), State::Running);
    desk.wait(1_000);
    desk.does(Action::EmergencyStop, State::Off);
    assert_eq!(desk.mode(), Mode::Off);
    desk.does(Action::Prepare, State::Ready);
    desk.does(Action::SwitchOff, State::Off);
    assert_eq!(desk.mode(), Mode::Off);
    assert_eq!(desk.fault(), 0);
}

#[test]
fn what_cannot_be_is_refused_and_changes_nothing() {
    let mut desk = Desk::new();
    assert_eq!(desk.act(Action::Thread), Err(Wrong::NotNow(State::Off)));
    assert_eq!(desk.act(run(400.0, 200.0)), Err(Wrong::NotNow(State::Off)));
    assert_eq!(
        desk.act(Action::Autotune(3)),
        Err(Wrong::NotNow(State::Off))
    );
    desk.threaded();
    for (action, parameter) in [
        (run(2501.0, 200.0), "v_set_m_min"),
        (run(f32::NAN, 200.0), "v_set_m_min"),
        (run(400.0, 99.0), "diameter_mm"),
        (run(400.0, 1251.0), "diameter_mm"),
    ] {
        match desk.act(action) {
            Err(Wrong::Outside {
                parameter: named, ..
            }) => assert_eq!(named, parameter),
            other => panic!("{action:?}: {other:?}"),
        }
    }
    assert_eq!(
        desk.act(Action::Prepare),
        Err(Wrong::NotNow(State::Threaded))
    );
    desk.wait(100);
    assert_eq!((desk.state(), desk.mode()), (State::Threaded, Mode::Thread));
}
