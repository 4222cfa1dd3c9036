//! What the glue between pieces of a body holds in a sub-step, and where it fails.
//!
//!   m_k (a + α × d_k + ω × (ω × d_k)) = f_k + sum of t A,   t = δ + φ × ρ,   σ/2 + sqrt(σ²/4 + τ²) <= strength          (fracture.1)
//!
//! Pieces are rigid, faces between them springs of one stiffness per area: δ and φ are the displacement and the turn of one piece against the other
//! at the centroid of the face, t the traction at the way ρ from it, σ its part along the normal and τ that across. The stiffness cancels out.

use super::pattern::{Bond, Pattern, Weight, steiner, times};
use crate::geometry::Vector;

/// Force [N] and moment about its centre [N m] on a piece; or how it is displaced and turned.
pub type Six = [Vector; 2];

/// Residual of the balance over the load.
const RESIDUAL: f64 = 1e-11;

/// A cluster of pieces in a sub-step.
pub struct Cluster<'a> {
    /// How it breaks.
    pub pattern: &'a Pattern,
    /// Its pieces, in order.
    pub members: Vec<usize>,
    /// Bonds among them that hold.
    pub bonds: Vec<usize>,
    /// Force at, and moment about, the centre of each piece by contacts and joints, in the axes of the whole.
    pub loads: Vec<Six>,
    /// Its angular velocity in these [rad/s].
    pub spin: Vector,
}

impl Cluster<'_> {
    /// The tension in each of its bonds: the largest principal stress on its face [Pa].
    pub fn tensions(&self) -> Vec<f64> {
        let displaced = self.displaced(&self.unbalanced());
        self.links().map(|(bond, [a, b])| tension(bond, self.between(&displaced, bond, [a, b]))).collect()
    }

    /// Its bonds, and the places of both pieces among its members.
    fn links(&self) -> impl Iterator<Item = (&Bond, [usize; 2])> {
        let place = |k: usize| self.members.partition_point(|member| *member < k);
        self.bonds.iter().map(move |i| {
            let bond = &self.pattern.bonds[*i];
            (bond, bond.pair.map(place))
        })
    }

    /// What bonds have to hold of each piece: its load less what its share in the rigid motion takes.
    fn unbalanced(&self) -> Vec<Six> {
        let weights = || self.members.iter().map(|k| &self.pattern.pieces[*k].weight);
        let all = Weight::sum(weights());
        let force = self.loads.iter().fold(Vector::default(), |sum, [f, _]| sum + *f);
        let moment = weights().zip(&self.loads).fold(Vector::default(), |sum, (w, [f, t])| sum + *t + (w.center - all.center).cross(*f));
        let w = self.spin;
        let a = force * (1.0 / all.mass);
        let alpha = solved(all.inertia, moment - w.cross(times(all.inertia, w)));
        let rest = |(weight, [f, t]): (&Weight, &Six)| {
            let d = weight.center - all.center;
            let moved = a + alpha.cross(d) + w.cross(w.cross(d));
            let turned = times(weight.inertia, alpha) + w.cross(times(weight.inertia, w));
            [*f - moved * weight.mass, *t - turned]
        };
        weights().zip(&self.loads).map(rest).collect()
    }

    /// How the second of two pieces is displaced against the first at the centroid of their face, and turned.
    fn between(&self, x: &[Six], bond: &Bond, [a, b]: [usize; 2]) -> Six {
        let at = |k: usize| x[k][0] + x[k][1].cross(bond.center - self.pattern.pieces[self.members[k]].weight.center);
        [at(b) - at(a), x[b][1] - x[a][1]]
    }

    /// The stiffness of all bonds times displacements.
    fn stiff(&self, x: &[Six]) -> Vec<Six> {
        let mut y = vec![[Vector::default(); 2]; x.len()];
        for (bond, pair) in self.links() {
            let [shift, turn] = self.between(x, bond, pair);
            let (force, moment) = (shift * bond.area, times(bond.second, turn));
            for (k, sign) in pair.into_iter().zip([-1.0, 1.0]) {
                let arm = bond.center - self.pattern.pieces[self.members[k]].weight.center;
                y[k] = [y[k][0] + force * sign, y[k][1] + (arm.cross(force) + moment) * sign];
            }
        }
        y
    }

    /// Displacements under balanced loads, over the stiffness per area: by conjugate gradients, with the blocks of pieces.
    fn displaced(&self, loads: &[Six]) -> Vec<Six> {
        let blocks = self.blocks();
        let dot = |a: &[Six], b: &[Six]| a.iter().zip(b).map(|(a, b)| a[0].dot(b[0]) + a[1].dot(b[1])).sum::<f64>();
        let eased = |r: &[Six]| -> Vec<Six> { blocks.iter().zip(r).map(|(block, r)| block.solve(*r)).collect() };
        let mut x = vec![[Vector::default(); 2]; loads.len()];
        let mut r = loads.to_vec();
        let mut z = eased(&r);
        let (mut p, mut rz) = (z.clone(), dot(&r, &z));
        let least = rz * RESIDUAL * RESIDUAL;
        for _ in 0..12 * loads.len() + 20 {
            if rz <= least || rz == 0.0 {
                break;
            }
            let y = self.stiff(&p);
            let along = dot(&p, &y);
            if along <= 0.0 {
                break;
            }
            add(&mut x, &p, rz / along);
            add(&mut r, &y, -rz / along);
            z = eased(&r);
            let next = dot(&r, &z);
            let back = next / rz;
            p = z.iter().zip(&p).map(|(z, p)| [z[0] + p[0] * back, z[1] + p[1] * back]).collect();
            rz = next;
        }
        x
    }

    /// The part of the stiffness that each piece has by itself.
    fn blocks(&self) -> Vec<Block> {
        let mut sums = vec![[[0.0; 6]; 6]; self.members.len()];
        for (bond, pair) in self.links() {
            for k in pair {
                let arm = bond.center - self.pattern.pieces[self.members[k]].weight.center;
                let (own, away) = (&mut sums[k], steiner(arm));
                let turn: [f64; 6] = std::array::from_fn(|i| bond.second[i] + bond.area * away[i]);
                let full = |[xx, yy, zz, xy, yz, zx]: [f64; 6]| [[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]];
                let (turn, Vector { x, y, z }) = (full(turn), arm * bond.area);
                // u + θ × arm: the force of a turn is that of its displacement.
                let cross = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]];
                for i in 0..3 {
                    own[i][i] += bond.area;
                    for j in 0..3 {
                        own[3 + i][3 + j] += turn[i][j];
                        own[i][3 + j] += cross[i][j];
                        own[3 + j][i] += cross[i][j];
                    }
                }
            }
        }
        sums.into_iter().map(Block::new).collect()
    }
}

fn add(x: &mut [Six], p: &[Six], times: f64) {
    x.iter_mut().zip(p).for_each(|(x, p)| *x = [x[0] + p[0] * times, x[1] + p[1] * times]);
}

/// A symmetric matrix, xx, yy, zz, xy, yz, zx, that is inverted: x of A x = b.
fn solved([xx, yy, zz, xy, yz, zx]: [f64; 6], b: Vector) -> Vector {
    let [p, q, r]: [Vector; 3] = [[xx, xy, zx].into(), [xy, yy, yz].into(), [zx, yz, zz].into()];
    let det = p.dot(q.cross(r));
    (q.cross(r) * b.x + r.cross(p) * b.y + p.cross(q) * b.z) * (1.0 / det)
}

/// The largest principal stress on a face, over its corners [Pa].
fn tension(bond: &Bond, [shift, turn]: Six) -> f64 {
    let at = |corner: &Vector| {
        let t = shift + turn.cross(*corner);
        let along = t.dot(bond.normal);
        let across = (t.norm_sq() - along * along).max(0.0);
        0.5 * along + (0.25 * along * along + across).sqrt()
    };
    bond.corners.iter().map(at).fold(0.0, f64::max)
}

/// L of L Lᵀ, a block of six.
struct Block([[f64; 6]; 6]);

impl Block {
    fn new(mut a: [[f64; 6]; 6]) -> Self {
        for i in 0..6 {
            for j in 0..=i {
                let sum: f64 = (0..j).map(|k| a[i][k] * a[j][k]).sum();
                a[i][j] = if i == j { (a[i][i] - sum).max(f64::MIN_POSITIVE).sqrt() } else { (a[i][j] - sum) / a[j][j] };
            }
        }
        Self(a)
    }

    fn solve(&self, [u, v]: Six) -> Six {
        let l = &self.0;
        let mut b = [u.x, u.y, u.z, v.x, v.y, v.z];
        for i in 0..6 {
            b[i] = (b[i] - (0..i).map(|k| l[i][k] * b[k]).sum::<f64>()) / l[i][i];
        }
        for i in (0..6).rev() {
            b[i] = (b[i] - (i + 1..6).map(|k| l[k][i] * b[k]).sum::<f64>()) / l[i][i];
        }
        [[b[0], b[1], b[2]].into(), [b[3], b[4], b[5]].into()]
    }
}
