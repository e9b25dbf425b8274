//! Pictures as arrays of pixels, and their PNG bytes.

use png::{BitDepth, ColorType, Compression, Encoder};

/// Red, green, blue, alpha per pixel, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels along a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Four bytes per pixel.
    pub rgba: Vec<u8>,
}

impl Picture {
    /// A picture of one colour.
    pub fn filled(width: usize, height: usize, rgba: [u8; 4]) -> Self {
        Self { width, height, rgba: rgba.repeat(width * height) }
    }

    /// Colour of a pixel.
    pub fn at(&self, x: usize, y: usize) -> [u8; 4] {
        let o = 4 * (x + y * self.width);
        std::array::from_fn(|c| self.rgba[o + c])
    }

    /// Sets a pixel; one outside the picture is left alone.
    pub fn set(&mut self, x: usize, y: usize, rgba: [u8; 4]) {
        if x < self.width && y < self.height {
            let o = 4 * (x + y * self.width);
            self.rgba[o..o + 4].copy_from_slice(&rgba);
        }
    }

    /// Copies `other` with its top left corner at (x, y); what falls outside is cut off.
    pub fn paste(&mut self, other: &Self, x: usize, y: usize) {
        for row in 0..other.height {
            for column in 0..other.width {
                self.set(x + column, y + row, other.at(column, row));
            }
        }
    }

    /// The bytes of an 8-bit RGBA PNG without any text chunk.
    pub fn to_png(&self) -> Vec<u8> {
        encode(self.width, self.height, ColorType::Rgba, &self.rgba)
    }
}

/// The bytes of an 8-bit greyscale PNG: one byte per pixel, rows from the top.
///
/// # Panics
/// When there are not `width * height` bytes (a programming error).
pub fn grey_png(width: usize, height: usize, grey: &[u8]) -> Vec<u8> {
    encode(width, height, ColorType::Grayscale, grey)
}

fn encode(width: usize, height: usize, colour: ColorType, bytes: &[u8]) -> Vec<u8> {
    assert_eq!(bytes.len(), width * height * colour.samples(), "one value per pixel and channel");
    let mut png = Vec::new();
    let mut encoder = Encoder::new(&mut png, width as u32, height as u32);
    encoder.set_color(colour);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::High);
    // Writing into memory cannot fail once the sizes agree.
    let mut writer = encoder.write_header().expect("a header into memory");
    writer.write_image_data(bytes).expect("as many bytes as the header says");
    writer.finish().expect("an end into memory");
    png
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(png: &[u8]) -> (u32, u32, Vec<u8>) {
        let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        bytes.truncate(info.buffer_size());
        (info.width, info.height, bytes)
    }

    #[test]
    fn png_brings_the_same_pixels_back() {
        let mut picture = Picture::filled(3, 2, [1, 2, 3, 255]);
        picture.set(2, 1, [9, 8, 7, 128]);
        picture.set(5, 5, [0; 4]);
        assert_eq!(decode(&picture.to_png()), (3, 2, picture.rgba.clone()));
        assert_eq!(decode(&grey_png(2, 2, &[0, 50, 100, 255])), (2, 2, vec![0, 50, 100, 255]));
    }

    #[test]
    fn pasting_beyond_the_edge_is_cut_off() {
        let mut picture = Picture::filled(2, 2, [0; 4]);
        picture.paste(&Picture::filled(2, 2, [9; 4]), 1, 1);
        assert_eq!((picture.at(1, 1), picture.at(0, 1)), ([9; 4], [0; 4]));
    }
}
