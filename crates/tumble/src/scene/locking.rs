//! Blocks whose tetrahedra lock. A linear tetrahedron has one strain, so where its volume must stay it has no way to bend: the nearer Poisson's
//! ratio is to 0.5 and the fewer cells there are across, the stiffer a beam of them.

use tumble_interface::Warning;
use tumble_interface::check::{plain, short};
use tumble_interface::scene::{Block, Scene};
use tumble_interface::warning::Code;

/// Poisson's ratio from which on it is told, and the excess stiffness.
const LEAST: f64 = 0.45;
const WORTH: f64 = 0.1;
/// Cells across, and 1/(1 - 2 nu), of the table below.
const CELLS: [f64; 4] = [1.0, 2.0, 4.0, 6.0];
const RATIOS: [f64; 3] = [10.0, 50.0, 500.0];
/// Excess stiffness of a cantilever of five times its thickness over Timoshenko's beam, cubic cells; crates/tumble-f64/tests/locking.rs
/// measures it.
const EXCESS: [[f64; 3]; 4] = [[6.217, 12.965, 18.699], [2.238, 6.556, 16.150], [0.718, 2.387, 10.524], [0.372, 1.249, 6.775]];

/// Blocks that lock.
pub fn locking(scene: &Scene) -> impl Iterator<Item = Warning> {
    scene.block.iter().filter_map(|block: &Block| {
        let nu = block.material.as_ref()?.poisson;
        let cells = block.resolution.iter().min()?.saturating_sub(1);
        let excess = excess(f64::from(cells), nu);
        let message = format!(
            "at Poisson's ratio {} its linear tetrahedra lock: with {cells} cell{} across, it resists bending about {} % more than it should; take more cells \
             across, or a ratio of 0.4 or less, which costs some of the volume",
            plain(nu),
            if cells == 1 { "" } else { "s" },
            short(100.0 * excess)
        );
        (nu >= LEAST && excess > WORTH).then(|| Warning::new(Code::Locking, format!("block \"{}\".material.poisson", block.name), message))
    })
}

/// The excess stiffness, by interpolation of logarithms; beyond six cells it falls as it does up to there.
fn excess(cells: f64, nu: f64) -> f64 {
    let part = |list: &[f64], x: f64| {
        let i = list[1..list.len() - 1].iter().filter(|limit| x >= **limit).count();
        (i, ((x / list[i]).ln() / (list[i + 1] / list[i]).ln()).max(0.0))
    };
    let ((i, s), (j, t)) = (part(&CELLS, cells.max(1.0)), part(&RATIOS, 1.0 / (1.0 - 2.0 * nu)));
    let log = |i: usize, j: usize| EXCESS[i][j].ln();
    let mix = |a: f64, b: f64, s: f64| a + (b - a) * s;
    let of = |i: usize| mix(log(i, j), log(i, j + 1), t);
    mix(of(i), of(i + 1), s).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_met_at_its_places_and_grows_between_them() {
        for (cells, row) in CELLS.iter().zip(EXCESS) {
            for (ratio, value) in RATIOS.iter().zip(row) {
                let found = excess(*cells, 0.5 * (1.0 - 1.0 / ratio));
                assert!((found / value - 1.0).abs() < 1e-9, "{cells} {ratio}: {found} {value}");
            }
        }
        assert!(excess(3.0, 0.47) < excess(2.0, 0.47) && excess(3.0, 0.47) < excess(3.0, 0.48));
        assert!(excess(12.0, 0.45) < 0.5 * EXCESS[3][0]);
    }
}
