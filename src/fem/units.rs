//! The only place that knows both worlds: files, meshes and sets speak mm, the solver speaks SI (m, N, kg, Pa, s).

/// Metres in a millimetre.
pub const METRES_PER_MM: f64 = 1e-3;

/// A position or displacement in mm as metres.
pub fn metres(mm: [f64; 3]) -> [f64; 3] {
    mm.map(|x| x * METRES_PER_MM)
}

/// A position or displacement in metres as mm.
pub fn millimetres(m: [f64; 3]) -> [f64; 3] {
    m.map(|x| x / METRES_PER_MM)
}
