//! Values that one task leaves for another without keeping interrupts off.
//!
//! Not here: a queue. The latest value counts, and one that nobody took is lost.
//!
//! A value has three places. The writer takes one that neither holds the latest value nor is being read, and then
//! says that this is the latest. So nobody waits: not who preempts a writer, for the latest value is whole, and not who
//! preempts a reader, for what is being read is left alone.

use core::sync::atomic::{AtomicUsize, Ordering};

use atomic_refcell::AtomicRefCell;

/// Enough for one writer and one reader, whichever preempts the other.
const PLACES: usize = 3;

/// The latest value of one writer for one reader.
pub struct Mailbox<T> {
    places: [AtomicRefCell<T>; PLACES],
    latest: AtomicUsize,
}

impl<T: Copy> Mailbox<T> {
    /// With a first value.
    pub fn new(value: T) -> Self {
        Self {
            places: [(); PLACES].map(|()| AtomicRefCell::new(value)),
            latest: AtomicUsize::new(0),
        }
    }

    /// Lets `f` look at the latest value, which stays while it looks.
    pub fn look<U>(&self, f: impl FnOnce(&T) -> U) -> U {
        loop {
            let latest = self.latest.load(Ordering::Acquire);
            // Only where reader and writer run on two cores can it have become the place of a newer value by now.
            if let Some(Ok(value)) = self.places.get(latest).map(AtomicRefCell::try_borrow) {
                return f(&value);
            }
        }
    }

    /// The latest value.
    pub fn get(&self) -> T {
        self.look(|value| *value)
    }

    /// Leaves a value.
    pub fn set(&self, value: T) {
        self.fill(|place| *place = value);
    }

    /// Leaves a value that `f` puts into its place, where an older one stands.
    pub fn fill(&self, f: impl FnOnce(&mut T)) {
        let latest = self.latest.load(Ordering::Relaxed);
        let others = self.places.iter().enumerate().filter(|(i, _)| *i != latest);
        let mut free = others.filter_map(|(i, place)| Some((i, place.try_borrow_mut().ok()?)));
        // Between one writer and one reader there always is one.
        if let Some((i, mut place)) = free.next() {
            f(&mut place);
            self.latest.store(i, Ordering::Release);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_latest_value_counts() {
        let mailbox = Mailbox::new(0);
        for n in 1..10 {
            mailbox.set(n);
            assert_eq!(mailbox.get(), n);
        }
        mailbox.set(10);
        mailbox.set(11);
        assert_eq!(mailbox.get(), 11);
    }

    /// A writer that preempts the reader, as often as it likes.
    #[test]
    fn what_is_being_read_stays() {
        let mailbox = Mailbox::new([0; 8]);
        mailbox.look(|seen| {
            for n in 1..10 {
                mailbox.set([n; 8]);
                assert_eq!(*seen, [0; 8]);
                assert_eq!(mailbox.get(), [n; 8], "for who preempts the reader in turn");
            }
        });
        assert_eq!(mailbox.get(), [9; 8]);
    }

    /// Two threads stand for two cores, which is more than preemption can do.
    #[test]
    fn no_value_is_torn() {
        const VALUES: u32 = 100_000;
        let mailbox = Mailbox::new([0_u32; 64]);
        std::thread::scope(|scope| {
            scope.spawn(|| (1..=VALUES).for_each(|n| mailbox.set([n; 64])));
            let mut last = 0;
            while last < VALUES {
                let seen = mailbox.get();
                assert_eq!(seen, [seen[0]; 64]);
                assert!(seen[0] >= last, "{} after {last}", seen[0]);
                last = seen[0];
            }
        });
    }
}
