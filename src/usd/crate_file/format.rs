//! Constants and codes of the crate format.

#[cfg(target_endian = "big")]
compile_error!("arrays are written as they lie in memory, which must be little endian");

/// The first bytes of a crate file.
pub(super) const MAGIC: &[u8; 8] = b"PXR-USDC";
/// Version written. Applications refuse versions newer than they know, and nothing newer is needed.
pub(super) const VERSION: [u8; 3] = [0, 8, 0];
/// Length of the bootstrap: magic, version, offset of the table of contents, 64 reserved bytes.
pub(super) const BOOTSTRAP_LEN: usize = 88;
/// Length of a section name in the table of contents, padded with NULs.
pub(super) const SECTION_NAME_LEN: usize = 16;
/// Ends a field set.
pub(super) const FIELD_SET_END: u32 = u32::MAX;
/// Integer arrays shorter than this are never compressed.
pub(super) const MIN_COMPRESSED_INTS: usize = 16;
/// Header bits of a list operation: the list replaces weaker ones, and its items follow.
pub(super) const LIST_OP_EXPLICIT: u8 = 1 | 2;
/// Header bit of a list operation: prepended items follow.
pub(super) const LIST_OP_PREPENDED: u8 = 32;

/// Offset and scale of the times of a sublayer or reference that has those of its own.
pub(super) const IDENTITY_OFFSET: [f64; 2] = [0.0, 1.0];

/// Type codes of values.
pub(super) mod kind {
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
    pub const REFERENCE_LIST_OP: u8 = 35;
    pub const TOKEN_VECTOR: u8 = 41;
    pub const SPECIFIER: u8 = 42;
    pub const VARIABILITY: u8 = 44;
    pub const TIME_SAMPLES: u8 = 46;
    pub const DOUBLE_VECTOR: u8 = 48;
    pub const LAYER_OFFSET_VECTOR: u8 = 49;
    pub const STRING_VECTOR: u8 = 50;
    pub const VALUE_BLOCK: u8 = 51;
}

/// Kind codes of specs.
pub(super) mod spec {
    pub const ATTRIBUTE: u32 = 1;
    pub const PRIM: u32 = 6;
    pub const PSEUDO_ROOT: u32 = 7;
    pub const RELATIONSHIP: u32 = 8;
}

/// A value in the tables: bit 63 array, 62 inlined, 61 compressed, bits 48-55 the type, bits 0-47 the value
/// or its offset in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct ValueRep(pub u64);

impl ValueRep {
    pub const ARRAY: u64 = 1 << 63;
    pub const INLINED: u64 = 1 << 62;
    pub const COMPRESSED: u64 = 1 << 61;
    pub const PAYLOAD: u64 = (1 << 48) - 1;

    pub fn inlined(kind: u8, payload: u32) -> Self {
        ValueRep(Self::INLINED | u64::from(kind) << 48 | u64::from(payload))
    }

    pub fn at(kind: u8, offset: u64) -> Self {
        ValueRep(u64::from(kind) << 48 | offset & Self::PAYLOAD)
    }

    /// An array; offset 0 denotes an empty one.
    pub fn array(kind: u8, offset: u64) -> Self {
        ValueRep(Self::at(kind, offset).0 | Self::ARRAY)
    }

    pub fn kind(self) -> u8 {
        (self.0 >> 48) as u8
    }

    pub fn payload(self) -> u64 {
        self.0 & Self::PAYLOAD
    }

    pub fn has(self, flag: u64) -> bool {
        self.0 & flag != 0
    }
}

/// Position of the next path in the pre-order table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Jump {
    /// There is no child; the next entry is a sibling.
    Sibling,
    /// The next entry is the first child; there is no sibling.
    Child,
    /// There is neither child nor sibling.
    Leaf,
    /// The next entry is the first child; the sibling is this many entries ahead.
    Both(i32),
}

impl Jump {
    pub fn code(self) -> i32 {
        match self {
            Jump::Sibling => 0,
            Jump::Child => -1,
            Jump::Leaf => -2,
            Jump::Both(distance) => distance,
        }
    }

    pub fn from_code(code: i32) -> Option<Self> {
        match code {
            0 => Some(Jump::Sibling),
            -1 => Some(Jump::Child),
            -2 => Some(Jump::Leaf),
            distance if distance > 0 => Some(Jump::Both(distance)),
            _ => None,
        }
    }
}
