//! What a drive is given, and what it asks for in vain: each feature is one line that must not compile.
#![allow(unused_variables, missing_docs)]

use model_core::drive::Drive;
use model_core::exchange::{Actuators, DriveCommand, DriveStatus, Measurements};
use model_core::plant::Winder;

pub fn step(
    drive: &mut Drive<f32>,
    command: &DriveCommand<f32>,
    measurements: &Measurements<f32>,
    winder: &Winder<f32, 3>,
    actuators: &mut Actuators<f32>,
    status: &mut DriveStatus<f32>,
) {
    let tension = measurements.tension;
    #[cfg(feature = "r_uw")]
    let r_uw = measurements.r_uw;
    #[cfg(feature = "v_uw")]
    let v_uw = measurements.v_uw;
    #[cfg(feature = "state")]
    let state = measurements.state();
    #[cfg(feature = "winder")]
    return drive.step(command, winder, actuators, status);
    #[cfg(feature = "winder_as_command")]
    return drive.step(winder, measurements, actuators, status);
    drive.step(command, measurements, actuators, status);
}
