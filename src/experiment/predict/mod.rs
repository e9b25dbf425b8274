//! Before the operation: how a brain will move, and how sure that is.
//!
//! What is not known (stiffness, load, direction of gravity, room under the skull, supports) has a stated prior. A few
//! equilibria with their sensitivities make a [`Response`] of every node to the unknowns, which quasi-random draws from the
//! priors are read from ([`Spread`]); some draws are solved whole to tell how far that is off ([`Check`]).

mod check;
mod cut;
mod draws_table;
mod ellipsoid;
mod evaluation;
mod fluid;
mod forecast;
mod head;
mod heads;
mod known_level;
mod left_by_all;
mod low_discrepancy;
mod modes;
mod outcome;
mod path;
mod place;
mod planned;
mod plans;
mod response;
mod score;
mod settings;
mod shares;
mod spread;
mod support;
mod supported;
mod taught;
mod uncertain;

pub use check::{Check, checked};
pub use cut::{Planned, PlannedError, ellipsoid_mask, planned, tissue_cc};
pub use draws_table::{DrawsTableError, draws_from_csv, draws_to_csv, mode_name};
pub use ellipsoid::{Ellipsoid, Scatter, ellipsoid_95};
pub use evaluation::{
    EvaluationLimit, HeadEvaluation, LandmarkForecast, OtherWayRound, PredictionEvaluation, TakenAgainstPlan,
};
pub use fluid::{FluidOfHead, LevelError};
pub use forecast::{Forecast, ForecastError, Posed, forecast};
pub use head::{Head, HeadParseError, same_way, twice};
pub use heads::{HeadComparison, HeadDraws, compared_heads};
pub use known_level::KnownLevel;
pub use left_by_all::LeftByAll;
pub use low_discrepancy::{halton, inverse_normal, normals, normals_of};
pub use modes::{DrawnState, Modes};
pub use outcome::{DrawsSolved, HeadPrediction, Prediction, TargetPlace, TargetPrediction, UnknownOutcome};
pub use path::Path;
pub use place::{Found, Locator};
pub use planned::{PREDICTED, assumptions};
pub use plans::{PlanComparison, PlanDraws, PlanFigures, PlanOfHead, PlansOfHead, compared_plans};
pub use response::{Beside, Coordinates, Response, SolvedState};
pub use score::{Compared, Coverage, PlaceScore, Scores, crps, energy_score, score_place, scores};
pub use settings::{ENOUGH_DRAWS, PredictSettings};
pub use shares::{Shares, variance_shares};
pub use spread::{Spread, farthest, spread};
pub use support::SupportWeight;
pub use taught::TaughtError;
pub use uncertain::{Cause, Reading, Uncertain, Uncertainty};
