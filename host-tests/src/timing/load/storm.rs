//! A packet storm on the cable.
//!
//! Not here: what else a network may do to a guest; the storms of `--test network` are in real time.

use anyhow::{Result, ensure};

use super::{Frame, GUEST, GUEST_MAC, Load, Traffic};

/// A flood of small frames at the rate of a cable of 100 Mbit/s: all that a guest takes for its own, and what it does
/// not.
pub struct Storm {
    state: u32,
    sent: u64,
    answered: u64,
}

/// The shortest frame takes 84 bytes of the cable (IEEE 802.3: with preamble, checksum and gap): 148 in a millisecond.
const STORM_FRAMES: usize = 100_000 / (8 * 84);
/// Ethernet's shortest frame without its checksum, bytes.
const SHORTEST: usize = 60;

impl Storm {
    pub fn new() -> Self {
        Self {
            // any but 0
            state: 0x9e37_79b9,
            sent: 0,
            answered: 0,
        }
    }

    /// Xorshift. Source: G. Marsaglia, J. Stat. Softw. 8 (2003) 14.
    fn random(&mut self) -> u32 {
        self.state ^= self.state << 13;
        self.state ^= self.state >> 17;
        self.state ^= self.state << 5;
        self.state
    }

    fn frame(&mut self) -> Frame {
        let (r, kind) = (self.random().to_be_bytes(), self.random() % 6);
        let to = if kind < 2 { [0xff; 6] } else { GUEST_MAC };
        let mut frame = to.to_vec();
        frame.extend([0x02, 0, r[0], r[1], r[2], r[3]]);
        let from = [10, 0, 2, 16 + r[3] % 200];
        match kind {
            // ARP: who has the guest's address, who has another
            0 | 1 => {
                frame.extend([0x08, 0x06, 0, 1, 8, 0, 6, 4, 0, 1]);
                frame.extend([0x02, 0, r[0], r[1], r[2], r[3]]);
                frame.extend(from);
                frame.extend([0; 6]);
                frame.extend([10, 0, 2, if kind == 0 { 15 } else { 99 }]);
            }
            // a segment that opens a connection to Modbus
            2 => {
                let mut segment = vec![r[0] | 0x80, r[1], 0x01, 0xf6];
                segment.extend(r);
                segment.extend([0, 0, 0, 0, 0x50, 0x02, 0x04, 0, 0, 0, 0, 0]);
                let sum = checksum(&[&pseudo(from, 6, segment.len()), &segment]);
                segment[16..18].copy_from_slice(&sum);
                frame.extend(ip(from, 6, &segment));
            }
            // an echo request
            3 => {
                let mut echo = vec![8, 0, 0, 0];
                echo.extend(r);
                let sum = checksum(&[&echo]);
                echo[2..4].copy_from_slice(&sum);
                frame.extend(ip(from, 1, &echo));
            }
            // a datagram to a port where nobody is
            4 => {
                let mut datagram = vec![r[0] | 0x80, r[1], r[2], r[3], 0, 12, 0, 0];
                datagram.extend(r);
                frame.extend(ip(from, 17, &datagram));
            }
            // noise
            _ => {
                frame.extend([0x08, 0]);
                frame.extend((0..11).flat_map(|_| self.random().to_be_bytes()));
            }
        }
        frame.resize(frame.len().max(SHORTEST), 0);
        frame
    }
}

/// An IPv4 packet to the guest, with its type.
fn ip(from: [u8; 4], protocol: u8, payload: &[u8]) -> Vec<u8> {
    let length = (20 + payload.len()) as u16;
    let mut header = vec![0x45, 0];
    header.extend(length.to_be_bytes());
    header.extend([0, 0, 0x40, 0, 64, protocol, 0, 0]);
    header.extend(from);
    header.extend(GUEST.octets());
    let sum = checksum(&[&header]);
    header[10..12].copy_from_slice(&sum);
    [&[0x08, 0x00], &header[..], payload].concat()
}

fn pseudo(from: [u8; 4], protocol: u8, length: usize) -> Vec<u8> {
    let mut pseudo = from.to_vec();
    pseudo.extend(GUEST.octets());
    pseudo.extend([0, protocol]);
    pseudo.extend((length as u16).to_be_bytes());
    pseudo
}

/// The checksum of the internet (RFC 1071) over parts of even length.
fn checksum(parts: &[&[u8]]) -> [u8; 2] {
    let words = parts.iter().flat_map(|part| part.chunks(2));
    let mut sum: u32 = words
        .map(|word| u32::from(word[0]) << 8 | word.get(1).map_or(0, |low| u32::from(*low)))
        .sum();
    while sum > 0xffff {
        sum = (sum & 0xffff) + (sum >> 16);
    }
    (!(sum as u16)).to_be_bytes()
}

impl Load for Storm {
    fn beat(&mut self, _: u64, heard: Traffic) -> Result<Traffic> {
        self.answered += heard.frames.len() as u64;
        self.sent += STORM_FRAMES as u64;
        let frames = (0..STORM_FRAMES).map(|_| self.frame()).collect();
        Ok(Traffic {
            frames,
            ..Traffic::default()
        })
    }

    fn done(&self) -> Result<String> {
        ensure!(self.answered > 0, "the guest answered none of the frames");
        Ok(format!(
            "{} frames of 60 bytes, {STORM_FRAMES} in 1 ms, {} answered",
            self.sent, self.answered
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An example of RFC 1071, section 3.
    #[test]
    fn the_checksum_is_the_internet_s() {
        let bytes = [0x00, 0x01, 0xf2, 0x03, 0xf4, 0xf5, 0xf6, 0xf7];
        assert_eq!(checksum(&[&bytes]), (!0xddf2_u16).to_be_bytes());
    }

    #[test]
    fn a_storm_is_of_short_frames_and_the_same_every_time() {
        let (mut a, mut b) = (Storm::new(), Storm::new());
        for millisecond in 0..10 {
            let frames = a.beat(millisecond, Traffic::default()).unwrap().frames;
            assert_eq!(frames.len(), STORM_FRAMES);
            assert!(frames.iter().all(|frame| frame.len() == SHORTEST));
            let again = b.beat(millisecond, Traffic::default()).unwrap().frames;
            assert_eq!(frames, again);
        }
    }
}
