//! A measured fabric as data; reading one from bytes is the work of `tumble-io`.

/// The record of a fabric: what it weighs, and how it resists stretch and bending.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Fabric {
    /// Its name, which may be empty.
    pub name: String,
    /// Composition; may be empty.
    pub composition: String,
    /// Source of the measurement; may be empty.
    pub source: String,
    /// Mass per area [kg/m²].
    pub density: f64,
    /// C11, C12, C22, C33 [N/m], 1 being the warp, 2 the weft, 33 the shear. The first row is for small strains, the others for the stretch 7/6
    /// at 0, 22.5, 45, 67.5 and 90 degrees from the warp. Negative numbers count as 0.
    pub stretching: [[f64; 4]; 6],
    /// Bending stiffness [N m] across creases at 0, 45 and 90 degrees from the warp, for the curvatures 0, 10, 20, 30 and 40 per metre. Negative
    /// numbers count as 0.
    pub bending: [[f64; 5]; 3],
}
