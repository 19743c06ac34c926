//! Scenarios: the library that ships, what a file may say, recordings, snapshots.
//!
//! Not here: what the signals do. A scenario of the library is the test of that.
#![allow(clippy::unwrap_used)]

mod support;

use std::path::PathBuf;

use host_tests::machine_file::Description;
use host_tests::scenario::lockstep::{Bench, Outcome, play};
use host_tests::scenario::player::Failure;
use host_tests::scenario::record::{Recorder, Recording};
use host_tests::scenario::{Act, Scenario, live, shipped};
use host_tests::simulator::{Board, Options, Simulator};
use model_core::image::{self, Commands};
use model_core::machine::{Machine, PRESETS};
use proptest::prelude::*;
use support::winder;
use tempfile::TempDir;

/// Files in a directory that goes with it.
struct Files(TempDir);

impl Files {
    fn new(files: &[(&str, &str)]) -> Self {
        let directory = tempfile::tempdir().unwrap();
        for (name, text) in files {
            std::fs::write(directory.path().join(name), text).unwrap();
        }
        Self(directory)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// The error of the first file, without the directory.
    fn error(&self, name: &str) -> String {
        let error = format!("{:#}", Scenario::open(&self.path(name)).unwrap_err());
        error.replace(&format!("{}/", self.0.path().display()), "")
    }
}

fn played(text: &str) -> Outcome {
    let files = Files::new(&[("s.toml", text)]);
    let scenario = Scenario::open(&files.path("s.toml")).unwrap();
    play(&scenario, |_, _| ()).unwrap()
}

/// Line, drive cycle and what was there, of every failure.
fn lines(failures: &[Failure]) -> Vec<(usize, u64, &str)> {
    let line = |f: &'_ Failure| (f.at.line, f.cycle);
    let rows = failures.iter().map(|f| (line(f), f.got.as_str()));
    rows.map(|((line, cycle), got)| (line, cycle, got))
        .collect()
}

#[test]
fn the_library_goes_as_it_expects() {
    let files = shipped().unwrap();
    assert!(files.len() > 10, "{files:?}");
    let mut failed = String::new();
    for file in files {
        let scenario = Scenario::open(&file).unwrap_or_else(|error| panic!("{error:#}"));
        let outcome = play(&scenario, |_, _| ()).unwrap_or_else(|error| panic!("{error:#}"));
        for failure in outcome.failures {
            failed += &format!("{failure}\n");
        }
    }
    assert!(failed.is_empty(), "{failed}");
}

/// A scenario that expects nothing proves nothing.
#[test]
fn every_scenario_of_the_library_waits_for_or_expects_something_of_its_own() {
    for file in shipped().unwrap() {
        let scenario = Scenario::open(&file).unwrap();
        let name = file.display().to_string();
        let own = scenario.acts.iter().filter(|act| match act {
            Act::Step(step) => {
                step.at.file == name && (step.is_judged() || !step.expect.is_empty())
            }
            _ => false,
        });
        assert!(own.count() > 0, "{name}");
        assert_ne!(scenario.title, scenario.name, "{name} has no title");
    }
}

mod files {
    use super::*;

    #[test]
    fn bad_files_are_refused_with_file_line_and_reason() {
        for (text, reason) in [
            (
                "titel = 'x'",
                "s.toml:1: there is no key titel here; the nearest is title",
            ),
            ("title = 3", "s.toml:1: title = 3 is not a text"),
            ("title = ", "s.toml:1: "),
            (
                "start = 'to_rum'",
                "s.toml:1: there is no prelude to_rum; the nearest is to_run",
            ),
            (
                "start = 'no.toml'",
                "s.toml:1: start = \"no.toml\": cannot read no.toml",
            ),
            (
                "start = 's.toml'",
                "s.toml:1: start = \"s.toml\": s.toml includes itself",
            ),
            (
                "machine = 'NEWS-9'",
                "s.toml:1: \"NEWS-9\" is neither a machine nor a file",
            ),
            (
                "set = { v_sett = 1 }",
                "s.toml:1: there is no signal v_sett; the nearest is v_set",
            ),
            (
                "set = { v_set = 2501 }",
                "s.toml:1: v_set = 2501 is outside 0 to 2500 m/min",
            ),
            (
                "set = { v_set = -0.1 }",
                "s.toml:1: v_set = -0.1 is outside 0 to 2500 m/min",
            ),
            (
                "set = { v_set = [1] }",
                "s.toml:1: v_set = [1] is not a number",
            ),
            ("set = { v_web = 1 }", "s.toml:1: v_web is feedback"),
            (
                "set = { 'winder_command.rum' = true }",
                "s.toml:1: there is no signal winder_command.rum; the nearest is winder_command.run",
            ),
            ("step = 3", "s.toml:1: step = 3 is not a list"),
            (
                "[[step]]\nafter = 3",
                "s.toml:2: there is no key after here; the nearest is ",
            ),
            (
                "[[step]]\nat = -1",
                "s.toml:2: at = -1 is outside 0 to 86400 s",
            ),
            (
                "[[step]]\nat = 1e6",
                "s.toml:2: at = 1e6 is outside 0 to 86400 s",
            ),
            (
                "[[step]]\nat = nan",
                "s.toml:2: at = nan is outside 0 to 86400 s",
            ),
            (
                "[[step]]\nat = 0.125",
                "s.toml:2: at = 0.125 is not a whole number of drive cycles of 0.01 s",
            ),
            (
                "[[step]]\nat = 'x'",
                "s.toml:2: at = 'x' is not a time in s",
            ),
            (
                "[[step]]\nfor = 5\n[[step]]\nat = 4.99",
                "s.toml:4: at = 4.99 s is before the step before can have ended, 5 s",
            ),
            (
                "[[step]]\npress = ['winder_command.acknowledge']\n[[step]]\nat = 0.19",
                "s.toml:4: at = 0.19 s is before the step before can have ended, 0.2 s",
            ),
            (
                "[[step]]\nuntil = 'winder_status.fault'",
                "s.toml:1: 'until' needs 'within'",
            ),
            ("[[step]]\nwithin = 3", "s.toml:1: 'within' needs 'until'"),
            (
                "[[step]]\nfor = 3\nuntil = 'winder_status.fault'\nwithin = 3",
                "s.toml:1: a step has either 'for' or 'until'",
            ),
            (
                "[[step]]\nuntil = 'winder_status.falt'\nwithin = 3",
                "s.toml:2: there is no signal winder_status.falt; the nearest is winder_status.fault",
            ),
            (
                "[[step]]\nheartbeat = 0",
                "s.toml:2: heartbeat = 0 is not true or false",
            ),
            (
                "[[step]]\npress = ['v_set']",
                "s.toml:2: v_set = true is not a number",
            ),
            (
                "[[step]]\nfor = 1\nexpect = [\n{ signal = 'tenson', min = 1 } ]",
                "s.toml:4: there is no signal tenson; the nearest is tension",
            ),
            (
                "[[step]]\nfor = 1\nexpect = [\n{ min = 1 } ]",
                "s.toml:4: the signal is missing",
            ),
            (
                "[[step]]\nfor = 1\nexpect = [{ signal = 'tension', min = 3, max = 2 }]",
                "s.toml:3: min = 3 is above max = 2",
            ),
            (
                "[[step]]\nfor = 1\nexpect = [{ signal = 'tension' }]",
                "s.toml:3: an expectation has either 'is', or 'min' or 'max' or both",
            ),
            (
                "[[step]]\nfor = 1\nexpect = [{ signal = 'tension', max = 70000 }]",
                "s.toml:3: tension = 70000 is outside 0 to 65535 N/m",
            ),
            (
                "[[step]]\nfor = 1\nexpect = [{ signal = 'tension', max = 7, during = [3, 2] }]",
                "s.toml:3: during ends at 2 s before it begins at 3 s",
            ),
            (
                "[[step]]\nfor = 1\nexpect = [{ signal = 'tension', max = 7, during = 3 }]",
                "s.toml:3: during = 3 is not \"end\", \"step\" or [from, to] in s",
            ),
            (
                "[[step]]\ninclude = 'x.toml'\nat = 3",
                "s.toml:1: a step with 'include' has nothing else",
            ),
            (
                "\n[[step]]\ninclude = 'bad.toml'",
                "s.toml:3: include = \"bad.toml\": bad.toml:2: there is no signal v_st; the nearest is v_set",
            ),
            (
                "[[step]]\ninclude = 'set.toml'",
                "s.toml:2: include = \"set.toml\": set.toml:1: an included file has no 'set'",
            ),
        ] {
            let files = Files::new(&[
                ("s.toml", text),
                ("bad.toml", "[[step]]\nset = { v_st = 1 }"),
                ("set.toml", "set = { v_set = 1 }"),
            ]);
            let error = files.error("s.toml");
            assert!(error.starts_with(reason), "{text:?}: {error}");
        }
    }

    /// The times of each file count from its own first step.
    #[test]
    fn files_stand_in_files_with_clocks_of_their_own() {
        let files = Files::new(&[
            ("first.toml", "set = { v_set = 100 }\n[[step]]\nfor = 1.5"),
            ("inner.toml", "[[step]]\nat = 2\nset = { v_set = 300 }"),
            (
                "s.toml",
                "start = 'first.toml'\nset = { tension_set = 300 }\n[[step]]\nat = 1\nset = { v_set = 200 }\n\
                 [[step]]\ninclude = 'inner.toml'\n[[step]]\nat = 5\nset = { v_set = 400 }\n",
            ),
        ]);
        let scenario = Scenario::open(&files.path("s.toml")).unwrap();
        let mut changes = Vec::new();
        play(&scenario, |bench, _| {
            let now: f64 = bench.image.commands.get(&image::V_SET);
            let tension: f64 = bench.image.commands.get(&image::TENSION_SET);
            assert!((tension - 300.0).abs() < 1e-9);
            if changes.last().is_none_or(|(_, last)| *last != now as u32) {
                // the command counted from the cycle before
                changes.push((bench.cycle - 1, now as u32));
            }
        })
        .unwrap();
        // 1.5 + 1; a step of one cycle; + 2; 1.5 + 5
        assert_eq!(changes, [(0, 100), (250, 200), (451, 300), (650, 400)]);
    }
}

mod playing {
    use super::*;

    /// The heartbeat counts the drive cycles, so what is expected of it is known without a winder.
    #[test]
    fn expectations_are_looked_at_in_their_cycles() {
        let outcome = played(
            "[[step]]\nfor = 1\nexpect = [\n\
             'heartbeat = 100',\n\
             'heartbeat = 99',\n\
             { signal = 'heartbeat', min = 3, max = 100, during = 'step' },\n\
             { signal = 'heartbeat', min = 4, max = 99, during = 'step' },\n\
             { signal = 'heartbeat', min = 50, max = 150, during = [0.5, 1.5] },\n\
             { signal = 'heartbeat', min = 52, max = 149, during = [0.5, 1.5] },\n\
             { signal = 'heartbeat', is = 70, during = [0.7, 0.7] } ]\n\
             [[step]]\nuntil = 'heartbeat >= 120'\nwithin = 0.2\nexpect = ['heartbeat = 120']",
        );
        let failures = lines(&outcome.failures);
        assert_eq!(
            failures,
            [
                (7, 3, "heartbeat = 3"),
                (9, 50, "heartbeat = 50"),
                (5, 100, "heartbeat = 100"),
            ]
        );
        let lasted: Vec<_> = outcome.failures.iter().map(|f| f.lasted).collect();
        // 3 and 100; 50, 51 and 150; 100 alone
        assert_eq!(lasted, [2, 3, 1]);
        assert_eq!(outcome.cycles, 150, "until the last window is over");
    }

    #[test]
    fn a_failure_names_file_time_signal_wanted_and_got() {
        let outcome = played(
            "[[step]]\nfor = 2\n[[step]]\nfor = 1\nexpect = [{ signal = 'tension', min = 315, max = 385 }]",
        );
        let [failure] = &outcome.failures[..] else {
            panic!("{:?}", outcome.failures);
        };
        let told = failure.to_string();
        let told = &told[told.find("s.toml").unwrap()..];
        assert_eq!(
            told,
            "s.toml:5: at 3.00 s (1.00 s into the step): wanted tension 315 to 385 N/m, got tension = 0 N/m"
        );
    }

    /// A step that waits in vain ends the scenario; what would have come after is not done.
    #[test]
    fn a_condition_that_does_not_come_ends_the_scenario_in_time() {
        let outcome = played(
            "[[step]]\nfor = 1\n[[step]]\nuntil = 'winder_status.fault'\nwithin = 2.5\n\
             [[step]]\nfor = 100\nexpect = ['winder_status.fault']",
        );
        assert_eq!(outcome.cycles, 350);
        let [failure] = &outcome.failures[..] else {
            panic!("{:?}", outcome.failures);
        };
        assert_eq!(failure.wanted, "winder_status.fault within 2.5 s");
    }

    #[test]
    fn a_step_that_comes_too_late_ends_the_scenario() {
        let outcome = played(
            "[[step]]\nuntil = 'heartbeat = 200'\nwithin = 3\n[[step]]\nat = 1.5\nset = { v_set = 3 }",
        );
        let [failure] = &outcome.failures[..] else {
            panic!("{:?}", outcome.failures);
        };
        assert_eq!(failure.at.line, 4);
        assert_eq!(failure.got, "the step before ending 0.50 s later than that");
    }

    #[test]
    fn a_press_is_an_edge_of_a_tenth_of_a_second() {
        let text = "[[step]]\npress = ['winder_command.acknowledge', 'winder_command.new_core']\n\
                    [[step]]\npress = ['winder_command.acknowledge']";
        let files = Files::new(&[("s.toml", text)]);
        let scenario = Scenario::open(&files.path("s.toml")).unwrap();
        let mut words = Vec::new();
        play(&scenario, |bench, _| {
            words.push(bench.image.commands.word(&image::WINDER_COMMAND));
        })
        .unwrap();
        let expected = [[0xc0; 10], [0; 10], [0x40; 10], [0; 10]].concat();
        assert_eq!(words, expected);
    }

    #[test]
    fn the_heartbeat_counts_in_every_cycle_unless_it_is_stopped() {
        let text = "[[step]]\nfor = 0.1\n[[step]]\nheartbeat = false\nfor = 0.1\n\
                    [[step]]\nheartbeat = true\nfor = 0.1";
        let files = Files::new(&[("s.toml", text)]);
        let scenario = Scenario::open(&files.path("s.toml")).unwrap();
        let mut beats = Vec::new();
        play(&scenario, |bench, _| {
            beats.push(bench.image.commands.word(&image::HEARTBEAT_PLC));
        })
        .unwrap();
        let expected: Vec<u16> = (1..=10).chain([10; 10]).chain(11..=20).collect();
        assert_eq!(beats, expected);
    }

    /// The same scenario over Modbus TCP, at a pace of its own.
    #[test]
    fn a_scenario_runs_on_a_simulator_somewhere_else() {
        let options = Options {
            pace: 10.0,
            ..Options::default()
        };
        let simulator = Simulator::start(Board::Host, options).unwrap();
        let text = "start = 'to_tension'\n[[step]]\npress = ['winder_command.new_core']\n\
                    expect = [\"refusal = 'not permitted'\", 'mode = run']";
        let files = Files::new(&[("s.toml", text)]);
        let scenario = Scenario::open(&files.path("s.toml")).unwrap();
        let outcome = live::play(&scenario, simulator.address(), |_| ()).unwrap();
        let [failure] = &outcome.failures[..] else {
            panic!("{:?}", outcome.failures);
        };
        assert_eq!(failure.got, "mode = 2 (thread)");
    }
}

mod recordings {
    use super::*;

    /// Plays a scenario and gives its recording.
    fn recorded(text: &str) -> (Outcome, String) {
        let files = Files::new(&[
            ("s.toml", text),
            (
                "slippery.toml",
                "preset = 'NEWS-8000'\n[nips]\nslip = true\nfriction = 0.2",
            ),
        ]);
        let scenario = Scenario::open(&files.path("s.toml")).unwrap();
        let mut file = Vec::new();
        let mut recorder = Recorder::new(&mut file, &scenario.machine).unwrap();
        let outcome = play(&scenario, |bench, _| recorder.look(bench).unwrap()).unwrap();
        recorder.finish().unwrap();
        (outcome, String::from_utf8(file).unwrap())
    }

    const RUN: &str = "start = 'to_run'\nset = { v_set = 300 }\n\
        [[step]]\nheartbeat = false\nfor = 0.3\n[[step]]\nheartbeat = true\nset = { tension_set = 330 }\nfor = 2\n\
        [[step]]\nset = { front_share_trim = -2.5 }\nfor = 0.55";

    #[test]
    fn a_recording_reproduces_its_run_to_the_bit() {
        for machine in ["", "machine = 'LAB-300'\n", "machine = 'slippery.toml'\n"] {
            let text = format!(
                "{machine}{}",
                if machine.contains("LAB") { LAB } else { RUN }
            );
            let (outcome, file) = recorded(&text);
            let recording = Recording::read("run.csv", file.as_bytes()).unwrap();
            let replay = recording.replay().unwrap();
            assert!(replay.difference.is_none(), "{:?}", replay.difference);
            assert_eq!(replay.trajectory, outcome.trajectory);
            assert_eq!(replay.cycles, outcome.cycles);
            // the heartbeat's thousands of counts are not thousands of rows
            assert!(file.lines().count() < 100, "{file}");
        }
    }

    /// What another machine's limits allow.
    const LAB: &str = "[[step]]\nset = { 'stw1_*' = 0x047E }\nfor = 0.1\n[[step]]\nset = { 'stw1_*' = 0x047F }\nfor = 11";

    #[test]
    fn one_count_or_one_cycle_makes_another_run() {
        let (_, file) = recorded(RUN);
        for (from, to) in [
            ("tension_set,350", "tension_set,351"),
            (
                "0,machine,NEWS-8000\n",
                "0,machine,NEWS-8000\n0,machine.web.caliper_m,0.0000651\n",
            ),
            ("63,winder_command,16", "64,winder_command,16"),
        ] {
            assert!(file.contains(from), "{from}: {file}");
            let other = file.replacen(from, to, 1);
            let replay = Recording::read("run.csv", other.as_bytes())
                .unwrap()
                .replay();
            let difference = replay.unwrap().difference.expect(to);
            assert_eq!(difference.place.to_string(), "trajectory", "{to}");
        }
    }

    #[test]
    fn bad_recordings_are_refused_with_file_line_and_reason() {
        for (text, reason) in [
            ("", "run.csv:1: this is no recording"),
            ("t_s,T_uw", "run.csv:1: this is no recording"),
            ("{}", "run.csv: the row of the machine is missing"),
            (
                "{}0,machine,NEWS-9",
                "run.csv:2: machine = \"NEWS-9\" is no preset",
            ),
            (
                "{}0,machine.web.width_m,3",
                "run.csv:2: machine.web.width_m stands before",
            ),
            (
                "{}0,machine,NEWS-8000\n0,machine.web.width,3",
                "run.csv:3: there is no parameter web.width",
            ),
            (
                "{}0,machine,NEWS-8000\n0,machine.web.width_m,wide",
                "run.csv:3: machine.web.width_m = \"wide\" is no value of it",
            ),
            (
                "{}0,machine,NEWS-8000\n0,machine.web.width_m,99",
                "run.csv: web.width_m = 99 is outside",
            ),
            (
                "{}x,v_set,3",
                "run.csv:2: cycle = \"x\" is not a whole number",
            ),
            (
                "{}0,v_st,3",
                "run.csv:2: there is no signal v_st; the nearest is v_set",
            ),
            (
                "{}0,v_set,65536",
                "run.csv:2: v_set = 65536 is outside 0 to 65535",
            ),
            (
                "{}0,v_set,3.5",
                "run.csv:2: v_set = \"3.5\" is not a whole number",
            ),
            (
                "{}0,trajectory,up",
                "run.csv:2: trajectory = \"up\" is not a whole number",
            ),
            (
                "{}0,winder_command.run,1",
                "run.csv:2: winder_command.run is a bit",
            ),
            (
                "{}5,v_set,3\n4,v_set,3",
                "run.csv:3: cycle = 4 is outside 5",
            ),
        ] {
            let text = text.replace("{}", "cycle,signal,counts\n");
            let error = Recording::read("run.csv", text.as_bytes()).expect_err(&text);
            let error = format!("{error:#}");
            assert!(error.starts_with(reason), "{text:?}: {error}");
        }
        let nothing = "cycle,signal,counts\n0,machine,NEWS-8000\n0,v_set,3\n";
        let recording = Recording::read("run.csv", nothing.as_bytes()).unwrap();
        let error = recording.replay().unwrap_err().to_string();
        assert!(error.contains("nothing to compare"), "{error}");
    }

    #[test]
    fn a_machine_is_recorded_by_what_differs() {
        let mut machine = Description::of(&PRESETS[0]);
        machine.machine.nips.slip = true;
        machine.machine.web.caliper_m = 70e-6;
        let mut file = Vec::new();
        Recorder::new(&mut file, &machine)
            .unwrap()
            .finish()
            .unwrap();
        let read = Recording::read("run.csv", file.as_slice()).unwrap();
        assert_eq!(read.machine, machine.machine);
    }
}

mod snapshots {
    use super::*;

    /// The commands of a run with all that moves: thread, run, changed set-points, an emergency stop.
    fn commands() -> Vec<Commands> {
        let text = "start = 'to_run'\nset = { v_set = 200 }\n[[step]]\nset = { tension_set = 300 }\nfor = 2\n\
                    [[step]]\nset = { 'stw1_rd.no_quick_stop' = false }\nfor = 6";
        let files = Files::new(&[("s.toml", text)]);
        let scenario = Scenario::open(&files.path("s.toml")).unwrap();
        let mut commands = Vec::new();
        play(&scenario, |bench, _| commands.push(bench.image.commands)).unwrap();
        commands
    }

    /// Everything that there is, as text: two benches that print alike are alike.
    fn all(bench: &Bench) -> String {
        format!("{bench:?}")
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]

        /// Taken at any cycle and restored after other things have happened, it goes on to the same bits.
        #[test]
        fn a_restored_snapshot_goes_on_to_the_same_bits(
            taken in 0.0..1.0_f64,
            detour in 1..200_usize,
            word in any::<u16>(),
        ) {
            let commands = commands();
            let taken = (taken * commands.len() as f64) as usize;
            let mut bench = Bench::new(&Machine::news_8000()).unwrap();
            commands[..taken].iter().for_each(|c| bench.step(c));
            let snapshot = bench.clone();
            // another future
            let mut other = bench.image.commands;
            other.set_word(&image::STW1_RD, word);
            (0..detour).for_each(|_| bench.step(&other));
            prop_assert_ne!(bench.cycle, snapshot.cycle);
            // back, and on
            bench = snapshot.clone();
            let mut never_left = snapshot;
            for c in &commands[taken..] {
                bench.step(c);
                never_left.step(c);
                prop_assert_eq!(bench.image, never_left.image);
            }
            prop_assert_eq!(all(&bench), all(&never_left));
        }
    }

    /// Against a run without any snapshot: a snapshot is all that there is.
    #[test]
    fn a_snapshot_is_all_that_there_is() {
        let commands = commands();
        let mut straight = Bench::new(&Machine::news_8000()).unwrap();
        let mut hopping = straight.clone();
        for (i, c) in commands.iter().enumerate() {
            straight.step(c);
            hopping.step(c);
            if i % 97 == 0 {
                hopping = hopping.clone();
            }
        }
        assert_eq!(all(&straight), all(&hopping));
        assert_eq!(straight.trajectory(), hopping.trajectory());
    }
}

mod command_line {
    use super::*;

    fn said(output: &std::process::Output) -> String {
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    #[test]
    fn a_scenario_is_played_recorded_and_replayed() {
        let files = Files::new(&[(
            "mine.toml",
            "title = 'Mine'\nstart = 'to_tension'\n[[step]]\nfor = 1\nexpect = ['mode = thread', 'mode = run']",
        )]);
        let path = |name: &str| files.path(name).display().to_string();
        let (scenario, run) = (path("mine.toml"), path("run.csv"));
        let played = winder(&["scenario", &scenario, "--verbose", "--record", &run])
            .output()
            .unwrap();
        assert_eq!(played.status.code(), Some(1), "one expectation is wrong");
        let told = said(&played);
        assert!(
            told.contains("mine.toml:5: at ") && told.contains("got mode = 2 (thread)"),
            "{told}"
        );
        assert!(told.contains("acknowledge faults"), "{told}");
        let replayed = winder(&["replay", &run]).output().unwrap();
        assert!(replayed.status.success());
        assert!(
            said(&replayed).contains("to the bit"),
            "{}",
            said(&replayed)
        );
        let text = std::fs::read_to_string(&run).unwrap();
        std::fs::write(&run, text.replacen("stall_set,105", "stall_set,106", 1)).unwrap();
        let replayed = winder(&["replay", &run]).output().unwrap();
        assert_eq!(replayed.status.code(), Some(1));
        assert!(
            said(&replayed).contains("another one"),
            "{}",
            said(&replayed)
        );
    }

    #[test]
    fn what_cannot_be_played_is_said() {
        for (arguments, reason) in [
            (&["scenario", "no.toml"][..], "cannot read no.toml"),
            (
                &["scenario", "--connect", "nowhere"],
                "--connect nowhere is not HOST:PORT",
            ),
            (
                &["scenario", "--record", "x.csv"],
                "--record takes the run of one scenario",
            ),
            (&["replay", "no.csv"], "cannot read no.csv"),
        ] {
            let output = winder(arguments).output().unwrap();
            assert_eq!(output.status.code(), Some(1), "{arguments:?}");
            let said = String::from_utf8_lossy(&output.stderr);
            assert!(said.contains(reason), "{arguments:?}: {said}");
        }
    }

    /// The committed figures are those that the command draws, and small.
    #[test]
    fn the_figures_are_drawn_each_with_what_to_compare() {
        let files = Files::new(&[]);
        let out = files.path("figures").display().to_string();
        let drawn = winder(&["figures", "--out", &out, "--svg-only"])
            .output()
            .unwrap();
        assert!(
            drawn.status.success(),
            "{}",
            String::from_utf8_lossy(&drawn.stderr)
        );
        let names = |directory: &std::path::Path| {
            let entries = std::fs::read_dir(directory)
                .unwrap()
                .map(|entry| entry.unwrap());
            let mut names: Vec<_> = entries.map(|entry| entry.file_name()).collect();
            names.sort();
            names
        };
        let drawn = names(&files.path("figures"));
        let committed = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/figures");
        assert_eq!(drawn, names(&committed));
        let mut bytes = 0;
        for name in drawn {
            let svg = std::fs::read_to_string(files.path("figures").join(&name)).unwrap();
            assert!(
                svg.contains("Compare: ") && !svg.contains("NaN"),
                "{name:?}"
            );
            bytes += svg.len();
        }
        assert!(bytes < 300_000, "{bytes} bytes");
    }
}
