//! Modbus, server side.
//!
//! Not here: a client, and function codes beyond the data access that PLCs use. One [`pdu::respond`] serves
//! every transport.

pub mod pdu;
pub mod tcp;
