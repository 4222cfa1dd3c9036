//! Columns and topology of the objects of a system.

use super::Dynamics;
use crate::elements::{Batch, Constraints};
use crate::math::{Real, Row};
use crate::state::Object;
use std::ops::Range;
use tumble_interface::{Column, Data};

impl Dynamics {
    pub(super) fn write_columns(&self, names: &[&str], out: &mut Vec<Column>) {
        if names.contains(&"force") && self.core.liquids().next().is_some() {
            let solids = self.core.laws.colliders.iter().enumerate();
            let force = |solid: usize| <[f64; 3]>::from(self.features.liquid_loads.force(solid)).to_vec();
            out.extend(solids.map(|(solid, collider)| Column::new(&collider.name, "force", force(solid))));
        }
        for (index, object) in self.core.objects.iter().enumerate() {
            let tear = self.features.fracture.tears().iter().find(|tear| tear.object() == index);
            for name in names {
                let data: Vec<Real> = match *name {
                    "position" => {
                        let mut x = numbers(&self.core.state.x[object.points.clone()], 3);
                        // Spare vertices are where the first one is, out of every picture.
                        for i in tear.iter().flat_map(|tear| tear.idle()) {
                            x.copy_within(0..3, 3 * (i - object.points.start));
                        }
                        x
                    }
                    "velocity" => numbers(&self.core.state.v[object.points.clone()], 3),
                    "orientation" if !object.frames.is_empty() => numbers(&self.core.state.x[object.frames.clone()], 4),
                    "angular_velocity" if !object.frames.is_empty() => numbers(&self.core.state.v[object.frames.clone()], 3),
                    "pressure" => match self.features.liquid_loads.pressure(&self.core, &object.points) {
                        Some(pressure) => pressure,
                        None => continue,
                    },
                    "link_strain" if !object.links.is_empty() => self.link_strain(object),
                    _ => continue,
                };
                out.push(object.column(name, Data::from(data)));
                if let (Some(tear), &"position") = (tear, name) {
                    let first = object.points.start as u32;
                    let triangles = tear.triangles().iter().flatten().map(|i| i - first).collect();
                    out.push(object.column("triangles", Data::U32(triangles)));
                }
            }
            if let Some(stream) = object.stream {
                self.core.pool.write(stream, &object.name, &self.core.laws.masses.mass, out);
            }
        }
    }

    /// A quantity of the elements that are the links of an object.
    fn of_links<T: Clone>(
        &self,
        object: &Object,
        of_constraints: impl Fn(&dyn Constraints) -> Vec<T>,
        of_batch: impl Fn(&dyn Batch) -> Vec<T>,
    ) -> Vec<T> {
        let of = |(batch, range): &(usize, Range<usize>)| {
            let all = match self.core.constraints.get(*batch) {
                Some(constraints) => of_constraints(constraints.as_ref()),
                None => of_batch(self.core.laws.batches[*batch].as_ref()),
            };
            all[range.clone()].to_vec()
        };
        object.links.iter().flat_map(of).collect()
    }

    fn link_strain(&self, object: &Object) -> Vec<Real> {
        let x = &self.core.state.x;
        self.of_links(object, |c| c.link_strain(x), |b| b.link_strain(x))
    }

    /// The two points of each link, counted from the object's first.
    fn link_ends(&self, object: &Object) -> Vec<u32> {
        let ends = self.of_links(object, |c| c.link_ends(), |b| b.link_ends());
        ends.concat().into_iter().map(|row| row - object.points.start as u32).collect()
    }

    pub(super) fn write_topology(&self, out: &mut Vec<Column>) {
        for object in &self.core.objects {
            let mut add = |name: &str, data: Data| {
                if !data.is_empty() {
                    out.push(object.column(name, data));
                }
            };
            if let Some(stream) = object.stream {
                if !self.core.pool.emitter(stream).has_radii() {
                    add("radius", Data::F64(vec![object.radius]));
                }
                continue;
            }
            add("mass", Data::from(self.core.laws.masses.mass[object.points.clone()].to_vec()));
            let points = object.points.start..object.points.end - object.spare;
            let pinned = points.filter(|i| self.core.state.x[*i][3] == 0.0).map(|i| (i - object.points.start) as u32);
            add("pinned", Data::U32(pinned.collect()));
            add("triangles", Data::U32(object.triangles.concat()));
            add("texture", Data::F32(object.texture.concat()));
            add("links", Data::U32(self.link_ends(object)));
            add("curve", Data::U32(object.curve.clone()));
            if object.curve_points > 0 {
                add("curve_points", Data::U32(vec![object.curve_points]));
            }
            if object.radius > 0.0 {
                add("radius", Data::F64(vec![object.radius]));
            }
        }
    }
}

fn numbers(rows: &[Row], width: usize) -> Vec<Real> {
    rows.iter().flat_map(|r| r[..width].iter().copied()).collect()
}
