//! The page's figures of images: tiles before and after registration, mosaics of masks.

use super::slice::{self, PLANES, Plane, Tile};
use crate::geometry::{Mni, Position, RigidTransform};
use crate::image::{LabelMap, Mask, Volume};
use crate::segment::label;
use rayon::prelude::*;

/// What an outline surrounds; decides its colour and its dashes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Structure {
    /// The brain mask.
    Brain,
    /// White matter.
    WhiteMatter,
    /// The ventricles.
    Ventricle,
    /// Tumour and oedema.
    Tumour,
    /// The tissue that was taken out, on the pre-operative image.
    Resected,
    /// The cavity on the post-operative image.
    Cavity,
}

impl Structure {
    /// Name for readers.
    pub fn name(self) -> &'static str {
        match self {
            Self::Brain => "brain",
            Self::WhiteMatter => "white matter",
            Self::Ventricle => "ventricles",
            Self::Tumour => "tumour and oedema",
            Self::Resected => "resected tissue",
            Self::Cavity => "cavity",
        }
    }

    /// Name of the style class.
    pub fn class(self) -> &'static str {
        match self {
            Self::Brain => "o-brain",
            Self::WhiteMatter => "o-white",
            Self::Ventricle => "o-ventricle",
            Self::Tumour => "o-tumour",
            Self::Resected => "o-resected",
            Self::Cavity => "o-cavity",
        }
    }
}

/// One slice: grey pictures over each other, outlines on top.
#[derive(Clone, Debug, PartialEq)]
pub struct TileFigure {
    /// Where it lies.
    pub tile: Tile,
    /// PNG bytes, the bottom one first.
    pub layers: Vec<Vec<u8>>,
    /// SVG path data per structure, only those the slice meets.
    pub outlines: Vec<(Structure, String)>,
}

/// Slices of one image with what is outlined on them.
#[derive(Clone, Debug, PartialEq)]
pub struct Mosaic {
    /// Heading.
    pub title: String,
    /// One sentence on what is seen.
    pub caption: String,
    /// Everything that is outlined somewhere.
    pub structures: Vec<Structure>,
    /// Slices, plane by plane.
    pub tiles: Vec<TileFigure>,
}

/// Slices of the fixed image, the registered one and, where the transforms are known, the same image unregistered.
#[derive(Clone, Debug, PartialEq)]
pub struct RegistrationFigure {
    /// Slices; layers are fixed, moving after, moving before.
    pub tiles: Vec<TileFigure>,
    /// Whether there is a third layer.
    pub has_before: bool,
    /// Everything that is outlined somewhere.
    pub structures: Vec<Structure>,
}

/// The images of a case in the MNI frame.
#[derive(Clone, Debug)]
pub struct CaseImages {
    /// Pre-operative T1 and its brain.
    pub pre: Volume<f32, Mni>,
    /// Brain on the pre-operative image.
    pub pre_brain: Mask<Mni>,
    /// Post-operative T1 and its brain.
    pub post: Option<(Volume<f32, Mni>, Mask<Mni>)>,
    /// Labels of the pre-operative image.
    pub labels: Option<LabelMap<Mni>>,
    /// Tissue taken out, on the pre-operative image.
    pub resected: Option<Mask<Mni>>,
    /// Cavity on the post-operative image.
    pub cavity: Option<Mask<Mni>>,
    /// Maps a position to the place in the registered post-operative image that the scanner's coordinates put there.
    pub registered_from_scanned: Option<RigidTransform<Mni, Mni>>,
}

/// Pixel size of the tiles, mm.
const STEP_MM: f64 = 1.0;

type Outlined<'a> = Vec<(Structure, &'a Mask<Mni>)>;

fn outlines(tile: &Tile, masks: &Outlined<'_>) -> Vec<(Structure, String)> {
    masks
        .iter()
        .map(|(structure, mask)| (*structure, slice::outline::<Mni, Mni>(tile, mask, |p| p)))
        .filter(|(_, path)| !path.is_empty())
        .collect()
}

fn structures(tiles: &[TileFigure]) -> Vec<Structure> {
    let mut found: Vec<Structure> = tiles.iter().flat_map(|t| t.outlines.iter().map(|o| o.0)).collect();
    found.sort_unstable();
    found.dedup();
    found
}

fn either(a: &Mask<Mni>, b: Option<&Mask<Mni>>) -> Mask<Mni> {
    match b.filter(|b| b.grid.coincides(&a.grid, 1e-3)) {
        Some(b) => Mask::from_data(a.grid, a.data.iter().zip(&b.data).map(|(a, b)| *a || *b).collect()),
        None => a.clone(),
    }
}

impl CaseImages {
    /// Slice positions: evenly through the brain, and through the middle of the cavity where there is one.
    fn positions(&self, plane: Plane, bounds: [[f64; 3]; 2], count: usize) -> Vec<f64> {
        let mut at = slice::positions_mm(plane, bounds, count, 0.84);
        let focus = self.resected.as_ref().and_then(slice::centroid_mm);
        if let Some(focus) = focus.or_else(|| self.cavity.as_ref().and_then(slice::centroid_mm)) {
            // The nearest slice moves onto the cavity's middle.
            let target = focus[plane.axis()].round();
            if let Some(nearest) = at.iter_mut().min_by(|a, b| (**a - target).abs().total_cmp(&(**b - target).abs())) {
                *nearest = target;
            }
        }
        at
    }

    /// Tiles that flicker between the pre-operative and the post-operative image. `None` without a usable pair.
    pub fn registration(&self) -> Option<RegistrationFigure> {
        let (post, post_brain) = self.post.as_ref()?;
        let bounds = slice::bounds_mm(&self.pre_brain)?;
        let pre_window = slice::window(&self.pre, &self.pre_brain)?;
        // The cavity is no brain, but it must be seen.
        let post_shown = either(post_brain, self.cavity.as_ref());
        let post_window = slice::window(post, &post_shown)?;
        let ventricle = self.labels.as_ref().map(|l| l.map(|v| v == label::VENTRICLE));
        let mut masks: Outlined<'_> = vec![(Structure::Brain, &self.pre_brain)];
        masks.extend(ventricle.as_ref().map(|m| (Structure::Ventricle, m)));
        let mut tiles = Vec::new();
        for plane in PLANES {
            for at in self.positions(plane, bounds, 4) {
                let tile = slice::tile(plane, at, bounds, 8.0, STEP_MM);
                let mut layers = vec![
                    slice::png::<Mni, Mni>(&tile, &self.pre, &self.pre_brain, pre_window, |p| p),
                    slice::png::<Mni, Mni>(&tile, post, &post_shown, post_window, |p| p),
                ];
                if let Some(transform) = &self.registered_from_scanned {
                    let before = |p: Position<Mni>| transform.apply(p);
                    layers.push(slice::png(&tile, post, &post_shown, post_window, before));
                }
                tiles.push(TileFigure { tile, layers, outlines: outlines(&tile, &masks) });
            }
        }
        let has_before = self.registered_from_scanned.is_some();
        Some(RegistrationFigure { structures: structures(&tiles), tiles, has_before })
    }

    /// Mosaics of the pre-operative and of the post-operative image with their masks.
    pub fn mosaics(&self) -> Vec<Mosaic> {
        let Some(bounds) = slice::bounds_mm(&self.pre_brain) else { return Vec::new() };
        let white = self.labels.as_ref().map(|l| l.map(|v| v == label::WHITE_MATTER));
        let ventricle = self.labels.as_ref().map(|l| l.map(|v| v == label::VENTRICLE));
        let mut masks: Outlined<'_> = vec![(Structure::Brain, &self.pre_brain)];
        masks.extend(white.as_ref().map(|m| (Structure::WhiteMatter, m)));
        masks.extend(ventricle.as_ref().map(|m| (Structure::Ventricle, m)));
        let lesion = self.labels.as_ref().map(|l| l.map(|v| v == label::TUMOUR || v == label::OEDEMA));
        masks.extend(lesion.as_ref().map(|m| (Structure::Tumour, m)));
        masks.extend(self.resected.as_ref().map(|m| (Structure::Resected, m)));
        let shown = either(&self.pre_brain, self.resected.as_ref());
        let caption = "The outlines are the masks that everything after uses; they should follow the anatomy.";
        let mut mosaics = Vec::new();
        mosaics.extend(self.mosaic("Before surgery", caption, bounds, &self.pre, &shown, &masks));
        if let Some((post, post_brain)) = &self.post {
            let mut masks: Outlined<'_> = vec![(Structure::Brain, post_brain)];
            masks.extend(self.cavity.as_ref().map(|m| (Structure::Cavity, m)));
            masks.extend(self.resected.as_ref().map(|m| (Structure::Resected, m)));
            let shown = either(post_brain, self.cavity.as_ref());
            let caption =
                "After registration. Where the cavity is smaller than the resected tissue, the brain has moved in.";
            mosaics.extend(self.mosaic("After surgery", caption, bounds, post, &shown, &masks));
        }
        mosaics
    }

    fn mosaic(
        &self,
        title: &str,
        caption: &str,
        bounds: [[f64; 3]; 2],
        image: &Volume<f32, Mni>,
        shown: &Mask<Mni>,
        masks: &Outlined<'_>,
    ) -> Option<Mosaic> {
        let window = slice::window(image, shown)?;
        let at = |plane| self.positions(plane, bounds, 6).into_iter().map(move |at| (plane, at));
        let places: Vec<(Plane, f64)> = PLANES.into_iter().flat_map(at).collect();
        let shown_at = |(plane, at)| {
            let tile = slice::tile(plane, at, bounds, 4.0, STEP_MM);
            let layers = vec![slice::png::<Mni, Mni>(&tile, image, shown, window, |p| p)];
            TileFigure { tile, layers, outlines: outlines(&tile, masks) }
        };
        let tiles: Vec<TileFigure> = places.into_par_iter().map(shown_at).collect();
        let structures = structures(&tiles);
        Some(Mosaic { title: title.to_owned(), caption: caption.to_owned(), structures, tiles })
    }
}
