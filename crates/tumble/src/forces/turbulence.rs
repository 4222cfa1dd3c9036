//! Curl noise: a random field without sources.

use super::push::{differences, near};
use super::{Force, Group, One};
use crate::elements::Block;
use crate::math::{Real, Row, Signal, Vec3, functions, row, xyz64};

/// u = strength C sum over o of roughness^o (curl psi)(x/L_o + o d) / sqrt(sum of roughness^(2 o)),   L_o = scale/2^o     (particles.10)
///
/// psi is a vector of three gradient noises on a lattice, C makes the root mean square of |u| the strength, and each octave has
/// half the scale of the one before. In time, gradients go from one random value to the next `rate` times a second.
/// div u = 0 exactly: u is a curl, with derivatives of psi in closed form.
/// Source: [bridson2007], [perlin2002] for the fade, [jarzynski2020] for the hash.   Differs: the strength is a root mean square.
pub struct Turbulence {
    /// Root mean square [m/s² or m/s].
    pub strength: Signal,
    /// Size of the largest swirls [m].
    pub scale: f64,
    /// How many sizes.
    pub octaves: u32,
    /// Strength of each octave over that of the one before.
    pub roughness: f64,
    /// Changes per second [1/s].
    pub rate: f64,
    /// Which of the many fields.
    pub seed: u32,
    /// The axis across the plane of a scene of dimension 2.
    pub flat: Option<usize>,
}

/// 1 over the root mean square of the curl of gradient noise with a lattice of 1: in space, and in a plane.
/// With weights W and gradients whose nine numbers have the variance s² = 0.33398, the mean square is that of all corners,
/// s² (2 |grad W|² |d|² + 4 W grad W·d + 6 W²) in space, s² (|grad W|² |d|² + 2 W grad W·d + 2 W²) in a plane, over a cell.
const UNIT: [f64; 2] = [0.818_819_749_559_743_3, 1.385_192_804_959_218];

impl Turbulence {
    /// The field at a place and a time.
    pub fn value(&self, t: f64, x: Vec3<f64>) -> Vec3<f64> {
        let (mut sum, mut gain, mut power, mut cells) = (Vec3::from([0.0; 3]), 1.0, 0.0, 1.0 / self.scale);
        for octave in 0..self.octaves {
            // Octaves do not share the corners of their lattices.
            let shift = 0.37 * f64::from(octave);
            let q = x * cells + Vec3 { x: shift, y: 2.0 * shift, z: 3.0 * shift };
            sum = sum + self.curl(self.rate * t, q, octave) * gain;
            power += gain * gain;
            gain *= self.roughness;
            cells *= 2.0;
        }
        sum * (self.strength.value(t) * UNIT[usize::from(self.flat.is_some())] / power.sqrt())
    }

    /// Sum over the eight corners of (grad W) x (G d) + W axial(G): the curl of psi = sum of W G d.
    fn curl(&self, tau: f64, q: Vec3<f64>, octave: u32) -> Vec3<f64> {
        let mut q = [q.x, q.y, q.z];
        if let Some(axis) = self.flat {
            q[axis] = 0.0;
        }
        let (mut cell, mut part, mut weight, mut slope) = ([0_u32; 3], [0.0; 3], [[0.0; 2]; 3], [0.0; 3]);
        for a in 0..3 {
            let below = functions::floor(q[a]);
            (cell[a], part[a]) = (below as i64 as u32, q[a] - below);
            let (fade, rise) = fade(part[a]);
            (weight[a], slope[a]) = ([1.0 - fade, fade], rise);
        }
        let (slice, blend) = (functions::floor(tau), fade(tau - functions::floor(tau)).0);
        let even = 1.0 / (blend * blend + (1.0 - blend) * (1.0 - blend)).sqrt();
        let (now, next) = ((1.0 - blend) * even, blend * even);
        let key = |slice: u32| slice.wrapping_mul(0x9E37_79B9) ^ self.seed.wrapping_add(octave.wrapping_mul(0x85EB_CA6B));
        let slice = slice as i64 as u32;
        let mut sum = Vec3::from([0.0; 3]);
        for corner in 0..8_usize {
            let bit = [corner & 1, corner >> 1 & 1, corner >> 2];
            if let Some(axis) = self.flat
                && bit[axis] == 1
            {
                continue;
            }
            let at = |a: usize| cell[a].wrapping_add(bit[a] as u32);
            let mut g = gradients([at(0), at(1), at(2), key(slice)]);
            if next > 0.0 {
                let later = gradients([at(0), at(1), at(2), key(slice.wrapping_add(1))]);
                for a in 0..9 {
                    g[a] = now * g[a] + next * later[a];
                }
            }
            let mut w: [f64; 3] = std::array::from_fn(|a| weight[a][bit[a]]);
            let mut rise: [f64; 3] = std::array::from_fn(|a| if bit[a] == 1 { slope[a] } else { -slope[a] });
            let mut d: [f64; 3] = std::array::from_fn(|a| part[a] - bit[a] as f64);
            if let Some(axis) = self.flat {
                // The plane lies on the lattice, and psi points across it.
                (w[axis], rise[axis], d[axis]) = (1.0, 0.0, 0.0);
                for a in (0..3).filter(|a| *a != axis) {
                    g[3 * a..3 * a + 3].fill(0.0);
                }
            }
            let grad = Vec3 { x: rise[0] * w[1] * w[2], y: w[0] * rise[1] * w[2], z: w[0] * w[1] * rise[2] };
            let psi = Vec3::from(std::array::from_fn::<f64, 3, _>(|a| g[3 * a] * d[0] + g[3 * a + 1] * d[1] + g[3 * a + 2] * d[2]));
            let axial = Vec3 { x: g[7] - g[5], y: g[2] - g[6], z: g[3] - g[1] };
            sum = sum + grad.cross(psi) + axial * (w[0] * w[1] * w[2]);
        }
        if let Some(axis) = self.flat {
            let mut flat = [sum.x, sum.y, sum.z];
            flat[axis] = 0.0;
            return flat.into();
        }
        sum
    }
}

/// 6 s^5 - 15 s^4 + 10 s³ and its derivative.
fn fade(s: f64) -> (f64, f64) {
    (s * s * s * (s * (6.0 * s - 15.0) + 10.0), 30.0 * s * s * (s - 1.0) * (s - 1.0))
}

/// Nine numbers between -1 and 1 for a corner of a lattice: three gradients.
fn gradients(corner: [u32; 4]) -> [f64; 9] {
    let words = hash(corner);
    std::array::from_fn(|i| f64::from(words[i / 3] >> (10 * (i % 3)) & 1023) / 511.5 - 1.0)
}

/// pcg4d.
fn hash(v: [u32; 4]) -> [u32; 4] {
    let mut v = v.map(|word| word.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    for round in 0..2 {
        v[0] = v[0].wrapping_add(v[1].wrapping_mul(v[3]));
        v[1] = v[1].wrapping_add(v[2].wrapping_mul(v[0]));
        v[2] = v[2].wrapping_add(v[0].wrapping_mul(v[1]));
        v[3] = v[3].wrapping_add(v[1].wrapping_mul(v[2]));
        if round == 0 {
            v = v.map(|word| word ^ (word >> 16));
        }
    }
    v
}

impl Force for Turbulence {
    fn add(&self, t: f64, group: Group<'_>, force: &mut [Row]) {
        for ((f, m), x) in force.iter_mut().zip(group.mass).zip(group.x) {
            let a = self.value(t, xyz64(*x)) * f64::from(*m);
            *f = crate::math::add(*f, row(Vec3 { x: a.x as Real, y: a.y as Real, z: a.z as Real }, 0.0));
        }
    }

    /// By central differences.
    fn matrix(&self, t: f64, one: &One) -> (Block, Block) {
        let (k, _) = differences(|x, _| self.value(t, x) * one.mass, one, self.scale * near(0.0), 1.0);
        (k, [0.0; 6])
    }
}
