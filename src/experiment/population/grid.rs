//! The spreads that a quadrature tries: a grid of cells of equal size, closing in on where the posterior is.

/// The whole of the spreads' prior (half normal) but a part in three hundred.
const WIDEST: f64 = 3.0;
/// How far a grid reaches beyond the posterior's mean, in its standard deviations.
const REACH_SD: f64 = 5.0;

/// Middles of cells along each parameter.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    /// Where the cells begin and how large they are, for each parameter.
    sides: Vec<(f64, f64)>,
    /// Cells along each parameter.
    count: usize,
}

impl Grid {
    /// Over all that the prior of this scale allows.
    pub fn whole(parameters: usize, scale: f64) -> Self {
        // Fewer cells along each where there are more of them: some thousand in all.
        let count = [201, 31, 15, 9][parameters.clamp(1, 4) - 1];
        Self { sides: vec![(0.0, WIDEST * scale / count as f64); parameters], count }
    }

    /// Closer around the mean and standard deviation of every spread.
    pub fn around(&self, found: &[(f64, f64)]) -> Self {
        let side = |(&(mean, sd), &(_, cell)): (&(f64, f64), &(f64, f64))| {
            // What falls into one cell is known no better than that.
            let reach = REACH_SD * sd.max(0.5 * cell);
            let low = (mean - reach).max(0.0);
            (low, (mean + reach - low) / self.count as f64)
        };
        Self { sides: found.iter().zip(&self.sides).map(side).collect(), count: self.count }
    }

    /// How many cells there are.
    pub fn len(&self) -> usize {
        self.count.pow(self.sides.len() as u32)
    }

    /// The middle of a cell.
    pub fn at(&self, cell: usize) -> Vec<f64> {
        let place = |n: usize| (cell / self.count.pow(n as u32)) % self.count;
        self.sides.iter().enumerate().map(|(n, (low, size))| low + (place(n) as f64 + 0.5) * size).collect()
    }

    /// Below which a share of a parameter's weight lies, taken as even within a cell.
    pub fn quantile(&self, weights: &[f64], parameter: usize, share: f64) -> f64 {
        let (low, size) = self.sides[parameter];
        let mut marginal = vec![0.0; self.count];
        for (cell, weight) in weights.iter().enumerate() {
            marginal[(cell / self.count.pow(parameter as u32)) % self.count] += weight;
        }
        let mut sum = 0.0;
        for (n, weight) in marginal.iter().enumerate() {
            if sum + weight >= share && *weight > 0.0 {
                return low + (n as f64 + (share - sum) / weight) * size;
            }
            sum += weight;
        }
        low + self.count as f64 * size
    }
}
