//! Gradient, divergence, curl, Laplacian and directional derivative by central differences, all of second order.
//!
//! ```text
//!    +--- v ---+        c: cell, u and v: faces, w: node (the edge across the plane)
//!    |         |        gradient    c -> u, v        divergence    u, v -> c
//!    u    c    u        curl        u, v -> w        and           w -> u, v
//!    |         |
//!    w--- v ---w        Source: [harlow1965], [lipnikov2014]; tests: crates/tumble-f64/tests/operators.rs
//! ```

use super::stencil::{Combination, Term, combine, each_row, fetch, ghosted, second};
use crate::math::Real;
use crate::state::{Field, GridError, Place, Vectors};

/// The gradient of a field of cells on faces, (c_i - c_{i-1})/dx. On a wall its sides decide: closed, it is 0.   (grids.3)
pub fn gradient(f: &Field, out: &mut Vectors) -> Result<(), GridError> {
    f.expect(&f.grid, Place::Cell, "gradient of a field")?;
    out.check(&f.grid, f.grid.axes().map(Place::Face).collect(), "gradient")?;
    for (axis, part) in f.grid.axes().zip(&mut out.parts) {
        combine(part, &[Term { of: f, axis, kind: Combination::Difference, scale: 1.0 / f.grid.dx }]);
    }
    Ok(())
}

/// The divergence of vectors on faces, at cells: what flows out through the faces. Needs nothing from beyond walls. (grids.4)
pub fn divergence(u: &Vectors, out: &mut Field) -> Result<(), GridError> {
    let grid = u.on_faces("divergence of vectors")?;
    out.expect(&grid, Place::Cell, "divergence")?;
    let term = |(axis, of)| Term { of, axis, kind: Combination::Difference, scale: 1.0 / grid.dx };
    combine(out, &grid.axes().zip(&u.parts).map(term).collect::<Vec<_>>());
    Ok(())
}

/// The curl of vectors on faces, on edges; or of vectors on edges, on faces, whose divergence is then 0.          (grids.5)
pub fn curl(u: &Vectors, out: &mut Vectors) -> Result<(), GridError> {
    let Some(grid) = u.parts.first().map(|f| f.grid) else { return Err(GridError::Grids { what: "curl of vectors" }) };
    let faces: Vec<Place> = grid.axes().map(Place::Face).collect();
    let edges = grid.flat.map_or_else(|| (0..3).map(Place::Edge).collect(), |_| vec![Place::Node]);
    let from_edges = u.parts.iter().all(|f| !matches!(f.place, Place::Face(_) | Place::Cell));
    let (from, to) = if from_edges { (edges, faces) } else { (faces, edges) };
    u.check(&grid, from, "curl of vectors")?;
    out.check(&grid, to, "curl")?;
    for part in &mut out.parts {
        let c = match part.place {
            Place::Face(a) | Place::Edge(a) => a,
            _ => grid.flat.unwrap_or(2),
        };
        let (a, b) = ((c + 1) % 3, (c + 2) % 3);
        let mut terms = Vec::new();
        for (axis, component, sign) in [(a, b, 1.0), (b, a, -1.0)] {
            if let (true, Some(of)) = (grid.flat != Some(axis), u.part(component)) {
                terms.push(Term { of, axis, kind: Combination::Difference, scale: sign / grid.dx });
            }
        }
        combine(part, &terms);
    }
    Ok(())
}

/// The Laplacian of a field, at its own place: 2 d/dx² times how much the mean of its 2 d neighbours exceeds it.   (grids.6)
pub fn laplacian(f: &Field, out: &mut Field) -> Result<(), GridError> {
    out.expect(&f.grid, f.place, "Laplacian")?;
    second(out, f, false, 1.0 / (f.grid.dx * f.grid.dx));
    Ok(())
}

/// The Laplacian of each component of vectors: what viscosity multiplies.                              (grids.6)
pub fn vector_laplacian(u: &Vectors, out: &mut Vectors) -> Result<(), GridError> {
    if u.parts.len() != out.parts.len() {
        return Err(GridError::Components { what: "Laplacian of vectors", expected: u.parts.len(), found: out.parts.len() });
    }
    u.parts.iter().zip(&mut out.parts).try_for_each(|(f, out)| laplacian(f, out))
}

/// The field at another place: the mean of its two nearest points along each axis on which the places differ. (grids.7)
pub fn average(f: &Field, place: Place) -> Result<Field, GridError> {
    let grid = f.grid;
    let place = grid.place(place)?;
    let mut here = f.clone();
    for axis in grid.axes() {
        if grid.on_walls(here.place, axis) == grid.on_walls(place, axis) {
            continue;
        }
        let walls = std::array::from_fn(|a| grid.on_walls(if a == axis { place } else { here.place }, a));
        let mut there = Field { sides: f.sides, ..Field::new(grid, grid.place_on(walls), f.unit.clone())? };
        combine(&mut there, &[Term { of: &here, axis, kind: Combination::Average, scale: 0.5 }]);
        here = there;
    }
    Ok(here)
}

/// The directional derivative u . grad f at the place of f: averages of u times central differences of f.    (grids.8)
pub fn directional(u: &Vectors, f: &Field, out: &mut Field) -> Result<(), GridError> {
    let grid = u.on_faces("velocity of a directional derivative")?;
    f.expect(&grid, f.place, "field of a directional derivative")?;
    out.expect(&grid, f.place, "directional derivative")?;
    out.data.fill(0.0);
    let mut slope = Field::new(grid, f.place, f.unit.clone())?;
    for (axis, part) in grid.axes().zip(&u.parts) {
        let speed = average(part, f.place)?;
        combine(&mut slope, &[Term { of: f, axis, kind: Combination::Central, scale: 0.5 / grid.dx }]);
        each_row(out, |j, k, row| {
            let at = slope.index([0, j, k]);
            for (i, out) in row.iter_mut().enumerate() {
                *out += speed.data[at + i] * slope.data[at + i];
            }
        });
    }
    Ok(())
}

/// The directional derivative u . grad f with each difference taken from where the flow comes: of first order, and it damps.
/// Steps up to dx over the sum of |u_a| are stable.                                                (compressible.3)
pub fn upwind(u: &Vectors, f: &Field, out: &mut Field) -> Result<(), GridError> {
    let grid = u.on_faces("velocity of an upwind derivative")?;
    f.expect(&grid, f.place, "field of an upwind derivative")?;
    out.expect(&grid, f.place, "upwind derivative")?;
    out.data.fill(0.0);
    let scale = (1.0 / grid.dx) as Real;
    for (axis, part) in grid.axes().zip(&u.parts) {
        let speed = average(part, f.place)?;
        each_row(out, |j, k, row| {
            let (j, k) = (j as isize, k as isize);
            let (mut below, mut above, mut own) = (Vec::new(), Vec::new(), Vec::new());
            let at = |m: isize| if axis == 1 { (j + m, k) } else { (j, k + m) };
            let c = fetch(f, j, k, &mut own);
            let (low, high) =
                if axis == 0 { (c, c) } else { (fetch(f, at(-1).0, at(-1).1, &mut below), fetch(f, at(1).0, at(1).1, &mut above)) };
            let start = speed.index([0, j as usize, k as usize]);
            let n = row.len();
            for i in 0..n {
                let (a, b) = match axis {
                    0 if i == 0 || i + 1 == n => (ghosted(f, [i as isize - 1, j, k]), ghosted(f, [i as isize + 1, j, k])),
                    0 => (c[i - 1], c[i + 1]),
                    _ => (low[i], high[i]),
                };
                let s = speed.data[start + i];
                row[i] += scale * s * if s > 0.0 { c[i] - a } else { b - c[i] };
            }
        });
    }
    Ok(())
}
