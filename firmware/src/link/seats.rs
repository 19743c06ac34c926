//! The places of a link: who may stay when there are more clients than places.
//!
//! Not here: who may connect at all, and what a client may do.
//!
//! A newcomer always gets a place. When all are taken, it gets that of a client which has never been answered,
//! the longest connected first; if there is none, that of the client which was answered longest ago. So a storm
//! of connections that ask nothing displaces only itself, and not the PLC.
//!
//! A board with `N` places runs `N` + 1 tasks, each of which accepts, takes a seat and holds it for a session: the
//! last one is for the newcomer while who was displaced still leaves.

use core::cell::RefCell;
use core::future::poll_fn;
use core::task::{Poll, Waker};

use embassy_futures::select::{Either, select};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::RawMutex;

/// `N` places, `N` > 0.
pub struct Seats<M: RawMutex, const N: usize> {
    table: Mutex<M, RefCell<Table<N>>>,
}

struct Table<const N: usize> {
    places: [Option<Occupant>; N],
    /// Arrivals and answers so far: the order of events is what matters, not the time.
    events: u64,
}

struct Occupant {
    /// The event of the arrival.
    arrived: u64,
    /// The event of the last answer.
    answered: Option<u64>,
    /// To be told when the place is lost.
    waker: Option<Waker>,
}

impl<const N: usize> Table<N> {
    fn event(&mut self) -> u64 {
        self.events += 1;
        self.events
    }
}

impl<M: RawMutex, const N: usize> Default for Seats<M, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<M: RawMutex, const N: usize> Seats<M, N> {
    /// All free.
    pub const fn new() -> Self {
        const { assert!(N > 0) };
        let table = Table {
            places: [const { None }; N],
            events: 0,
        };
        Self {
            table: Mutex::new(RefCell::new(table)),
        }
    }

    /// Takes a free place, or else one that has to be left.
    pub fn take(&self) -> Seat<'_, M, N> {
        let (index, arrived, displaced) = self.with(|table| {
            // Nobody comes first, then who was never answered.
            let rank = |i: &usize| table.places[*i].as_ref().map(|o| (o.answered, o.arrived));
            let index = (0..N).min_by_key(rank).unwrap_or_default();
            let arrived = table.event();
            let displaced = table.places[index].replace(Occupant {
                arrived,
                answered: None,
                waker: None,
            });
            (index, arrived, displaced)
        });
        if let Some(waker) = displaced.and_then(|occupant| occupant.waker) {
            waker.wake();
        }
        Seat {
            seats: self,
            index,
            arrived,
        }
    }

    fn with<R>(&self, f: impl FnOnce(&mut Table<N>) -> R) -> R {
        self.table.lock(|table| f(&mut table.borrow_mut()))
    }
}

/// A place that a client has; free again when dropped.
pub struct Seat<'a, M: RawMutex, const N: usize> {
    seats: &'a Seats<M, N>,
    index: usize,
    arrived: u64,
}

impl<M: RawMutex, const N: usize> Seat<'_, M, N> {
    /// The client has been answered.
    pub fn answered(&self) {
        let event = self.seats.with(Table::event);
        self.with(|place| {
            if let Some(occupant) = place {
                occupant.answered = Some(event);
            }
        });
    }

    /// Runs the client's session to its end, or gives `None` as soon as the place goes to another client.
    pub async fn hold<F: Future>(&self, session: F) -> Option<F::Output> {
        let lost = poll_fn(|cx| {
            self.with(|place| match place {
                Some(occupant) => {
                    occupant.waker = Some(cx.waker().clone());
                    Poll::Pending
                }
                None => Poll::Ready(()),
            })
        });
        match select(lost, session).await {
            Either::First(()) => None,
            Either::Second(end) => Some(end),
        }
    }

    /// The place, as long as it is this client's.
    fn with<R>(&self, f: impl FnOnce(&mut Option<Occupant>) -> R) -> R {
        self.seats.with(|table| {
            let place = &mut table.places[self.index];
            match place {
                Some(occupant) if occupant.arrived == self.arrived => f(place),
                _ => f(&mut None),
            }
        })
    }
}

impl<M: RawMutex, const N: usize> Drop for Seat<'_, M, N> {
    fn drop(&mut self) {
        self.with(|place| *place = None);
    }
}

#[cfg(test)]
mod tests {
    use embassy_futures::{block_on, yield_now};
    use embassy_sync::blocking_mutex::raw::NoopRawMutex;

    use super::*;

    /// Held, when looked at now.
    fn is_held<const N: usize>(seat: &Seat<NoopRawMutex, N>) -> bool {
        block_on(seat.hold(yield_now())).is_some()
    }

    fn seats() -> Seats<NoopRawMutex, 3> {
        Seats::new()
    }

    #[test]
    fn a_free_place_displaces_nobody() {
        let seats = seats();
        let [a, b, c] = [(); 3].map(|()| seats.take());
        drop(b);
        let d = seats.take();
        assert!([&a, &c, &d].into_iter().all(is_held));
    }

    #[test]
    fn who_never_asked_goes_before_who_was_answered() {
        let seats = seats();
        let plc = seats.take();
        plc.answered();
        let storm = [(); 20].map(|()| seats.take());
        assert!(is_held(&plc));
        assert_eq!(storm.iter().map(is_held).filter(|held| *held).count(), 2);
        assert!(storm[18..].iter().all(is_held));
    }

    #[test]
    fn the_longest_idle_goes_first() {
        let seats = seats();
        let [a, b, c] = [(); 3].map(|()| seats.take());
        // in another order than they came
        for seat in [&b, &c, &a] {
            seat.answered();
        }
        let d = seats.take();
        d.answered();
        assert_eq!([&a, &b, &c, &d].map(is_held), [true, false, true, true]);
        // a seat that is lost neither counts as answered nor frees another's place
        b.answered();
        drop(b);
        let e = seats.take();
        assert_eq!([&a, &c, &d, &e].map(is_held), [true, false, true, true]);
    }

    #[test]
    fn a_session_that_waits_learns_of_its_loss() {
        let seats = Seats::<NoopRawMutex, 1>::new();
        let seat = seats.take();
        let newcomer = async {
            yield_now().await;
            seats.take()
        };
        let held = seat.hold(core::future::pending::<()>());
        let (lost, _newcomer) = block_on(embassy_futures::join::join(held, newcomer));
        assert_eq!(lost, None);
    }
}
