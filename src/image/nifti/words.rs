//! Deflate for many 32-bit numbers, as fields of displacement are: a third of the time of a general compressor.
//!
//! In such files what comes again comes as whole words. Matches are looked for at words alone, in the last 32 KiB, with one place
//! remembered for a word's hash (as LZ4 does, Collet 2011); what is left goes as bytes, and both through one Huffman code of the block
//! (RFC 1951).

/// Symbols of literals and lengths, and of distances.
const SYMBOLS: usize = 286;
const DISTANCES: usize = 30;
/// End of block.
const END: usize = 256;
/// Bits of the longest code.
const LONGEST: usize = 15;
/// Words of the shortest and the longest match (258 bytes are no whole number of words), and how far back one lies.
const LEAST_WORDS: usize = 2;
const MOST_WORDS: usize = 64;
const REACH_WORDS: usize = 32768 / 4;
/// Bits of a hash.
const HASH_BITS: u32 = 14;
/// First length of the symbols 257 to 284 and the bits behind each.
const LENGTHS: [(u16, u8); 28] = [
    (3, 0),
    (4, 0),
    (5, 0),
    (6, 0),
    (7, 0),
    (8, 0),
    (9, 0),
    (10, 0),
    (11, 1),
    (13, 1),
    (15, 1),
    (17, 1),
    (19, 2),
    (23, 2),
    (27, 2),
    (31, 2),
    (35, 3),
    (43, 3),
    (51, 3),
    (59, 3),
    (67, 4),
    (83, 4),
    (99, 4),
    (115, 4),
    (131, 5),
    (163, 5),
    (195, 5),
    (227, 5),
];
/// The order in which lengths of the codes' own code are told.
const ORDER: [usize; 19] = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];

/// So many bytes as they are, then a match: words long, words back. The last of a block has none.
#[derive(Clone, Copy)]
struct Part {
    literals: u32,
    words: u16,
    back: u16,
}

/// Bits, the lowest first.
struct Bits {
    out: Vec<u8>,
    at: usize,
    held: u64,
    count: u32,
}

impl Bits {
    fn new(room: usize) -> Self {
        Self { out: vec![0; room + 64], at: 0, held: 0, count: 0 }
    }

    /// At most 32 bits.
    #[inline]
    fn put(&mut self, bits: u64, count: u32) {
        self.held |= bits << self.count;
        self.count += count;
        if self.count >= 32 {
            if self.at + 8 > self.out.len() {
                self.out.resize(2 * self.out.len(), 0);
            }
            self.out[self.at..self.at + 4].copy_from_slice(&(self.held as u32).to_le_bytes());
            self.at += 4;
            self.held >>= 32;
            self.count -= 32;
        }
    }

    fn end_byte(&mut self) {
        let bytes = self.count.div_ceil(8);
        self.put(0, 8 * bytes - self.count);
        if self.count > 0 {
            let whole = (self.count / 8) as usize;
            self.out.resize(self.out.len().max(self.at + 8), 0);
            self.out[self.at..self.at + 4].copy_from_slice(&(self.held as u32).to_le_bytes());
            (self.at, self.held, self.count) = (self.at + whole, 0, 0);
        }
    }

    fn done(mut self) -> Vec<u8> {
        self.out.truncate(self.at);
        self.out
    }
}

fn hash(word: u32) -> usize {
    (word.wrapping_mul(2_654_435_761) >> (32 - HASH_BITS)) as usize
}

fn parts(words: &[u32], bytes: usize) -> Vec<Part> {
    let mut seen = vec![0u32; 1 << HASH_BITS];
    let mut parts = Vec::with_capacity(words.len() / 8);
    let (mut begun, mut n) = (0, 0);
    while n < words.len() {
        let place = &mut seen[hash(words[n])];
        // One more, so that 0 is nothing.
        let last = *place as usize;
        *place = n as u32 + 1;
        let back = n + 1 - last;
        if last == 0 || back > REACH_WORDS || words[n - back] != words[n] {
            n += 1;
            continue;
        }
        let most = MOST_WORDS.min(words.len() - n);
        let long = (1..most).find(|&k| words[n + k] != words[n + k - back]).unwrap_or(most);
        if long < LEAST_WORDS {
            n += 1;
            continue;
        }
        parts.push(Part { literals: 4 * (n - begun) as u32, words: long as u16, back: back as u16 });
        n += long;
        begun = n;
        seen[hash(words[n - 1])] = n as u32;
    }
    parts.push(Part { literals: (bytes - 4 * begun) as u32, words: 0, back: 0 });
    parts
}

/// The symbol of a match's length from 0 for 257, by words.
fn length_symbols() -> [u8; MOST_WORDS + 1] {
    std::array::from_fn(|words| {
        LENGTHS.iter().rposition(|(first, _)| usize::from(*first) <= 4 * words).unwrap_or_default() as u8
    })
}

/// The symbol of a distance of 4 bytes and more, its first distance less one, and the bits behind it.
fn distance_symbol(back: u16) -> (usize, u32, u32) {
    let less = 4 * u32::from(back) - 1;
    let high = less.ilog2();
    let symbol = 2 * high + (less >> (high - 1) & 1);
    let extra = high - 1;
    (symbol as usize, less & ((1 << extra) - 1), extra)
}

/// One block of a deflate stream, ended at a byte's border; the last one ends the stream.
pub(super) fn deflate(block: &[u8], last: bool) -> Vec<u8> {
    let words: Vec<u32> = block.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word)).collect();
    let parts = parts(&words, block.len());
    let symbol_of = length_symbols();
    let mut counts = [0u32; SYMBOLS];
    let mut of_distances = [0u32; DISTANCES];
    counts[END] = 1;
    // Four tables: equal bytes in a row do not wait for each other.
    let mut tables = [[0u32; 256]; 4];
    let mut at = 0;
    for part in &parts {
        let end = at + part.literals as usize;
        for (n, byte) in block[at..end].iter().enumerate() {
            tables[n & 3][usize::from(*byte)] += 1;
        }
        at = end + 4 * usize::from(part.words);
        if part.words > 0 {
            counts[END + 1 + usize::from(symbol_of[usize::from(part.words)])] += 1;
            of_distances[distance_symbol(part.back).0] += 1;
        }
    }
    (0..256).for_each(|b| counts[b] = tables.iter().map(|table| table[b]).sum());
    let (lengths, far) = (code_lengths(&counts, LONGEST), code_lengths(&of_distances, LONGEST));
    let (codes, far_codes) = (codes(&lengths), codes(&far));
    let mut bits = Bits::new(block.len() / 2);
    bits.put(u64::from(last) | 0b100, 3);
    put_codes(&mut bits, &lengths, &far);
    let mut at = 0;
    for part in &parts {
        let end = at + part.literals as usize;
        // Two bytes at once: at most 30 bits.
        let (pairs, rest) = block[at..end].as_chunks::<2>();
        for [a, b] in pairs {
            let ((x, m), (y, n)) = (codes[usize::from(*a)], codes[usize::from(*b)]);
            bits.put(u64::from(x) | u64::from(y) << m, u32::from(m) + u32::from(n));
        }
        for byte in rest {
            let (code, length) = codes[usize::from(*byte)];
            bits.put(u64::from(code), u32::from(length));
        }
        at = end + 4 * usize::from(part.words);
        if part.words > 0 {
            let symbol = usize::from(symbol_of[usize::from(part.words)]);
            let (code, long) = codes[END + 1 + symbol];
            let (first, extra) = LENGTHS[symbol];
            let more = u64::from(4 * part.words - first);
            bits.put(u64::from(code) | more << long, u32::from(long + extra));
            let (symbol, more, extra) = distance_symbol(part.back);
            let (code, long) = far_codes[symbol];
            bits.put(u64::from(code) | u64::from(more) << long, u32::from(long) + extra);
        }
    }
    let (code, length) = codes[END];
    bits.put(u64::from(code), u32::from(length));
    if !last {
        // An empty stored block leads to the border, as a sync flush does.
        bits.put(0, 3);
        bits.end_byte();
        bits.put(0xffff_0000, 32);
    }
    bits.end_byte();
    bits.done()
}

/// Tells a decoder the lengths of both codes.
fn put_codes(bits: &mut Bits, lengths: &[u8], far: &[u8]) {
    let told: Vec<u8> = lengths.iter().chain(far).copied().collect();
    let mut counts = [0u32; 19];
    for l in &told {
        counts[usize::from(*l)] += 1;
    }
    let own = code_lengths(&counts, 7);
    let codes = codes(&own);
    bits.put((SYMBOLS - 257) as u64, 5);
    bits.put((DISTANCES - 1) as u64, 5);
    bits.put((ORDER.len() - 4) as u64, 4);
    for n in ORDER {
        bits.put(u64::from(own[n]), 3);
    }
    for l in told {
        let (code, length) = codes[usize::from(l)];
        bits.put(u64::from(code), u32::from(length));
    }
}

/// Lengths of a Huffman code, none longer than `most`; at least two symbols get one, so that the code is complete.
fn code_lengths(counts: &[u32], most: usize) -> Vec<u8> {
    let mut counts = counts.to_vec();
    for n in 0..2 {
        if counts.iter().filter(|c| **c > 0).count() < 2 {
            counts[n] = counts[n].max(1);
        }
    }
    loop {
        let lengths = huffman(&counts);
        if lengths.iter().all(|l| usize::from(*l) <= most) {
            return lengths;
        }
        // Rare symbols less rare: a shorter code that loses next to nothing.
        counts.iter_mut().filter(|c| **c > 0).for_each(|c| *c = *c / 2 + 1);
    }
}

fn huffman(counts: &[u32]) -> Vec<u8> {
    use std::cmp::Reverse;
    use std::collections::BinaryHeap;
    let used = counts.iter().enumerate().filter(|(_, c)| **c > 0);
    let mut heap: BinaryHeap<Reverse<(u64, usize)>> = used.map(|(n, c)| Reverse((u64::from(*c), n))).collect();
    let mut parent: Vec<usize> = vec![usize::MAX; counts.len()];
    while heap.len() > 1 {
        let (Some(Reverse((a, x))), Some(Reverse((b, y)))) = (heap.pop(), heap.pop()) else { break };
        let node = parent.len();
        parent.push(usize::MAX);
        (parent[x], parent[y]) = (node, node);
        heap.push(Reverse((a + b, node)));
    }
    let mut depth = vec![0u8; parent.len()];
    // A node's parent comes after it.
    for n in (0..parent.len()).rev().filter(|n| parent[*n] != usize::MAX) {
        depth[n] = depth[parent[n]] + 1;
    }
    depth.truncate(counts.len());
    depth
}

/// Canonical codes with their lengths, turned so that the first bit is the lowest.
fn codes(lengths: &[u8]) -> Vec<(u16, u8)> {
    let mut next = [0u16; LONGEST + 2];
    let mut of_length = [0u16; LONGEST + 1];
    for l in lengths {
        of_length[usize::from(*l)] += u16::from(*l > 0);
    }
    for l in 1..=LONGEST {
        next[l + 1] = (next[l] + of_length[l]) << 1;
    }
    let code = |l: &u8| {
        if *l == 0 {
            return (0, 0);
        }
        let code = &mut next[usize::from(*l)];
        *code = code.wrapping_add(1);
        (code.wrapping_sub(1).reverse_bits() >> (16 - *l), *l)
    };
    lengths.iter().map(code).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::bufread::DeflateDecoder;
    use std::io::Read;

    fn back(packed: &[u8]) -> Vec<u8> {
        let mut plain = Vec::new();
        DeflateDecoder::new(packed).read_to_end(&mut plain).unwrap();
        plain
    }

    #[test]
    fn whatever_goes_in_comes_out_of_another_programs_decoder() {
        let smooth = |n: usize| ((n as f32 * 0.037).sin() * 5000.0).round() / 512.0;
        let of =
            |f: &dyn Fn(usize) -> f32, count: usize| (0..count).flat_map(|n| f(n).to_le_bytes()).collect::<Vec<u8>>();
        let sparse = |n: usize| if n % 700 < 500 { 0.0 } else { smooth(n) };
        let noise = |n: usize| f32::from_bits((n as u32).wrapping_mul(2_654_435_761));
        // Far matches, just within reach and just beyond it.
        let far = |n: usize| noise(n % 8192);
        let beyond = |n: usize| noise(n % 8193);
        let mut one_in_many = vec![7u8; 100_003];
        (0..40).for_each(|n| one_in_many[n * n * 50] = n as u8);
        // A code of Fibonacci's counts would be longer than allowed.
        let fibonacci = |n: u8| (0..n).fold((1usize, 1usize), |(a, b), _| (b, a + b)).0;
        let rising: Vec<u8> = (0..24u8).flat_map(|n| std::iter::repeat_n(n, fibonacci(n))).collect();
        let deep: Vec<u8> = (0..rising.len()).map(|n| rising[n * 7919 % rising.len()]).collect();
        let all = [
            Vec::new(),
            vec![1],
            vec![0; 3],
            vec![9; 4 * 1027 + 2],
            of(&smooth, 60_000),
            of(&sparse, 60_000),
            of(&noise, 30_001),
            of(&far, 30_000),
            of(&beyond, 30_000),
            one_in_many,
            deep,
        ];
        for (n, bytes) in all.iter().enumerate() {
            assert!(back(&deflate(bytes, true)) == *bytes, "{n}");
            let joined = [deflate(bytes, false), deflate(&all[4], false), deflate(bytes, true)].concat();
            assert!(back(&joined) == [&bytes[..], &all[4], bytes].concat(), "{n} in three blocks");
        }
    }

    #[test]
    fn nothing_grows_by_more_than_a_hundredth_and_zeros_almost_vanish() {
        let noise: Vec<u8> = (0..1u32 << 18).flat_map(|n| n.wrapping_mul(2_654_435_761).to_le_bytes()).collect();
        assert!(deflate(&noise, true).len() < noise.len() / 100 * 101);
        assert!(deflate(&vec![0; 1 << 20], true).len() < 4000);
    }
}
