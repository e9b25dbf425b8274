//! The payload of a VTK XML `DataArray`: numbers as text, base64 or raw bytes, plain or in zlib blocks.
//!
//! Source: VTK XML file formats, <https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html>.

use base64::prelude::{BASE64_STANDARD, Engine};
use flate2::{Compression, read::ZlibDecoder, write::ZlibEncoder};
use std::io::{Read, Write};

/// Uncompressed bytes per zlib block; VTK's own default.
const BLOCK_BYTES: usize = 32768;

/// The number types of VTK arrays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum NumberType {
    Int(usize),
    UInt(usize),
    Float32,
    Float64,
}

impl NumberType {
    /// `None` for strings, bits and what else VTK can hold but a field of numbers cannot.
    pub(super) fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "Int8" => Self::Int(1),
            "Int16" => Self::Int(2),
            "Int32" => Self::Int(4),
            "Int64" => Self::Int(8),
            "UInt8" => Self::UInt(1),
            "UInt16" => Self::UInt(2),
            "UInt32" => Self::UInt(4),
            "UInt64" => Self::UInt(8),
            "Float32" => Self::Float32,
            "Float64" => Self::Float64,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::Int(bytes) | Self::UInt(bytes) => bytes,
            Self::Float32 => 4,
            Self::Float64 => 8,
        }
    }

    /// Numbers one after the other; the types that most bytes are of take the short way.
    fn read_all(self, bytes: &[u8], big_endian: bool) -> Vec<f64> {
        match self {
            Self::Float32 if !big_endian => {
                bytes.as_chunks::<4>().0.iter().map(|b| f64::from(f32::from_le_bytes(*b))).collect()
            }
            Self::Float64 if !big_endian => bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect(),
            Self::Int(8) if !big_endian => {
                bytes.as_chunks::<8>().0.iter().map(|b| i64::from_le_bytes(*b) as f64).collect()
            }
            Self::UInt(1) => bytes.iter().map(|b| f64::from(*b)).collect(),
            _ => bytes.chunks_exact(self.bytes()).map(|b| self.read(b, big_endian)).collect(),
        }
    }

    /// Integers beyond 2^53 lose digits; no node number or label is that large.
    fn read(self, bytes: &[u8], big_endian: bool) -> f64 {
        let mut word = [0u8; 8];
        for (n, &byte) in bytes.iter().enumerate() {
            word[if big_endian { bytes.len() - 1 - n } else { n }] = byte;
        }
        let unsigned = u64::from_le_bytes(word);
        match self {
            Self::Int(width) => ((unsigned << (64 - 8 * width)).cast_signed() >> (64 - 8 * width)) as f64,
            Self::UInt(_) => unsigned as f64,
            Self::Float32 => f64::from(f32::from_bits(unsigned as u32)),
            Self::Float64 => f64::from_bits(unsigned),
        }
    }
}

/// How a file stores the words before and the bytes of its arrays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Storage {
    pub(super) big_endian: bool,
    /// Bytes of a header word: 4 (`UInt32`) or 8 (`UInt64`).
    pub(super) header_bytes: usize,
    pub(super) zlib: bool,
}

/// Bytes still to be read, as they stand or from base64 text.
pub(super) enum Source<'a> {
    Raw(&'a [u8]),
    Base64 { text: &'a [u8], ready: Vec<u8> },
}

impl<'a> Source<'a> {
    pub(super) fn base64(text: &'a [u8]) -> Self {
        Self::Base64 { text, ready: Vec::new() }
    }

    /// The next `count` bytes. Padding in the middle of base64 text ends a group only: writers encode the header
    /// apart from the data, or together with it, as they like.
    fn take(&mut self, count: usize) -> Result<Vec<u8>, String> {
        match self {
            Self::Raw(bytes) => {
                let (taken, rest) = bytes.split_at_checked(count).ok_or_else(|| short(count, bytes.len()))?;
                *bytes = rest;
                Ok(taken.to_vec())
            }
            Self::Base64 { text, ready } => {
                if count > ready.len() + text.len() {
                    return Err(short(count, ready.len() + text.len() / 4 * 3));
                }
                // Text without white space or padding, as most writers have it, at once.
                let (whole, after) = text.split_at(text.len().min(count.saturating_sub(ready.len()) / 3 * 4));
                let before = ready.len();
                match BASE64_STANDARD.decode_vec(whole, ready) {
                    Ok(()) => *text = after,
                    Err(_) => ready.truncate(before),
                }
                let mut group = [0u8; 4];
                let mut filled = 0;
                while ready.len() < count {
                    let Some((&character, rest)) = text.split_first() else {
                        return Err(short(count, ready.len()));
                    };
                    *text = rest;
                    if character.is_ascii_whitespace() {
                        continue;
                    }
                    group[filled] = character;
                    filled += 1;
                    if filled == 4 {
                        filled = 0;
                        let mut decoded = [0u8; 3];
                        let length = BASE64_STANDARD
                            .decode_slice(group, &mut decoded)
                            .map_err(|_| format!("`{}` is not base64", String::from_utf8_lossy(&group)))?;
                        ready.extend_from_slice(&decoded[..length]);
                    }
                }
                let rest = ready.split_off(count);
                Ok(std::mem::replace(ready, rest))
            }
        }
    }
}

fn short(wanted: usize, there: usize) -> String {
    format!("{wanted} bytes are announced, {there} are there")
}

/// Numbers written as text.
pub(super) fn numbers_from_text(text: &str) -> Result<Vec<f64>, String> {
    text.split_ascii_whitespace().map(|word| word.parse().map_err(|_| format!("`{word}` is not a number"))).collect()
}

/// Numbers from bytes in VTK's binary layout.
pub(super) fn numbers_from_bytes(
    mut source: Source<'_>,
    storage: Storage,
    number: NumberType,
) -> Result<Vec<f64>, String> {
    let word = |source: &mut Source<'_>| -> Result<usize, String> {
        let bytes = source.take(storage.header_bytes)?;
        Ok(NumberType::UInt(storage.header_bytes).read(&bytes, storage.big_endian) as usize)
    };
    let first = word(&mut source)?;
    let bytes = if storage.zlib {
        let (block_bytes, last_bytes) = (word(&mut source)?, word(&mut source)?);
        let mut sizes = Vec::new();
        for _ in 0..first {
            sizes.push(word(&mut source)?);
        }
        let mut bytes = Vec::new();
        for (n, &size) in sizes.iter().enumerate() {
            let expected = if n + 1 == first && last_bytes > 0 { last_bytes } else { block_bytes };
            let packed = source.take(size)?;
            let before = bytes.len();
            ZlibDecoder::new(packed.as_slice())
                .take((expected as u64).saturating_add(1))
                .read_to_end(&mut bytes)
                .map_err(|e| format!("zlib block {n}: {e}"))?;
            if bytes.len() - before != expected {
                return Err(format!("zlib block {n} holds {} bytes, not {expected}", bytes.len() - before));
            }
        }
        bytes
    } else {
        source.take(first)?
    };
    if bytes.len() % number.bytes() != 0 {
        return Err(format!("{} bytes are no whole number of values of {} bytes", bytes.len(), number.bytes()));
    }
    Ok(number.read_all(&bytes, storage.big_endian))
}

/// Inline base64 text of zlib blocks with `UInt64` header words, little-endian.
pub(super) fn base64_zlib(bytes: &[u8]) -> String {
    let last = bytes.len() % BLOCK_BYTES;
    let blocks: Vec<Vec<u8>> = bytes.chunks(BLOCK_BYTES).map(deflated).collect();
    let mut header = [blocks.len(), BLOCK_BYTES, last].map(|n| (n as u64).to_le_bytes()).as_flattened().to_vec();
    for block in &blocks {
        header.extend((block.len() as u64).to_le_bytes());
    }
    BASE64_STANDARD.encode(header) + &BASE64_STANDARD.encode(blocks.concat())
}

fn deflated(block: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::new(4));
    encoder.write_all(block).and_then(|()| encoder.finish()).expect("writing to memory does not fail")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_come_back_whatever_their_number() {
        let storage = Storage { big_endian: false, header_bytes: 8, zlib: true };
        for count in [0, 1, BLOCK_BYTES - 1, BLOCK_BYTES, BLOCK_BYTES + 1, 3 * BLOCK_BYTES] {
            let bytes: Vec<u8> = (0..count).map(|n| (n * n % 251) as u8).collect();
            let text = base64_zlib(&bytes);
            let back = numbers_from_bytes(Source::base64(text.as_bytes()), storage, NumberType::UInt(1)).unwrap();
            assert_eq!(back, bytes.iter().map(|&b| f64::from(b)).collect::<Vec<_>>());
        }
    }

    /// Some writers break base64 text into lines, and pad the header apart from the data.
    #[test]
    fn broken_and_padded_text_says_the_same_as_text_in_one_piece() {
        let storage = Storage { big_endian: false, header_bytes: 8, zlib: false };
        let bytes: Vec<u8> = (0..6400u32).map(|n| (n * n % 251) as u8).collect();
        let header = (bytes.len() as u64).to_le_bytes();
        let together = BASE64_STANDARD.encode([&header[..], &bytes].concat());
        let apart = BASE64_STANDARD.encode(header) + &BASE64_STANDARD.encode(&bytes);
        let lines = together.as_bytes().chunks(76).collect::<Vec<_>>().join(&b'\n');
        for number in
            [NumberType::Float64, NumberType::Float32, NumberType::Int(8), NumberType::UInt(1), NumberType::Int(2)]
        {
            let read = |text: &[u8]| numbers_from_bytes(Source::base64(text), storage, number).unwrap();
            let one_by_one: Vec<f64> = bytes.chunks_exact(number.bytes()).map(|b| number.read(b, false)).collect();
            for text in [together.as_bytes(), apart.as_bytes(), &lines] {
                let same = read(text).iter().zip(&one_by_one).all(|(a, b)| a.to_bits() == b.to_bits());
                assert!(same && read(text).len() == one_by_one.len(), "{number:?}");
            }
        }
    }

    #[test]
    fn signed_numbers_keep_their_sign_in_both_byte_orders() {
        assert_eq!(NumberType::Int(2).read(&(-300i16).to_le_bytes(), false), -300.0);
        assert_eq!(NumberType::Int(2).read(&(-300i16).to_be_bytes(), true), -300.0);
        assert_eq!(NumberType::UInt(4).read(&4_000_000_000u32.to_le_bytes(), false), 4e9);
        assert_eq!(NumberType::Float32.read(&(-1.5f32).to_be_bytes(), true), -1.5);
        assert_eq!(NumberType::Float64.read(&0.1f64.to_le_bytes(), false), 0.1);
    }

    #[test]
    fn announced_bytes_that_are_not_there_are_refused() {
        let storage = Storage { big_endian: false, header_bytes: 4, zlib: false };
        let mut bytes = 16u32.to_le_bytes().to_vec();
        bytes.extend([0; 15]);
        let message = numbers_from_bytes(Source::Raw(&bytes), storage, NumberType::Float64).unwrap_err();
        assert_eq!(message, "16 bytes are announced, 15 are there");
        let huge = u32::MAX.to_le_bytes();
        assert!(numbers_from_bytes(Source::Raw(&huge), storage, NumberType::Float64).is_err());
    }
}
