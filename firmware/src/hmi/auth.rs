//! The password and the sessions: who may change something.
//!
//! Not here: reading, which everybody may; keeping the password over a power-down.
//!
//! There is no password at first, and none that ships: the first who comes sets it. It is kept as PBKDF2 makes it
//! (RFC 8018, HMAC-SHA-256), so that what is read out of the memory is not what somebody uses elsewhere, too. A
//! session's token is an HMAC under that secret: nobody who does not know the password can guess it, on a board
//! without random numbers as well.

use core::fmt::Write as _;

use embassy_futures::yield_now;
use embassy_time::{Duration, Instant};
use heapless::{String, Vec};
use hmac::{Hmac, KeyInit, Mac};
use sha2::{Digest, Sha256};

/// Shortest and longest password, in bytes.
pub const PASSWORD_BYTES: core::ops::RangeInclusive<usize> = 8..=64;
/// Rounds of PBKDF2: some tens of milliseconds of the microcontroller.
const ROUNDS: u32 = 4096;
/// Rounds at a time, a fraction of a millisecond: then it is the other tasks' turn.
const ROUNDS_AT_ONCE: u32 = 16;
/// Who has logged in and not out again; the one who came first goes when there is another.
const SESSIONS: usize = 8;
/// Wrong passwords that cost no time.
const FREE_TRIES: u32 = 3;
/// The longest pause after a wrong password doubles up to 2 to the power of this, s.
const LONGEST_PAUSE: u32 = 6;

/// A hash.
pub type Hash = [u8; 32];

/// A session's token, as hexadecimal digits.
pub type Token = String<64>;

/// A password, as it is kept.
#[derive(Clone, Copy, Debug)]
pub struct Secret {
    salt: Hash,
    hash: Hash,
}

impl Secret {
    /// The secret of a new password; `moment` makes its salt another than that of the next.
    pub async fn new(password: &str, moment: u64) -> Self {
        let salt: Hash = Sha256::digest(moment.to_le_bytes()).into();
        let hash = stretch(password, &salt).await;
        Self { salt, hash }
    }

    /// Whether this is the password.
    pub async fn is(&self, password: &str) -> bool {
        same(&stretch(password, &self.salt).await, &self.hash)
    }
}

/// PBKDF2 with HMAC-SHA-256, one block. Source: RFC 8018, section 5.2.
async fn stretch(password: &str, salt: &[u8]) -> Hash {
    let keyed = keyed(password.as_bytes());
    let mut round = digest(keyed.clone(), &[salt, &1_u32.to_be_bytes()]);
    let mut sum = round;
    for i in 1..ROUNDS {
        round = digest(keyed.clone(), &[&round]);
        sum.iter_mut().zip(round).for_each(|(s, r)| *s ^= r);
        if i % ROUNDS_AT_ONCE == 0 {
            yield_now().await;
        }
    }
    sum
}

fn keyed(key: &[u8]) -> Hmac<Sha256> {
    match Hmac::new_from_slice(key) {
        Ok(keyed) => keyed,
        // A key of HMAC has any length.
        Err(_) => Hmac::new(&Default::default()),
    }
}

fn digest(mut keyed: Hmac<Sha256>, parts: &[&[u8]]) -> Hash {
    parts.iter().for_each(|part| keyed.update(part));
    keyed.finalize().into_bytes().into()
}

/// Compares in a time that does not tell where they differ.
fn same(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len() && a.iter().zip(b).fold(0, |sum, (a, b)| sum | (a ^ b)) == 0
}

/// Who may.
#[derive(Debug)]
pub struct Auth {
    secret: Option<Secret>,
    sessions: Vec<Token, SESSIONS>,
    issued: u64,
    failures: u32,
    /// Before then, no password is looked at.
    pause: Instant,
}

impl Auth {
    /// Nobody has set a password.
    pub const fn new() -> Self {
        Self {
            secret: None,
            sessions: Vec::new(),
            issued: 0,
            failures: 0,
            pause: Instant::MIN,
        }
    }

    /// The password, if there is one.
    pub fn secret(&self) -> Option<Secret> {
        self.secret
    }

    /// A token belongs to a session.
    pub fn knows(&self, token: &str) -> bool {
        self.sessions
            .iter()
            .any(|session| same(session.as_bytes(), token.as_bytes()))
    }

    /// Seconds until the next password may be tried; 0 when it may.
    pub fn pause_s(&self, now: Instant) -> u64 {
        let pause = self.pause.saturating_duration_since(now);
        pause.as_millis().div_ceil(1000)
    }

    /// Counts a try before it is looked at, so that many at once are no way around the pause.
    pub fn try_once(&mut self, now: Instant) {
        self.failures = self.failures.saturating_add(1);
        if let Some(more) = self.failures.checked_sub(FREE_TRIES) {
            self.pause = now + Duration::from_secs(1 << more.min(LONGEST_PAUSE));
        }
    }

    /// A new password: all sessions end.
    pub fn set(&mut self, secret: Secret) {
        self.secret = Some(secret);
        self.sessions.clear();
    }

    /// A session for who knew the password; none when there is none.
    pub fn begin(&mut self, now: Instant) -> Option<Token> {
        let secret = self.secret?;
        (self.failures, self.pause) = (0, Instant::MIN);
        self.issued += 1;
        let parts = [self.issued.to_le_bytes(), now.as_ticks().to_le_bytes()];
        let hash = digest(keyed(&secret.hash), &[&parts[0], &parts[1]]);
        let mut token = Token::new();
        hash.iter().for_each(|byte| {
            // Two digits a byte fit.
            let _ = write!(token, "{byte:02x}");
        });
        if self.sessions.is_full() {
            self.sessions.remove(0);
        }
        let _ = self.sessions.push(token.clone());
        Some(token)
    }

    /// A session ends.
    pub fn end(&mut self, token: &str) {
        self.sessions.retain(|session| session != token);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embassy_futures::block_on;

    /// Made with another implementation: Python's `hashlib.pbkdf2_hmac("sha256", b"password", b"salt", 4096)`.
    #[test]
    fn the_hash_is_pbkdf2() {
        let hash = block_on(stretch("password", b"salt"));
        let expected = [
            0xc5, 0xe4, 0x78, 0xd5, 0x92, 0x88, 0xc8, 0x41, 0xaa, 0x53, 0x0d, 0xb6, 0x84, 0x5c,
            0x4c, 0x8d, 0x96, 0x28, 0x93, 0xa0, 0x01, 0xce, 0x4e, 0x11, 0xa4, 0x96, 0x38, 0x73,
            0xaa, 0x98, 0x13, 0x4a,
        ];
        assert_eq!(hash, expected);
    }

    #[test]
    fn only_the_password_is_the_password() {
        let secret = block_on(Secret::new("correct horse", 7));
        assert!(block_on(secret.is("correct horse")));
        for other in ["", "correct horsf", "correct horse "] {
            assert!(!block_on(secret.is(other)), "{other}");
        }
    }

    #[test]
    fn sessions_begin_and_end_and_are_not_too_many() {
        let mut auth = Auth::new();
        assert_eq!(auth.begin(Instant::MIN), None);
        auth.set(block_on(Secret::new("correct horse", 7)));
        let tokens: std::vec::Vec<_> = (0..=SESSIONS)
            .filter_map(|_| auth.begin(Instant::MIN))
            .collect();
        assert!(!auth.knows(&tokens[0]) && tokens[1..].iter().all(|token| auth.knows(token)));
        auth.end(&tokens[1]);
        assert!(!auth.knows(&tokens[1]) && !auth.knows(""));
        auth.set(block_on(Secret::new("battery staple", 8)));
        assert!(tokens.iter().all(|token| !auth.knows(token)));
    }

    #[test]
    fn wrong_passwords_take_longer_and_longer() {
        let (mut auth, mut now) = (Auth::new(), Instant::from_secs(10));
        let pauses: std::vec::Vec<_> = (0..12)
            .map(|_| {
                auth.try_once(now);
                let pause = auth.pause_s(now);
                now += Duration::from_secs(pause);
                assert_eq!(auth.pause_s(now), 0);
                pause
            })
            .collect();
        assert_eq!(pauses, [0, 0, 1, 2, 4, 8, 16, 32, 64, 64, 64, 64]);
    }
}
