//! What a folder of several plans of one patient holds: a case for each, and their comparison.

use super::family::Family;

/// The case of one plan, by its number from 1.
pub const PLAN_CASE: Family = Family("plan-{number}");
/// The plans side by side.
pub const PLANS_JSON: &str = "plans.json";
/// The same as a page.
pub const PLANS_PAGE: &str = "plans.html";
