//! QEMU's plugin interface for plugins without unsafe code of their own.
//!
//! Not here: the whole interface. It is QEMU's plugin API, version 1 (`qemu-plugin.h`), declared as far as the
//! plugins of this workspace use it: they look at code as it is translated, put calls and counters into it, and
//! hear of the end.
//!
//! A plugin is a type that implements [`Plugin`], in a `cdylib` that names it in [`plugin!`].

// A C interface, called by C.
#![allow(unsafe_code)]

use std::ffi::{CStr, c_char, c_int, c_uint, c_void};
use std::marker::PhantomData;
use std::sync::OnceLock;
use std::sync::atomic::AtomicU64;

/// `QEMU_PLUGIN_CB_NO_REGS`: the callback looks at no register.
const CB_NO_REGS: c_int = 0;
/// `QEMU_PLUGIN_INLINE_ADD_U64`: add a number to a counter.
const INLINE_ADD_U64: c_int = 0;
/// `QEMU_PLUGIN_MEM_RW`: reads and writes. QEMU 7.2 mistakes the one for the other when only one is wanted, so the
/// callback chooses.
const MEM_READ_WRITE: c_int = 3;

type PluginId = u64;

#[repr(C)]
struct RawBlock {
    _opaque: [u8; 0],
}

#[repr(C)]
struct RawInstruction {
    _opaque: [u8; 0],
}

unsafe extern "C" {
    fn qemu_plugin_register_vcpu_tb_trans_cb(
        id: PluginId,
        callback: unsafe extern "C" fn(PluginId, *mut RawBlock),
    );
    fn qemu_plugin_register_atexit_cb(
        id: PluginId,
        callback: unsafe extern "C" fn(PluginId, *mut c_void),
        data: *mut c_void,
    );
    fn qemu_plugin_tb_n_insns(block: *const RawBlock) -> usize;
    fn qemu_plugin_tb_get_insn(block: *const RawBlock, index: usize) -> *mut RawInstruction;
    fn qemu_plugin_register_vcpu_tb_exec_inline(
        block: *mut RawBlock,
        operation: c_int,
        counter: *mut c_void,
        number: u64,
    );
    fn qemu_plugin_register_vcpu_insn_exec_inline(
        instruction: *mut RawInstruction,
        operation: c_int,
        counter: *mut c_void,
        number: u64,
    );
    fn qemu_plugin_register_vcpu_mem_cb(
        instruction: *mut RawInstruction,
        callback: unsafe extern "C" fn(c_uint, u32, u64, *mut c_void),
        flags: c_int,
        access: c_int,
        data: *mut c_void,
    );
    fn qemu_plugin_mem_is_store(access: u32) -> bool;
    fn qemu_plugin_insn_data(instruction: *const RawInstruction) -> *const c_void;
    fn qemu_plugin_insn_size(instruction: *const RawInstruction) -> usize;
    fn qemu_plugin_insn_vaddr(instruction: *const RawInstruction) -> u64;
    fn qemu_plugin_insn_symbol(instruction: *const RawInstruction) -> *const c_char;
    fn qemu_plugin_register_vcpu_insn_exec_cb(
        instruction: *mut RawInstruction,
        callback: unsafe extern "C" fn(c_uint, *mut c_void),
        flags: c_int,
        data: *mut c_void,
    );
}

/// What a plugin does.
pub trait Plugin: Sized + Send + Sync + 'static {
    /// Its name in error messages.
    const NAME: &'static str;

    /// The plugin, from its arguments; an error says what is wrong with them.
    fn new(arguments: &[String]) -> Result<Self, String>;

    /// Looks at newly translated code.
    fn translated(&self, block: &Block<'_>);

    /// An instruction is about to be executed that [`Instruction::call`] was asked for.
    fn executed(&self, value: usize);

    /// An instruction that [`Instruction::watch`] was asked for has accessed memory.
    fn accessed(&self, value: usize, address: u64) {
        let _ = (value, address);
    }

    /// QEMU ends.
    fn ended(&self) {}
}

/// A plugin that QEMU can load: [`plugin!`] implements it.
pub trait Loaded: Plugin {
    /// Where the one instance is, once it is installed.
    fn cell() -> &'static OnceLock<Self>;
}

/// Code that QEMU translates and executes in one piece.
pub struct Block<'a> {
    block: *mut RawBlock,
    translation: PhantomData<&'a ()>,
}

/// An instruction of a block.
pub struct Instruction<'a> {
    instruction: *mut RawInstruction,
    translation: PhantomData<&'a ()>,
}

impl<'a> Block<'a> {
    /// How many instructions it has.
    pub fn len(&self) -> usize {
        // SAFETY: the block is QEMU's for the time of the translation, which `'a` does not outlive.
        unsafe { qemu_plugin_tb_n_insns(self.block) }
    }

    /// It has no instruction.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Its instructions in order.
    pub fn instructions(&self) -> impl Iterator<Item = Instruction<'a>> {
        (0..self.len()).map(|index| Instruction {
            // SAFETY: as in `len`; the index is within the block.
            instruction: unsafe { qemu_plugin_tb_get_insn(self.block, index) },
            translation: PhantomData,
        })
    }

    /// Whenever the block begins, a number is added to a counter; this costs next to nothing.
    pub fn count(&self, counter: &'static AtomicU64, number: u64) {
        let counter = counter.as_ptr().cast();
        // SAFETY: as in `len`; the counter lives as long as the process.
        unsafe {
            qemu_plugin_register_vcpu_tb_exec_inline(self.block, INLINE_ADD_U64, counter, number);
        }
    }
}

/// What an instruction does to memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// It reads.
    Read,
    /// It writes.
    Write,
}

impl Instruction<'_> {
    /// Its address.
    pub fn address(&self) -> u64 {
        // SAFETY: as for the block.
        unsafe { qemu_plugin_insn_vaddr(self.instruction) }
    }

    /// Its bytes, as they stand in memory.
    pub fn bytes(&self) -> &[u8] {
        // SAFETY: as for the block; QEMU has as many bytes there as it says.
        unsafe {
            let data = qemu_plugin_insn_data(self.instruction).cast();
            std::slice::from_raw_parts(data, qemu_plugin_insn_size(self.instruction))
        }
    }

    /// Whenever it is executed, one is added to a counter. Unlike [`Block::count`] this is exact also where a block is
    /// left before its end, by an exception or an access to a device.
    pub fn count(&self, counter: &'static AtomicU64) {
        let counter = counter.as_ptr().cast();
        // SAFETY: as for the block; the counter lives as long as the process.
        unsafe {
            qemu_plugin_register_vcpu_insn_exec_inline(
                self.instruction,
                INLINE_ADD_U64,
                counter,
                1,
            );
        }
    }

    /// After each of its accesses to memory of a kind, [`Plugin::accessed`] is called with a value.
    pub fn watch<P: Loaded>(&self, access: Access, value: usize) {
        let value = std::ptr::without_provenance_mut(value);
        let callback = match access {
            Access::Read => on_access::<P, false>,
            Access::Write => on_access::<P, true>,
        };
        // SAFETY: as for the block; the callback has the type that QEMU expects and stays loaded.
        unsafe {
            qemu_plugin_register_vcpu_mem_cb(
                self.instruction,
                callback,
                CB_NO_REGS,
                MEM_READ_WRITE,
                value,
            );
        }
    }

    /// The guest's function that it belongs to.
    pub fn symbol(&self) -> Option<&CStr> {
        // SAFETY: as for the block; the name is terminated and QEMU's own.
        unsafe {
            let symbol = qemu_plugin_insn_symbol(self.instruction);
            (!symbol.is_null()).then(|| CStr::from_ptr(symbol))
        }
    }

    /// Before it is executed, [`Plugin::executed`] is called with a value.
    pub fn call<P: Loaded>(&self, value: usize) {
        let value = std::ptr::without_provenance_mut(value);
        // SAFETY: as for the block; the callback has the type that QEMU expects and stays loaded.
        unsafe {
            qemu_plugin_register_vcpu_insn_exec_cb(
                self.instruction,
                on_execution::<P>,
                CB_NO_REGS,
                value,
            );
        }
    }
}

unsafe extern "C" fn on_translation<P: Loaded>(_: PluginId, block: *mut RawBlock) {
    if let Some(plugin) = P::cell().get() {
        plugin.translated(&Block {
            block,
            translation: PhantomData,
        });
    }
}

unsafe extern "C" fn on_execution<P: Loaded>(_cpu: c_uint, value: *mut c_void) {
    if let Some(plugin) = P::cell().get() {
        plugin.executed(value.addr());
    }
}

unsafe extern "C" fn on_access<P: Loaded, const WRITE: bool>(
    _cpu: c_uint,
    access: u32,
    address: u64,
    value: *mut c_void,
) {
    // SAFETY: a function of the description alone.
    let writes = unsafe { qemu_plugin_mem_is_store(access) };
    if writes == WRITE
        && let Some(plugin) = P::cell().get()
    {
        plugin.accessed(value.addr(), address);
    }
}

unsafe extern "C" fn on_end<P: Loaded>(_: PluginId, _: *mut c_void) {
    if let Some(plugin) = P::cell().get() {
        plugin.ended();
    }
}

/// Installs a plugin: what [`plugin!`] lets QEMU call. Anything but 0 makes QEMU give up.
///
/// # Safety
/// `argv` has `argc` terminated strings.
pub unsafe fn install<P: Loaded>(id: u64, argc: c_int, argv: *const *const c_char) -> c_int {
    let argument = |index: c_int| {
        // SAFETY: promised by the caller.
        let text = unsafe { CStr::from_ptr(*argv.add(index as usize)) };
        text.to_string_lossy().into_owned()
    };
    let arguments: Vec<String> = (0..argc).map(argument).collect();
    match P::new(&arguments) {
        Ok(plugin) => drop(P::cell().set(plugin)),
        Err(error) => {
            eprintln!("{}: {error}", P::NAME);
            return -1;
        }
    }
    // SAFETY: the callbacks have the types that QEMU expects and stay loaded.
    unsafe {
        qemu_plugin_register_vcpu_tb_trans_cb(id, on_translation::<P>);
        qemu_plugin_register_atexit_cb(id, on_end::<P>, std::ptr::null_mut());
    }
    0
}

/// Makes a type the plugin of this library: defines what QEMU looks for in it.
#[macro_export]
macro_rules! plugin {
    ($plugin:ty) => {
        static PLUGIN: ::std::sync::OnceLock<$plugin> = ::std::sync::OnceLock::new();

        impl $crate::Loaded for $plugin {
            fn cell() -> &'static ::std::sync::OnceLock<Self> {
                &PLUGIN
            }
        }

        /// The plugin API version this was written against; QEMU reads it before anything else.
        #[unsafe(no_mangle)]
        #[allow(non_upper_case_globals)] // The name is QEMU's.
        pub static qemu_plugin_version: ::std::ffi::c_int = 1;

        /// QEMU's entry.
        ///
        /// # Safety
        /// QEMU calls it, once, with `argc` strings in `argv`.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn qemu_plugin_install(
            id: u64,
            _info: *const ::std::ffi::c_void,
            argc: ::std::ffi::c_int,
            argv: *const *const ::std::ffi::c_char,
        ) -> ::std::ffi::c_int {
            // SAFETY: as QEMU promises.
            unsafe { $crate::install::<$plugin>(id, argc, argv) }
        }
    };
}
