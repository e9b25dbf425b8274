//! Gzip with every check on reading, and the same bytes on any number of threads on writing.

use super::error::NiftiProblem;
use flate2::bufread::GzDecoder;
use flate2::{Compress, Compression, Crc, FlushCompress};
use rayon::prelude::*;
use std::io::Read;

/// Deflate packs at most 1032 bytes into one.
const LARGEST_RATIO: u64 = 1032;
/// Bytes after the last voxel that are read on (writers pad) before the header is held to be another file's.
const PADDING: u64 = 1 << 20;

/// Whether the bytes begin as a gzip stream does, whatever the file is called.
pub(super) fn is_gzip(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x1f, 0x8b])
}

fn damaged(error: &std::io::Error) -> NiftiProblem {
    let reason = match error.kind() {
        std::io::ErrorKind::UnexpectedEof => "it ends too early (truncated)".into(),
        _ => error.to_string(),
    };
    NiftiProblem::Gzip { reason }
}

/// The unpacked members of a gzip file, one after the other.
struct Members<'a> {
    decoder: GzDecoder<&'a [u8]>,
    finished: bool,
}

impl<'a> Members<'a> {
    fn new(packed: &'a [u8]) -> Self {
        Self { decoder: GzDecoder::new(packed), finished: false }
    }
}

impl Read for Members<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        while !self.finished && !buffer.is_empty() {
            // At the end of a member the decoder has compared length and CRC before it answers 0.
            let count = self.decoder.read(buffer)?;
            if count > 0 {
                return Ok(count);
            }
            let rest = *self.decoder.get_ref();
            if is_gzip(rest) {
                self.decoder = GzDecoder::new(rest);
            } else {
                // Zeros (tape padding) and anything else behind the last member are not part of the stream.
                self.finished = true;
            }
        }
        Ok(0)
    }
}

/// The first (at most `count`) unpacked bytes.
pub(super) fn head(packed: &[u8], count: usize) -> Result<Vec<u8>, NiftiProblem> {
    let mut bytes = Vec::with_capacity(count);
    Members::new(packed).take(count as u64).read_to_end(&mut bytes).map_err(|e| damaged(&e))?;
    Ok(bytes)
}

/// Unpacks bytes `first..first + count` of a stream that must reach `end`, and reads on to its real end, so that length
/// and CRC are checked. Nothing is reserved that the packed bytes could not fill.
pub(super) fn part(packed: &[u8], first: u64, count: u64, end: u64) -> Result<Vec<u8>, NiftiProblem> {
    let most = packed.len() as u64 * LARGEST_RATIO;
    if end > most {
        // Look for damage first: a cut file should be called cut with the number of bytes that are really there.
        let found = std::io::copy(&mut Members::new(packed).take(end), &mut std::io::sink());
        return Err(NiftiProblem::Truncated { declared: end, found: found.map_err(|e| damaged(&e))? });
    }
    let mut stream = Members::new(packed);
    let skipped = std::io::copy(&mut (&mut stream).take(first), &mut std::io::sink()).map_err(|e| damaged(&e))?;
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(count as usize).map_err(|e| NiftiProblem::Gzip { reason: e.to_string() })?;
    (&mut stream).take(count).read_to_end(&mut bytes).map_err(|e| damaged(&e))?;
    let so_far = skipped + bytes.len() as u64;
    let rest = std::io::copy(&mut (&mut stream).take(end - so_far + PADDING + 1), &mut std::io::sink());
    let found = so_far + rest.map_err(|e| damaged(&e))?;
    if found < end {
        return Err(NiftiProblem::Truncated { declared: end, found });
    }
    if found > end + PADDING {
        return Err(NiftiProblem::TooLong { declared: end, found });
    }
    Ok(bytes)
}

/// Unpacked bytes per task; part of the format's determinism, not to depend on the machine.
const BLOCK: usize = 1 << 20;

/// Packs bytes into one gzip member without name or time.
///
/// Blocks are deflated apart, each flushed to a byte boundary, so that the joined stream is one valid deflate stream
/// (as pigz does it) and its bytes do not depend on the number of threads.
pub(super) fn pack(bytes: Vec<u8>) -> Vec<u8> {
    pack_at(bytes, Compression::new(4))
}

/// The same in less time and a little more room, for the many numbers of a displacement.
pub(super) fn pack_fast(bytes: Vec<u8>) -> Vec<u8> {
    pack_at(bytes, Compression::fast())
}

fn pack_at(bytes: Vec<u8>, level: Compression) -> Vec<u8> {
    let count = bytes.len();
    let last = count.div_ceil(BLOCK).max(1) - 1;
    let packed: Vec<(Vec<u8>, Crc)> = (0..=last)
        .into_par_iter()
        .map(|n| {
            let block = &bytes[n * BLOCK..count.min((n + 1) * BLOCK)];
            let mut crc = Crc::new();
            crc.update(block);
            (deflate(block, n == last, level), crc)
        })
        .collect();
    // Not to be held beside what comes of them.
    drop(bytes);
    let mut out = Vec::with_capacity(packed.iter().map(|(block, _)| block.len()).sum::<usize>() + 18);
    // Magic, deflate, no flags, no time (4), no hint, unknown system: RFC 1952.
    out.extend([0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 255]);
    let mut crc = Crc::new();
    for (block, block_crc) in &packed {
        out.extend_from_slice(block);
        crc.combine(block_crc);
    }
    out.extend_from_slice(&crc.sum().to_le_bytes());
    out.extend_from_slice(&(count as u32).to_le_bytes());
    out
}

/// One block, whole in one call: room is reserved for the worst case, stored blocks. Whether a sync flush that runs out of room
/// can be called again without losing bytes differs from one deflate to another.
fn deflate(block: &[u8], last: bool, level: Compression) -> Vec<u8> {
    let mut compress = Compress::new(level, false);
    let mut out = Vec::with_capacity(block.len() + block.len() / 64 + 1024);
    let flush = if last { FlushCompress::Finish } else { FlushCompress::Sync };
    let status = compress.compress_vec(block, &mut out, flush);
    let whole = compress.total_in() as usize == block.len() && out.len() < out.capacity();
    assert!(whole && status.is_ok(), "a block of {} bytes was not deflated whole: {status:?}", block.len());
    out.shrink_to_fit();
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(count: usize) -> Vec<u8> {
        (0..count as u32).map(|n| (n.wrapping_mul(2654435761) >> (20 + n / 100_000 % 12)) as u8).collect()
    }

    /// Blocks that deflate to a little more than half of their size: a buffer of that half once came out full to its last byte when
    /// the block was all read, and what had not been written yet was lost.
    #[test]
    fn blocks_of_any_compressibility_come_back() {
        for seed in 0..12_u64 {
            let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
            let mut next = || {
                state ^= state << 13;
                state ^= state >> 7;
                state ^= state << 17;
                state >> 40
            };
            let bytes: Vec<u8> = (0..BLOCK + 300).map(|_| if next() % 200 < 57 { next() as u8 } else { 0 }).collect();
            for level in [Compression::fast(), Compression::new(4)] {
                let packed = pack_at(bytes.clone(), level);
                let mut plain = Vec::new();
                GzDecoder::new(&packed[..]).read_to_end(&mut plain).unwrap();
                assert!(plain == bytes, "seed {seed}");
            }
        }
    }

    #[test]
    fn packing_and_unpacking_gives_the_bytes_back() {
        for count in [0, 1, 1000, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK + 77] {
            let bytes = sample(count);
            let packed = pack(bytes.clone());
            assert_eq!(part(&packed, 0, count as u64, count as u64).unwrap(), bytes, "{count}");
            // A plain single-member decoder agrees.
            let mut plain = Vec::new();
            GzDecoder::new(&packed[..]).read_to_end(&mut plain).unwrap();
            assert_eq!(plain, bytes);
        }
    }

    #[test]
    fn bytes_do_not_depend_on_the_number_of_threads() {
        let bytes = sample(5 * BLOCK);
        let with = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(|| pack(bytes.clone()));
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn a_flipped_byte_and_a_cut_are_noticed_and_members_are_joined() {
        let bytes = sample(5000);
        let packed = pack(bytes.clone());
        for place in [10, packed.len() / 2, packed.len() - 6, packed.len() - 2] {
            let mut flipped = packed.clone();
            flipped[place] ^= 0x10;
            assert!(part(&flipped, 0, 5000, 5000).is_err(), "byte {place}");
        }
        assert!(part(&packed[..packed.len() - 3], 0, 5000, 5000).is_err());
        let mut two = pack(bytes[..2000].to_vec());
        two.extend(pack(bytes[2000..].to_vec()));
        two.extend([0; 100]);
        assert_eq!(part(&two, 1500, 1000, 5000).unwrap(), bytes[1500..2500]);
    }

    #[test]
    fn a_bomb_and_a_lie_about_the_size_are_refused() {
        let zeros = pack(vec![0; 8 << 20]);
        assert!(matches!(part(&zeros, 0, 100, 100), Err(NiftiProblem::TooLong { .. })));
        let small = pack(vec![1, 2, 3]);
        let lie = part(&small, 0, 1 << 40, 1 << 40);
        assert_eq!(lie, Err(NiftiProblem::Truncated { declared: 1 << 40, found: 3 }));
    }
}
