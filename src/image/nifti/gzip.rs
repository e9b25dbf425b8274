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

/// Numbers of one size, `count` in each of `RUNS` runs that lie one behind the other in the file.
pub(super) struct Numbers<'a, const RUNS: usize> {
    /// How many a run holds.
    pub count: usize,
    /// Bytes of one.
    pub size: usize,
    /// Writes those from the given one on of every run: made where they are packed, so that a file is never whole in memory unpacked.
    pub write: &'a (dyn Fn(usize, [&mut [u8]; RUNS]) + Sync),
}

/// Packs a header and numbers into one gzip member without name or time.
///
/// Blocks are deflated apart, each flushed to a byte boundary, so that the joined stream is one valid deflate stream
/// (as pigz does it) and its bytes do not depend on the number of threads.
pub(super) fn pack<const RUNS: usize>(header: &[u8], numbers: &Numbers<'_, RUNS>) -> Vec<u8> {
    pack_at(header, numbers, Compression::new(4))
}

/// The same in less time and a little more room, for the many numbers of a displacement.
pub(super) fn pack_fast<const RUNS: usize>(header: &[u8], numbers: &Numbers<'_, RUNS>) -> Vec<u8> {
    pack_at(header, numbers, Compression::fast())
}

/// A block without numbers that ends a deflate stream.
const END: [u8; 2] = [3, 0];

fn pack_at<const RUNS: usize>(header: &[u8], numbers: &Numbers<'_, RUNS>, level: Compression) -> Vec<u8> {
    let &Numbers { count, size, write } = numbers;
    let at_once = (BLOCK / size).max(1);
    let packed: Vec<[Block; RUNS]> = (0..count.div_ceil(at_once))
        .into_par_iter()
        .map_init(
            || (Packer::new(level), vec![0; RUNS * at_once * size]),
            |(packer, bytes), n| {
                let first = n * at_once;
                let room = size * at_once.min(count - first);
                let mut runs = bytes.chunks_exact_mut(at_once * size);
                let mut pieces: [&mut [u8]; RUNS] =
                    std::array::from_fn(|_| &mut runs.next().expect("room for every run")[..room]);
                write(first, pieces.each_mut().map(|piece| &mut **piece));
                pieces.map(|piece| packer.block(piece))
            },
        )
        .collect();
    let head = Packer::new(level).block(header);
    let blocks = || std::iter::once(&head).chain((0..RUNS).flat_map(|run| packed.iter().map(move |made| &made[run])));
    let mut out = Vec::with_capacity(blocks().map(|block| block.packed.len()).sum::<usize>() + 20);
    // Magic, deflate, no flags, no time (4), no hint, unknown system: RFC 1952.
    out.extend([0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 255]);
    let mut crc = Crc::new();
    for block in blocks() {
        out.extend_from_slice(&block.packed);
        crc.combine(&block.crc);
    }
    out.extend(END);
    out.extend_from_slice(&crc.sum().to_le_bytes());
    out.extend_from_slice(&((header.len() + RUNS * count * size) as u32).to_le_bytes());
    out
}

struct Block {
    packed: Vec<u8>,
    crc: Crc,
}

/// What a thread packs one block after the other with.
struct Packer {
    compress: Compress,
    room: Vec<u8>,
}

impl Packer {
    fn new(level: Compression) -> Self {
        Self { compress: Compress::new(level, false), room: Vec::new() }
    }

    /// One block, whole in one call: there is room for the worst case, nine bits for every byte (the fixed code of RFC 1951, which
    /// the fastest level always takes). Whether a sync flush that runs out of room can be called again without losing bytes differs
    /// from one deflate to another.
    fn block(&mut self, bytes: &[u8]) -> Block {
        self.compress.reset();
        self.room.clear();
        self.room.reserve(bytes.len() + bytes.len() / 8 + 1024);
        let status = self.compress.compress_vec(bytes, &mut self.room, FlushCompress::Sync);
        let whole = self.compress.total_in() as usize == bytes.len() && self.room.len() < self.room.capacity();
        assert!(whole && status.is_ok(), "a block of {} bytes was not deflated whole: {status:?}", bytes.len());
        let mut crc = Crc::new();
        crc.update(bytes);
        Block { packed: self.room.as_slice().to_vec(), crc }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers_of(bytes: &[u8]) -> impl Fn(usize, [&mut [u8]; 1]) + Sync + use<'_> {
        |first, [piece]| piece.copy_from_slice(&bytes[first..first + piece.len()])
    }

    fn pack_at(bytes: &[u8], level: Compression) -> Vec<u8> {
        let (header, rest) = bytes.split_at(bytes.len().min(352));
        super::pack_at(header, &Numbers { count: rest.len(), size: 1, write: &numbers_of(rest) }, level)
    }

    fn pack(bytes: &[u8]) -> Vec<u8> {
        pack_at(bytes, Compression::new(4))
    }

    fn sample(count: usize) -> Vec<u8> {
        (0..count as u32).map(|n| (n.wrapping_mul(2654435761) >> (20 + n / 100_000 % 12)) as u8).collect()
    }

    /// Numbers of 24 bits (Marsaglia's xorshift).
    fn random(seed: u64) -> impl FnMut() -> u64 {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state >> 40
        }
    }

    /// Blocks that deflate to a little more than half of their size: a buffer of that half once came out full to its last byte when
    /// the block was all read, and what had not been written yet was lost.
    #[test]
    fn blocks_of_any_compressibility_come_back() {
        for seed in 0..12_u64 {
            let mut next = random(seed);
            let bytes: Vec<u8> = (0..BLOCK + 300).map(|_| if next() % 200 < 57 { next() as u8 } else { 0 }).collect();
            for level in [Compression::fast(), Compression::new(4)] {
                let packed = pack_at(&bytes, level);
                let mut plain = Vec::new();
                GzDecoder::new(&packed[..]).read_to_end(&mut plain).unwrap();
                assert!(plain == bytes, "seed {seed}");
            }
        }
    }

    /// Bytes whose fixed code is longer than they are, and no two runs of them alike.
    #[test]
    fn what_grows_when_it_is_packed_comes_back() {
        let mut next = random(1);
        let bytes: Vec<u8> = (0..BLOCK + 300).map(|_| 144 + (next() % 112) as u8).collect();
        for level in [Compression::fast(), Compression::new(4)] {
            let packed = pack_at(&bytes, level);
            assert!(part(&packed, 0, bytes.len() as u64, bytes.len() as u64).unwrap() == bytes);
        }
    }

    #[test]
    fn packing_and_unpacking_gives_the_bytes_back() {
        for count in [0, 1, 1000, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK + 77] {
            let bytes = sample(count);
            let packed = pack(&bytes);
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
        let with = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(|| pack(&bytes));
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn a_flipped_byte_and_a_cut_are_noticed_and_members_are_joined() {
        let bytes = sample(5000);
        let packed = pack(&bytes);
        for place in [10, packed.len() / 2, packed.len() - 6, packed.len() - 2] {
            let mut flipped = packed.clone();
            flipped[place] ^= 0x10;
            assert!(part(&flipped, 0, 5000, 5000).is_err(), "byte {place}");
        }
        assert!(part(&packed[..packed.len() - 3], 0, 5000, 5000).is_err());
        let mut two = pack(&bytes[..2000]);
        two.extend(pack(&bytes[2000..]));
        two.extend([0; 100]);
        assert_eq!(part(&two, 1500, 1000, 5000).unwrap(), bytes[1500..2500]);
    }

    #[test]
    fn a_bomb_and_a_lie_about_the_size_are_refused() {
        let zeros = pack(&vec![0; 8 << 20]);
        assert!(matches!(part(&zeros, 0, 100, 100), Err(NiftiProblem::TooLong { .. })));
        let small = pack(&[1, 2, 3]);
        let lie = part(&small, 0, 1 << 40, 1 << 40);
        assert_eq!(lie, Err(NiftiProblem::Truncated { declared: 1 << 40, found: 3 }));
    }
}
