//! The winder, its web and its drives.
#![no_std]
#![forbid(unsafe_code)]
