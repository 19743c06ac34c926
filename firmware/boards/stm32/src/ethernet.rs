//! The Ethernet and where its address comes from.
//!
//! Does not know what is said on a connection. An unplugged cable stops nothing: the address comes when the cable does.

// What is initialized where it is.
#![allow(unsafe_code)]

use core::mem::MaybeUninit;

use embassy_executor::Spawner;
use embassy_net::{Config, Runner, Stack, StackResources};
use embassy_stm32::eth::{self, Ethernet, GenericPhy, PacketQueue, Sma};
use embassy_stm32::peripherals::{
    ETH, ETH_SMA, PA1, PA2, PA7, PB13, PC1, PC4, PC5, PG11, PG13, RNG,
};
use embassy_stm32::rng::{self, Rng};
use embassy_stm32::{Peri, bind_interrupts, uid};
use firmware::net;
use firmware::store::Network;

use crate::watchdog::LIFE;

bind_interrupts!(struct Irqs {
    ETH => eth::InterruptHandler;
    RNG => rng::InterruptHandler<RNG>;
});

type Device = Ethernet<'static, ETH, GenericPhy<Sma<'static, ETH_SMA>>>;

/// Sockets beside those of the links: that of DHCP.
pub const OTHER_SOCKETS: usize = 1;

/// What the Ethernet takes of the chip: RMII as all boards NUCLEO-144 are wired (UM2407, table 12; UM1974, table 12), and
/// random numbers.
pub struct Pins {
    /// The controller.
    pub eth: Peri<'static, ETH>,
    /// Its way to the transceiver's registers: MDIO, MDC.
    pub sma: (
        Peri<'static, ETH_SMA>,
        Peri<'static, PA2>,
        Peri<'static, PC1>,
    ),
    /// REF_CLK, CRS_DV.
    pub clock: (Peri<'static, PA1>, Peri<'static, PA7>),
    /// RXD0, RXD1.
    pub rx: (Peri<'static, PC4>, Peri<'static, PC5>),
    /// TXD0, TXD1, TX_EN.
    pub tx: (
        Peri<'static, PG13>,
        Peri<'static, PB13>,
        Peri<'static, PG11>,
    ),
    /// For sequence numbers that nobody guesses.
    pub rng: Peri<'static, RNG>,
}

/// Takes the pins of [`Pins`] out of the chip's peripherals.
#[macro_export]
macro_rules! ethernet_pins {
    ($p:ident) => {
        $crate::ethernet::Pins {
            eth: $p.ETH,
            sma: ($p.ETH_SMA, $p.PA2, $p.PC1),
            clock: ($p.PA1, $p.PA7),
            rx: ($p.PC4, $p.PC5),
            tx: ($p.PG13, $p.PB13, $p.PG11),
            rng: $p.RNG,
        }
    };
}

/// Frames that wait, where they are: they are too many for a stack.
pub fn frames<const TX: usize, const RX: usize>(
    place: &'static mut MaybeUninit<PacketQueue<TX, RX>>,
) -> &'static mut PacketQueue<TX, RX> {
    PacketQueue::init(place);
    // SAFETY: the line above has initialized all of it.
    unsafe { place.assume_init_mut() }
}

/// Starts the network, with frames where the Ethernet's DMA reaches them. Runs in the background, where everything of
/// the network stays.
pub fn start<const TX: usize, const RX: usize, const SOCKETS: usize>(
    spawner: Spawner,
    p: Pins,
    frames: &'static mut PacketQueue<TX, RX>,
    resources: &'static mut StackResources<SOCKETS>,
    network: Network,
) -> Stack<'static> {
    let seed = Rng::new(p.rng, Irqs).next_u64();
    let device = Ethernet::new(
        frames,
        p.eth,
        Irqs,
        p.clock.0,
        p.clock.1,
        p.rx.0,
        p.rx.1,
        p.tx.0,
        p.tx.1,
        p.tx.2,
        net::hardware_address(&uid::uid()),
        p.sma.0,
        p.sma.1,
        p.sma.2,
    );
    let mut config = Config::default();
    config.ipv4 = net::address(network);
    let (stack, runner) = embassy_net::new(device, config, resources, seed);

    spawner.spawn(run(runner).expect("one runner"));
    if network == Network::Dhcp {
        spawner.spawn(fall_back(stack).expect("first"));
    }
    stack
}

#[embassy_executor::task]
async fn run(runner: Runner<'static, Device>) -> ! {
    net::run(runner, &LIFE).await
}

#[embassy_executor::task]
async fn fall_back(stack: Stack<'static>) -> ! {
    net::fall_back(stack, |address| {
        // As bytes: interrupts are off for as long as a line of the log is written.
        let (bytes, prefix) = (address.address().octets(), address.prefix_len());
        defmt::info!("address {=[u8; 4]}/{=u8}", bytes, prefix);
    })
    .await
}
