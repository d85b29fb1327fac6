//! The crate (usdc) encoding, version 0.8.0: writer and reader.
//!
//! A crate file is a bootstrap, the values that do not fit into a `ValueRep`, six sections of
//! tables, and a table of contents. All little endian. Source: AOUSD Core Specification 1.0.1 (2025),
//! "Crate file format", and the behaviour of Pixar's usd-core 26.11.
//!
//! - A *token* is an interned string; a *string* is an index into the tokens by way of a second table.
//! - A *field* is a (name token, value) pair; a *field set* is a run of field indices that ends in −1;
//!   a *spec* is (path, field set, kind). Equal fields and equal field sets are stored once.
//! - Paths are a tree in pre-order; see `Jump`. What relationships and connections point at is in the tree as well,
//!   with or without a spec in this file.

mod decode;
mod encode;
mod integers;
mod source;
mod tables;

pub use decode::decode;
pub use encode::encode;

#[cfg(target_endian = "big")]
compile_error!("arrays are written as they lie in memory, which must be little endian");

/// The first bytes of a crate file.
const MAGIC: &[u8; 8] = b"PXR-USDC";
/// Version written. Older applications refuse a newer one, and nothing newer is needed.
const VERSION: [u8; 3] = [0, 8, 0];
/// Length of the bootstrap: magic, version, offset of the table of contents, 64 bytes kept free.
const BOOTSTRAP_LEN: usize = 88;
/// Length of a section's name in the table of contents, filled with NULs.
const SECTION_NAME_LEN: usize = 16;
/// Ends a field set.
const FIELD_SET_END: u32 = u32::MAX;
/// Integer arrays shorter than this are never compressed.
const MIN_COMPRESSED_INTS: usize = 16;
/// The bits of a list operation's header that say that the list replaces weaker ones, and that its items follow.
const LIST_OP_EXPLICIT: u8 = 1 | 2;
/// The bit that says that prepended items follow.
const LIST_OP_PREPENDED: u8 = 32;

/// Type codes of values.
mod kind {
    pub const BOOL: u8 = 1;
    pub const INT: u8 = 3;
    pub const FLOAT: u8 = 8;
    pub const DOUBLE: u8 = 9;
    pub const STRING: u8 = 10;
    pub const TOKEN: u8 = 11;
    pub const ASSET: u8 = 12;
    pub const MATRIX4D: u8 = 15;
    pub const FLOAT2: u8 = 20;
    pub const FLOAT3: u8 = 24;
    pub const DICTIONARY: u8 = 31;
    pub const TOKEN_LIST_OP: u8 = 32;
    pub const PATH_LIST_OP: u8 = 34;
    pub const TOKEN_VECTOR: u8 = 41;
    pub const SPECIFIER: u8 = 42;
    pub const VARIABILITY: u8 = 44;
    pub const TIME_SAMPLES: u8 = 46;
    pub const DOUBLE_VECTOR: u8 = 48;
    pub const LAYER_OFFSET_VECTOR: u8 = 49;
    pub const STRING_VECTOR: u8 = 50;
}

/// Kind codes of specs.
mod spec {
    pub const ATTRIBUTE: u32 = 1;
    pub const PRIM: u32 = 6;
    pub const PSEUDO_ROOT: u32 = 7;
    pub const RELATIONSHIP: u32 = 8;
}

/// A value as it stands in the tables: bit 63 array, 62 inlined, 61 compressed, bits 48-55 the type,
/// bits 0-47 the value itself or its offset in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct ValueRep(u64);

impl ValueRep {
    const ARRAY: u64 = 1 << 63;
    const INLINED: u64 = 1 << 62;
    const COMPRESSED: u64 = 1 << 61;
    const PAYLOAD: u64 = (1 << 48) - 1;

    fn inlined(kind: u8, payload: u32) -> Self {
        ValueRep(Self::INLINED | u64::from(kind) << 48 | u64::from(payload))
    }

    fn at(kind: u8, offset: u64) -> Self {
        ValueRep(u64::from(kind) << 48 | offset & Self::PAYLOAD)
    }

    /// An array; offset 0 stands for an empty one.
    fn array(kind: u8, offset: u64) -> Self {
        ValueRep(Self::at(kind, offset).0 | Self::ARRAY)
    }

    fn kind(self) -> u8 {
        (self.0 >> 48) as u8
    }

    fn payload(self) -> u64 {
        self.0 & Self::PAYLOAD
    }

    fn has(self, flag: u64) -> bool {
        self.0 & flag != 0
    }
}

/// What follows a path in the pre-order table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Jump {
    /// No child; the next entry is a sibling.
    Sibling,
    /// The next entry is the first child; no sibling follows.
    Child,
    /// Neither.
    Leaf,
    /// The next entry is the first child; the sibling stands this many entries further.
    Both(i32),
}

impl Jump {
    fn code(self) -> i32 {
        match self {
            Jump::Sibling => 0,
            Jump::Child => -1,
            Jump::Leaf => -2,
            Jump::Both(distance) => distance,
        }
    }

    fn from_code(code: i32) -> Option<Self> {
        match code {
            0 => Some(Jump::Sibling),
            -1 => Some(Jump::Child),
            -2 => Some(Jump::Leaf),
            distance if distance > 0 => Some(Jump::Both(distance)),
            _ => None,
        }
    }
}
