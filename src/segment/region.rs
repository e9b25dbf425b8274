//! Parts of the brain that a reader knows by name, by planes placed by eye on the template: for telling where, not for measuring.

use super::atlas::{Side, above_sylvian, central_mm, temporal_lobe};
use super::cerebellum;
use crate::geometry::{Mni, Position};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A part of the brain; the parts leave nothing out and do not overlap.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs, reason = "their names")]
pub enum Region {
    LeftFrontal,
    RightFrontal,
    LeftTemporal,
    RightTemporal,
    LeftParietal,
    RightParietal,
    LeftOccipital,
    RightOccipital,
    /// Insula, basal nuclei and thalamus with what lies between them.
    LeftDeep,
    RightDeep,
    Cerebellum,
    Brainstem,
}

impl Region {
    /// Every part, in the order of tables.
    pub const ALL: [Self; 12] = [
        Self::LeftFrontal,
        Self::RightFrontal,
        Self::LeftTemporal,
        Self::RightTemporal,
        Self::LeftParietal,
        Self::RightParietal,
        Self::LeftOccipital,
        Self::RightOccipital,
        Self::LeftDeep,
        Self::RightDeep,
        Self::Cerebellum,
        Self::Brainstem,
    ];

    /// The part that holds a point of the template; beside the brain the nearest by the same planes.
    pub fn at(p: Position<Mni>) -> Self {
        let [x, y, z] = [p.mm.x.abs(), p.mm.y, p.mm.z];
        let of = |left, right| if p.mm.x < 0.0 { left } else { right };
        let nuclei = x < 32.0 && (-36.0..24.0).contains(&y) && (-12.0..22.0).contains(&z);
        let insula = (26.0..44.0).contains(&x) && (-22.0..26.0).contains(&y) && (-8.0..18.0).contains(&z);
        let hypothalamus = x < 17.0 && (-10.0..12.0).contains(&y) && (-20.0..-10.0).contains(&z);
        if cerebellum::holds(p) {
            return Self::Cerebellum;
        }
        if x < 17.0 && (-50.0..-9.0).contains(&y) && z < -6.0 {
            return Self::Brainstem;
        }
        if nuclei || insula || hypothalamus {
            return of(Self::LeftDeep, Self::RightDeep);
        }
        if let Some(side) = temporal_lobe(p) {
            return if side == Side::Left { Self::LeftTemporal } else { Self::RightTemporal };
        }
        if (y < -70.0 && z < 45.0) || (y < -58.0 && z < 8.0) {
            return of(Self::LeftOccipital, Self::RightOccipital);
        }
        // Below the Sylvian fissure and in front of the temporal lobe lies the frontal one's orbital face.
        if y > central_mm(z) || (y > 0.0 && !above_sylvian(y, z)) {
            return of(Self::LeftFrontal, Self::RightFrontal);
        }
        of(Self::LeftParietal, Self::RightParietal)
    }

    /// For readers.
    pub fn name(self) -> &'static str {
        match self {
            Self::LeftFrontal => "left frontal lobe",
            Self::RightFrontal => "right frontal lobe",
            Self::LeftTemporal => "left temporal lobe",
            Self::RightTemporal => "right temporal lobe",
            Self::LeftParietal => "left parietal lobe",
            Self::RightParietal => "right parietal lobe",
            Self::LeftOccipital => "left occipital lobe",
            Self::RightOccipital => "right occipital lobe",
            Self::LeftDeep => "left insula and deep nuclei",
            Self::RightDeep => "right insula and deep nuclei",
            Self::Cerebellum => "cerebellum",
            Self::Brainstem => "brainstem",
        }
    }
}

impl std::fmt::Display for Region {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segment::atlas::{head_from_template, template};

    #[test]
    fn a_place_everybody_knows_lies_in_its_part_on_either_side() {
        for (right, left, [x, y, z]) in [
            (Region::RightFrontal, Region::LeftFrontal, [25.0, 50.0, 10.0]),
            (Region::RightFrontal, Region::LeftFrontal, [40.0, 5.0, 45.0]),
            (Region::RightFrontal, Region::LeftFrontal, [15.0, 40.0, -20.0]),
            (Region::RightTemporal, Region::LeftTemporal, [40.0, 15.0, -32.0]),
            (Region::RightTemporal, Region::LeftTemporal, [60.0, -35.0, -8.0]),
            (Region::RightParietal, Region::LeftParietal, [36.0, -50.0, 55.0]),
            (Region::RightOccipital, Region::LeftOccipital, [18.0, -95.0, 5.0]),
            (Region::RightDeep, Region::LeftDeep, [12.0, -18.0, 8.0]),
            (Region::RightDeep, Region::LeftDeep, [37.0, 4.0, 0.0]),
            (Region::Cerebellum, Region::Cerebellum, [20.0, -60.0, -35.0]),
            (Region::Brainstem, Region::Brainstem, [3.0, -28.0, -30.0]),
        ] {
            assert_eq!(Region::at(Position::new(x, y, z)), right, "{x} {y} {z}");
            assert_eq!(Region::at(Position::new(-x, y, z)), left, "-{x} {y} {z}");
        }
    }

    #[test]
    fn every_part_has_about_the_volume_that_anatomy_gives_it() {
        let atlas = template();
        let mut cc = [0.0f64; Region::ALL.len()];
        for n in (0..atlas.t1.data.len()).filter(|&n| atlas.t1.data[n] > 0) {
            cc[Region::at(atlas.grid().centre(atlas.grid().voxel(n))) as usize] += 1e-3;
        }
        let natural = head_from_template().linear.determinant();
        for (region, cc) in Region::ALL.into_iter().zip(cc) {
            let cc = natural * cc;
            let expected = match region {
                Region::LeftFrontal | Region::RightFrontal => 130.0..240.0,
                Region::LeftTemporal | Region::RightTemporal => 60.0..130.0,
                Region::LeftParietal | Region::RightParietal => 80.0..180.0,
                Region::LeftOccipital | Region::RightOccipital => 30.0..90.0,
                Region::LeftDeep | Region::RightDeep => 30.0..80.0,
                Region::Cerebellum => 115.0..150.0,
                Region::Brainstem => 15.0..50.0,
            };
            assert!(expected.contains(&cc), "{region}: {cc:.0} cc");
        }
    }
}
