//! The PLC's program against the simulator's own parts, in lockstep: no network, no clock.

use host_tests::plc::{Plc, Recipe, Sample, Trouble, wind_in_lockstep};
use host_tests::report::Report;
use model_core::image::{self, Feedback};
use model_core::machine::Machine;
use model_core::simulator::Simulator;

type Winder = Simulator<f32, 3>;

/// Winds a set on a NEWS-8000; what the PLC saw, or what it complained about.
fn wind(recipe: &Recipe) -> Result<Vec<Sample>, Trouble> {
    wind_with(recipe, |_, _| ())
}

/// As [`wind`], with something that befalls the winder.
fn wind_with(
    recipe: &Recipe,
    accident: impl FnMut(&mut Winder, &Sample),
) -> Result<Vec<Sample>, Trouble> {
    wind_in_lockstep(&Machine::news_8000(), recipe, accident)
}

fn recipe(diameter_m: f64, speed_m_min: f64) -> Recipe {
    Recipe {
        machine: Machine::news_8000(),
        diameter_m,
        speed_m_s: speed_m_min / 60.0,
    }
}

#[test]
fn any_set_is_wound_within_its_limits() {
    // the default set; one too small to reach its speed; a slow one; the whole one
    for (diameter_m, speed_m_min) in [(0.40, 1200.0), (0.15, 2200.0), (0.13, 60.0), (1.25, 2200.0)]
    {
        let recipe = recipe(diameter_m, speed_m_min);
        let samples = wind(&recipe).unwrap_or_else(|trouble| panic!("{diameter_m} m: {trouble}"));
        let report = Report::of(&recipe, &samples);
        assert!(report.missed().is_empty(), "{diameter_m} m:\n{report}");
        let last = samples.last().unwrap();
        assert!(
            last.t_s < 30.0 + 1.2 * recipe.duration_s(),
            "{} s",
            last.t_s
        );
        let length = last.value(&image::LENGTH_WU);
        assert!(
            (length / recipe.set_length_m() - 1.0).abs() < 0.02,
            "{length} m"
        );
    }
}

/// The true roll, not only its measurement: within 1 mm of what was wanted, whatever the speed and the size.
#[test]
fn a_normal_stop_ends_at_the_diameter_within_a_millimetre() {
    for (diameter_m, speed_m_min) in [
        (0.13, 60.0),
        (0.15, 2200.0),
        (0.40, 300.0),
        (0.40, 1200.0),
        (0.75, 2200.0),
        (1.25, 2200.0),
    ] {
        let mut truth = 0.0;
        wind_with(&recipe(diameter_m, speed_m_min), |winder, _| {
            truth = 2.0 * f64::from(winder.plant.winder().state().r_wu);
        })
        .unwrap_or_else(|trouble| panic!("{diameter_m} m: {trouble}"));
        let error = 1e3 * (truth - diameter_m);
        assert!(
            error.abs() < 1.0,
            "{diameter_m} m at {speed_m_min} m/min: {error} mm"
        );
    }
}

#[test]
fn a_refusal_ends_the_set_and_names_step_reason_and_state() {
    let mut recipe = recipe(0.40, 1200.0);
    recipe.machine.parent_roll.full_radius_m = 1.6;
    let trouble = wind(&recipe).unwrap_err().to_string();
    for part in [
        "reason 7: the diameter preset is not between spool and full roll",
        "step \"diameter preset\"",
        "mode 0: drives off",
        "d_uw 3000.0 mm",
    ] {
        assert!(trouble.contains(part), "{trouble:?} lacks {part:?}");
    }
}

#[test]
fn a_web_break_ends_the_set() {
    let trouble = wind_with(&recipe(0.40, 1200.0), |winder, sample| {
        if sample.value(&image::D_WU) > 200.0 {
            winder.plant.winder_mut().break_web();
        }
    });
    let trouble = trouble.unwrap_err().to_string();
    assert!(
        trouble.starts_with("the drives report fault 2: web break (step \"run\""),
        "{trouble}"
    );
    assert!(trouble.contains("mode 8: web-break stop"), "{trouble}");
}

#[test]
fn a_machine_that_does_not_answer_ends_the_set_at_the_step_s_time_limit() {
    let mut plc = Plc::new(recipe(0.40, 1200.0));
    let mut feedback = Feedback::default();
    let trouble = (0..)
        .find_map(|tick| {
            feedback.set_double(&image::PLANT_TICKS, (u32::MAX - 100).wrapping_add(tick));
            plc.cycle(&feedback).err()
        })
        .unwrap()
        .to_string();
    assert!(trouble.contains("not done within 5 s"), "{trouble}");
    assert!(trouble.contains("step \"new rolls\""), "{trouble}");
}
