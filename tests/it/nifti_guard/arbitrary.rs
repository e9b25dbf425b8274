//! Arbitrary and mutated bytes never make the reader panic.

use super::{File, gzip};
use hgm::image::nifti::{Orientation, ReadOptions, decode, decode_labels, decode_mask};

/// Steps of a counter through a mixing function (splitmix64): the same inputs on every machine.
struct Mutations(u64);

impl Mutations {
    fn next(&mut self, below: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e3779b97f4a7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58476d1ce4e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d049bb133111eb);
        ((z ^ (z >> 31)) % below as u64) as usize
    }
}

/// The number of inputs can be raised: `HGM_FUZZ_INPUTS=1000000 cargo test --release --test it arbitrary`.
#[test]
fn arbitrary_and_mutated_files_never_panic() {
    let inputs: u64 = std::env::var("HGM_FUZZ_INPUTS").ok().and_then(|n| n.parse().ok()).unwrap_or(20_000);
    let plain = [File::sound(), File::sound().version_2(), {
        let mut big = File::sound();
        big.big = true;
        big
    }]
    .map(|f| f.bytes());
    let packed = plain.clone().map(|b| gzip(&b));
    let (mut accepted, mut refused) = (0, 0);
    for n in 0..inputs {
        let mut random = Mutations(n << 20);
        let mut bytes = match random.next(8) {
            0 => (0..random.next(700)).map(|_| random.next(256) as u8).collect(),
            1 | 2 => packed[random.next(3)].clone(),
            _ => plain[random.next(3)].clone(),
        };
        for _ in 0..random.next(6) {
            if bytes.is_empty() {
                break;
            }
            let at = random.next(bytes.len());
            match random.next(5) {
                0 => bytes[at] = random.next(256) as u8,
                1 => bytes[at] ^= 1 << random.next(8),
                2 => bytes.truncate(at),
                3 => bytes[at] = [0, 1, 0x7f, 0x80, 0xff][random.next(5)],
                // In the header, where every byte means something.
                _ => {
                    let last = bytes.len().min(540) - 1;
                    bytes[at.min(last)] = random.next(256) as u8;
                }
            }
        }
        // Sometimes packed after the damage, so that the damage is behind a valid checksum.
        if random.next(10) == 0 {
            bytes = gzip(&bytes);
        }
        let options = ReadOptions {
            prefer: [None, Some(Orientation::Sform), Some(Orientation::Qform)][random.next(3)],
            volume: [None, Some(0), Some(1)][random.next(3)],
        };
        match decode(&bytes, "x.nii", &options) {
            Ok(image) => {
                accepted += 1;
                assert!(image.volume.data.iter().all(|x| x.is_finite()));
                assert_eq!(image.volume.data.len(), image.volume.grid.len());
            }
            Err(error) => {
                refused += 1;
                assert!(error.to_string().starts_with("x.nii: "));
            }
        }
        let _ = decode_labels(&bytes, "x.nii", &options);
        let _ = decode_mask(&bytes, "x.nii", &options);
    }
    // Both roads are travelled, or this test tests nothing.
    assert!(accepted > inputs / 50 && refused > inputs / 50, "{accepted} {refused}");
}
