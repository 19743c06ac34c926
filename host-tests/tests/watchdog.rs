//! A task that hangs, for real, in QEMU: the simulator is served again, in its safe state, and says why.
//! `cargo winder test` runs it.

use host_tests::setup::Warnings;
use host_tests::timing::Firmware;
use host_tests::timing::hang::Level;
use host_tests::twin::CORES;
use model_core::logic::{Fault, Mode};
use model_core::restart::Restart;

#[test]
fn whoever_hangs_the_simulator_is_served_again_within_2_s_and_says_why() {
    let firmware = Firmware::prepare(Warnings::Shown).expect("QEMU");
    for (core, level, why) in [
        (&CORES[0], Level::Plant, Restart::Plant),
        (&CORES[0], Level::Drive, Restart::Drive),
        (&CORES[0], Level::Background, Restart::Background),
        (&CORES[2], Level::Plant, Restart::Plant),
    ] {
        let seen = firmware.hang(core, level).expect("it restarts");
        println!("{}, {level:?}: {seen:?}", core.name);
        assert_eq!((seen.why, seen.times), (why, 1), "{level:?}");
        assert_eq!(seen.fault, Fault::Restarted, "{level:?}");
        assert_ne!(seen.mode_before, Mode::Off, "the drives were on");
        assert_eq!(seen.mode, Mode::Off, "{level:?}");
        assert!(seen.dark_s <= 2.0, "{level:?}: dark for {} s", seen.dark_s);
    }
}
