//! Velocity fields u(x, t): they carry tracers, and are the air of winds.

use super::on_grid::OnGrid;
use super::turbulence::Turbulence;
use super::vortex::Vortex;
use crate::math::{Dual, Lane, Real, Row, Signal, Vec3, VectorSignal, ZERO, add, row, xyz, xyz64};

/// One velocity field.
#[allow(clippy::large_enum_variant)] // a scene has few
pub enum Current {
    /// The same everywhere.
    Uniform(VectorSignal),
    /// u = rate axis x (x - center)
    Swirl {
        /// A point of the axis [m].
        center: Vec3<f64>,
        /// Of length 1.
        axis: Vec3<f64>,
        /// [rad/s]
        rate: Signal,
    },
    /// u = -rate (x - center)
    Sink {
        /// The point [m].
        center: Vec3<f64>,
        /// [1/s]
        rate: Signal,
    },
    /// (particles.6)
    Vortex(Vortex),
    /// (particles.10)
    Turbulence(Turbulence),
    /// A formula of t and x.
    Formula(VectorSignal),
    /// That of a fluid.
    OnGrid(OnGrid),
}

/// A sum of velocity fields; the linear ones are
///
///   u = u0 + rate axis x (x - center),   u = -rate (x - center)        (integrators.15)
#[derive(Default)]
pub struct Flow {
    /// The fields.
    pub fields: Vec<Current>,
    /// The axis across the plane of a scene of dimension 2, along which nothing flows.
    pub flat: Option<usize>,
}

/// A field at one time that is a formula of lanes.
trait Steady {
    fn at<L: Lane>(&self, x: Vec3<L>) -> Vec3<L>;
}

struct Turning(Vec3<f64>, Vec3<f64>);
struct Falling(Vec3<f64>, f64);

fn like<L: Lane>(x: Vec3<L>, v: Vec3<f64>) -> Vec3<L> {
    Vec3 { x: x.x.like(v.x), y: x.x.like(v.y), z: x.x.like(v.z) }
}

impl Steady for Turning {
    #[inline(always)]
    fn at<L: Lane>(&self, x: Vec3<L>) -> Vec3<L> {
        like(x, self.1).cross(x - like(x, self.0))
    }
}

impl Steady for Falling {
    #[inline(always)]
    fn at<L: Lane>(&self, x: Vec3<L>) -> Vec3<L> {
        (x - like(x, self.0)) * x.x.like(-self.1)
    }
}

impl Steady for super::vortex::Whirl {
    #[inline(always)]
    fn at<L: Lane>(&self, x: Vec3<L>) -> Vec3<L> {
        self.value(x)
    }
}

fn narrow(v: Vec3<f64>) -> Row {
    row(Vec3 { x: v.x as Real, y: v.y as Real, z: v.z as Real }, 0.0)
}

fn add_steady(field: &impl Steady, x: &[Row], u: &mut [Row]) {
    for (u, x) in u.iter_mut().zip(x) {
        *u = add(*u, row(field.at(xyz(*x)), 0.0));
    }
}

const UNITS: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

fn slopes(field: &impl Steady, x: Vec3<f64>) -> [Vec3<f64>; 3] {
    UNITS.map(|e| field.at(Vec3::<Dual<f64>>::lift(x, e.into())).slope())
}

fn differences(field: impl Fn(Vec3<f64>) -> Vec3<f64>, x: Vec3<f64>, h: f64) -> [Vec3<f64>; 3] {
    UNITS.map(|e| (field(x + Vec3::from(e) * h) - field(x - Vec3::from(e) * h)) * (0.5 / h))
}

impl Current {
    fn add(&self, t: f64, x: &[Row], u: &mut [Row]) {
        match self {
            Self::Uniform(velocity) => {
                let here = narrow(velocity.value(t));
                u.iter_mut().for_each(|u| *u = add(*u, here));
            }
            Self::Swirl { center, axis, rate } => add_steady(&Turning(*center, *axis * rate.value(t)), x, u),
            Self::Sink { center, rate } => add_steady(&Falling(*center, rate.value(t)), x, u),
            Self::Vortex(vortex) => add_steady(&vortex.now(t), x, u),
            Self::Turbulence(noise) => u.iter_mut().zip(x).for_each(|(u, x)| *u = add(*u, narrow(noise.value(t, xyz64(*x))))),
            Self::OnGrid(fluid) => u.iter_mut().zip(x).for_each(|(u, x)| *u = add(*u, narrow(fluid.at(t, xyz64(*x))))),
            Self::Formula(velocity) => {
                if !velocity.rows(t, x, x, |i, value| u[i] = add(u[i], narrow(value))) {
                    let here = narrow(velocity.value(t));
                    u.iter_mut().for_each(|u| *u = add(*u, here));
                }
            }
        }
    }

    fn at(&self, t: f64, x: Vec3<f64>) -> Vec3<f64> {
        match self {
            Self::Uniform(velocity) | Self::Formula(velocity) => velocity.at(t, x, Vec3::from([0.0; 3])),
            Self::Swirl { center, axis, rate } => Turning(*center, *axis * rate.value(t)).at(x),
            Self::Sink { center, rate } => Falling(*center, rate.value(t)).at(x),
            Self::Vortex(vortex) => vortex.now(t).value(x),
            Self::Turbulence(noise) => noise.value(t, x),
            Self::OnGrid(fluid) => fluid.at(t, x),
        }
    }

    /// By dual numbers, or by central differences where the field is no formula of lanes.
    fn gradient(&self, t: f64, x: Vec3<f64>) -> [Vec3<f64>; 3] {
        match self {
            Self::Uniform(_) => [Vec3::from([0.0; 3]); 3],
            Self::Swirl { center, axis, rate } => slopes(&Turning(*center, *axis * rate.value(t)), x),
            Self::Sink { center, rate } => slopes(&Falling(*center, rate.value(t)), x),
            Self::Vortex(vortex) => slopes(&vortex.now(t), x),
            Self::Turbulence(noise) => differences(|x| noise.value(t, x), x, 6e-6 * noise.scale),
            Self::OnGrid(fluid) => differences(|x| fluid.at(t, x), x, fluid.small()),
            Self::Formula(_) => differences(|x| self.at(t, x), x, super::push::near(x.norm())),
        }
    }
}

impl Flow {
    /// The fluids among them.
    pub fn fluids(&mut self) -> impl Iterator<Item = &mut OnGrid> {
        self.fields.iter_mut().filter_map(|field| if let Current::OnGrid(fluid) = field { Some(fluid) } else { None })
    }

    /// u [m/s] at every row, in place of what `u` holds.
    pub fn velocities(&self, t: f64, x: &[Row], u: &mut [Row]) {
        u.fill(ZERO);
        self.fields.iter().for_each(|field| field.add(t, x, u));
        if let Some(axis) = self.flat {
            u.iter_mut().for_each(|u| u[axis] = 0.0);
        }
    }

    /// u(x, t) [m/s].
    pub fn at(&self, t: f64, x: Vec3<f64>) -> Vec3<f64> {
        let u = self.fields.iter().fold(Vec3::from([0.0; 3]), |u, field| u + field.at(t, x));
        self.in_plane(u)
    }

    /// du/dx, by columns [1/s].
    pub fn gradient(&self, t: f64, x: Vec3<f64>) -> [Vec3<f64>; 3] {
        let mut sum = [Vec3::from([0.0; 3]); 3];
        for field in &self.fields {
            let own = field.gradient(t, x);
            for c in 0..3 {
                sum[c] = sum[c] + own[c];
            }
        }
        sum.map(|column| self.in_plane(column))
    }

    fn in_plane(&self, u: Vec3<f64>) -> Vec3<f64> {
        let mut u = <[f64; 3]>::from(u);
        if let Some(axis) = self.flat {
            u[axis] = 0.0;
        }
        u.into()
    }
}
