//! Skins and movements of glTF 2.0. Every node is a joint; what no skin binds hangs on its node.

use crate::build::{self, DAMAGED, Weld};
use crate::glb::{Affine, INDICES, Scene, VALUES, nodes, not_in_scene, open};
use gltf::Semantic;
use gltf::animation::{Interpolation, Property};
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{Mode, Primitive};
use gltf::json::scene::Node;
use gltf::json::validation::Checked;
use tumble_interface::Mesh;
use tumble_interface::character::{Between, Bind, Character, Clip, Influence, Joint, Part, Track, Transform};

const ROTATIONS: [ComponentType; 5] = [ComponentType::F32, ComponentType::I8, ComponentType::U8, ComponentType::I16, ComponentType::U16];

pub fn read(bytes: &[u8]) -> Result<Character, String> {
    if bytes.is_empty() {
        return Err("the file is empty; export the character again".to_owned());
    }
    let (root, buffers) = open(bytes)?;
    let mut reader = Reader {
        scene: Scene { root: &root, buffers: &buffers, values: VALUES.max(bytes.len()), mesh: Mesh::default() },
        joint_of: vec![None; root.nodes.len()],
        character: Character::default(),
    };
    reader.joints()?;
    reader.surfaces()?;
    reader.clips()?;
    reader.finish()
}

struct Reader<'a> {
    scene: Scene<'a>,
    /// Of each node its joint.
    joint_of: Vec<Option<u32>>,
    character: Character,
}

impl<'a> Reader<'a> {
    fn joints(&mut self) -> Result<(), String> {
        for (i, (n, parent)) in nodes(self.scene.root)?.into_iter().enumerate() {
            let node = &self.scene.root.nodes[n];
            let rest = rest(node);
            let numbers = rest.translation.iter().chain(&rest.rotation).chain(&rest.scale);
            if numbers.into_iter().any(|x| !x.is_finite()) {
                return Err(format!("node {n} has a transform that is not finite; {DAMAGED}"));
            }
            self.joint_of[n] = Some(i as u32);
            self.character.joints.push(Joint { name: node.name.clone().unwrap_or_default(), parent: parent.map(|p| p as u32), rest });
        }
        Ok(())
    }

    fn joint(&self, node: usize) -> Result<u32, String> {
        self.joint_of.get(node).copied().flatten().ok_or_else(|| not_in_scene(node))
    }

    fn surfaces(&mut self) -> Result<(), String> {
        let root = self.scene.root;
        let mut skinned = false;
        let mut places: Vec<Affine> = Vec::new();
        for (n, parent) in nodes(root)? {
            let node = &root.nodes[n];
            let place = parent.map_or(Affine::IDENTITY, |p| places[p]).after(Affine::of(node));
            places.push(place);
            let Some(mesh) = node.mesh else { continue };
            let first = self.character.binds.len() as u32;
            let skin = node.skin.map(|skin| skin.value());
            // The place of a node with a skin means nothing (glTF 2.0, 3.7.3.1).
            let mirrored = skin.is_none() && place.determinant() < 0.0;
            let binds = match skin {
                Some(skin) => self.skin(skin)?,
                None => vec![Bind { joint: self.joint(n)?, inverse: IDENTITY }],
            };
            skinned |= skin.is_some();
            let count = binds.len() as u32;
            self.character.binds.extend(binds);
            let m = mesh.value();
            let mesh = root.meshes.get(m).ok_or_else(|| format!("mesh {m} does not exist; {DAMAGED}"))?;
            let mut weld = Weld::default();
            for primitive in &mesh.primitives {
                let range = skin.map(|_| (first, count));
                self.primitive(primitive, range, first, mirrored, &mut weld).map_err(|e| format!("mesh {m}: {e}"))?;
            }
        }
        if !skinned {
            return Err("no mesh has a skin: nothing is bound to joints; export it with its armature, or use shape.mesh".to_owned());
        }
        Ok(())
    }

    fn skin(&mut self, s: usize) -> Result<Vec<Bind>, String> {
        let joints = self.scene.joints(s)?;
        joints.into_iter().map(|(node, inverse)| Ok(Bind { joint: self.joint(node)?, inverse })).collect()
    }

    /// Appends a primitive. A skin has its binds and their count; without one all hangs on bind `first`.
    fn primitive(
        &mut self,
        primitive: &Primitive,
        skin: Option<(u32, u32)>,
        first: u32,
        mirrored: bool,
        weld: &mut Weld,
    ) -> Result<(), String> {
        self.scene.spend(1)?;
        let Checked::Valid(mode) = primitive.mode else { return Err(format!("unknown kind of primitive; {DAMAGED}")) };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            return Ok(()); // points and lines
        }
        let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).map(|a| a.value());
        let Some(positions) = attribute(Semantic::Positions) else {
            return Err("a primitive without POSITION; export the mesh with its vertices".to_owned());
        };
        let positions = self.scene.column(positions, Type::Vec3, &[ComponentType::F32])?;
        let indices = match primitive.indices {
            Some(column) => Some(self.scene.column(column.value(), Type::Scalar, &INDICES)?),
            None => None,
        };
        let weights = match skin {
            Some(_) => Some(self.scene.weights(primitive, positions.count)?),
            None => None,
        };
        let mut numbers = Vec::with_capacity(positions.count); // bounded by the buffer's length
        for i in 0..positions.count {
            let x = positions.vector(i);
            let number = weld.number(x, self.scene.mesh.vertices.len())?;
            if number as usize == self.scene.mesh.vertices.len() {
                self.scene.mesh.vertices.push(x);
                self.character.skin.push(match (skin, &weights) {
                    (Some((first, count)), Some(weights)) => {
                        let four = weights.four(i, count as usize).map_err(|e| format!("vertex {i}: {e}"))?;
                        four.map(
                            |(joint, weight)| {
                                if weight > 0.0 { Influence { bind: first + joint as u32, weight } } else { Influence::default() }
                            },
                        )
                    }
                    _ => [Influence { bind: first, weight: 1.0 }, Influence::default(), Influence::default(), Influence::default()],
                });
            }
            numbers.push(number);
        }
        self.scene.add_triangles(mode, indices.as_ref(), &numbers, &[], mirrored)
    }

    fn clips(&mut self) -> Result<(), String> {
        let root = self.scene.root;
        for (a, animation) in root.animations.iter().enumerate() {
            let name = animation.name.clone().unwrap_or_else(|| format!("animation {a}"));
            let mut clip = Clip { name, tracks: Vec::new() };
            for (c, channel) in animation.channels.iter().enumerate() {
                let wrong = |e: String| format!("animation {a}, channel {c}: {e}");
                // Channels of hidden nodes or of nodes that are not joints have no effect.
                let node = channel.target.node.value();
                let part = match channel.target.path {
                    Checked::Valid(Property::Translation) => Part::Translation,
                    Checked::Valid(Property::Rotation) => Part::Rotation,
                    Checked::Valid(Property::Scale) => Part::Scale,
                    Checked::Valid(Property::MorphTargetWeights) => continue,
                    Checked::Invalid => return Err(wrong(format!("an unknown path; {DAMAGED}"))),
                };
                if node >= root.nodes.len() {
                    return Err(wrong(format!("node {node} does not exist; {DAMAGED}")));
                }
                let Some(joint) = self.joint_of[node] else { continue };
                let sampler =
                    animation.samplers.get(channel.sampler.value()).ok_or_else(|| wrong(format!("no such sampler; {DAMAGED}")))?;
                let between = match sampler.interpolation {
                    Checked::Valid(Interpolation::Linear) => Between::Linear,
                    Checked::Valid(Interpolation::Step) => Between::Step,
                    Checked::Valid(Interpolation::CubicSpline) => Between::Cubic,
                    Checked::Invalid => return Err(wrong(format!("an unknown interpolation; {DAMAGED}"))),
                };
                let track = self.track(sampler.input.value(), sampler.output.value(), joint, part, between).map_err(wrong)?;
                clip.tracks.push(track);
            }
            self.character.clips.push(clip);
        }
        Ok(())
    }

    fn track(&mut self, input: usize, output: usize, joint: u32, part: Part, between: Between) -> Result<Track, String> {
        let times = self.scene.column(input, Type::Scalar, &[ComponentType::F32])?;
        let (type_, width) = if part == Part::Rotation { (Type::Vec4, 4) } else { (Type::Vec3, 3) };
        let components = if part == Part::Rotation { &ROTATIONS[..] } else { &ROTATIONS[..1] };
        let values = self.scene.column(output, type_, components)?;
        let times: Vec<f64> = (0..times.count).map(|i| times.number(i, 0)).collect();
        let needed = times.len() * if between == Between::Cubic { 3 } else { 1 };
        if times.is_empty() {
            return Err("no keys; export the animation again, or leave it out".to_owned());
        }
        if values.count != needed {
            return Err(format!("{} values for {} times, expected {needed}; {DAMAGED}", values.count, times.len()));
        }
        if times.iter().any(|t| !t.is_finite()) || times.windows(2).any(|t| t[1] <= t[0]) {
            return Err("times that do not increase; export the animation again".to_owned());
        }
        let value = |i: usize| std::array::from_fn(|k| if k < width { values.number(i, k) } else { 0.0 });
        let values: Vec<[f64; 4]> = (0..values.count).map(value).collect();
        if values.as_flattened().iter().any(|x| !x.is_finite()) {
            return Err(format!("a value that is not finite; {DAMAGED}"));
        }
        let keys = |i: &usize| between != Between::Cubic || i % 3 == 1;
        if part == Part::Rotation && (0..values.len()).filter(keys).any(|i| values[i] == [0.0; 4]) {
            return Err(format!("a rotation without length; {DAMAGED}"));
        }
        Ok(Track { joint, part, times, values, between })
    }

    /// Checks the mesh, and drops vertices that no triangle uses.
    fn finish(mut self) -> Result<Character, String> {
        let mesh = self.scene.mesh;
        let mut used = vec![false; mesh.vertices.len()];
        for i in mesh.triangles.as_flattened() {
            if let Some(used) = used.get_mut(*i as usize) {
                *used = true;
            }
        }
        let mut kept = used.iter();
        self.character.skin.retain(|_| kept.next().copied().unwrap_or_default());
        self.character.mesh = build::finish(mesh)?;
        Ok(self.character)
    }
}

const IDENTITY: [[f64; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// Transform of a node in its parent. A matrix is decomposed; shear, which glTF forbids, is lost.
fn rest(node: &Node) -> Transform {
    if node.matrix.is_none() {
        let wide = |v: [f32; 3]| v.map(f64::from);
        let default = Transform::default();
        return Transform {
            translation: node.translation.map_or(default.translation, wide),
            rotation: node.rotation.map_or(default.rotation, |q| q.0.map(f64::from)),
            scale: node.scale.map_or(default.scale, wide),
        };
    }
    let place = Affine::of(node);
    let side = if place.determinant() < 0.0 { -1.0 } else { 1.0 };
    let scale = [0, 1, 2].map(|c| side * place.m.iter().map(|row| row[c] * row[c]).sum::<f64>().sqrt());
    let m = place.m.map(|row| [0, 1, 2].map(|c| if scale[c] == 0.0 { 0.0 } else { row[c] / scale[c] }));
    // The largest of the four numbers first.
    let four = [
        1.0 + m[0][0] - m[1][1] - m[2][2],
        1.0 - m[0][0] + m[1][1] - m[2][2],
        1.0 - m[0][0] - m[1][1] + m[2][2],
        1.0 + m[0][0] + m[1][1] + m[2][2],
    ];
    let largest = (0..4).fold(0, |best, k| if four[k] > four[best] { k } else { best });
    let (xy, yz, zx) = (m[0][1] + m[1][0], m[1][2] + m[2][1], m[2][0] + m[0][2]);
    let (x, y, z) = (m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]);
    let q = match largest {
        0 => [four[0], xy, zx, x],
        1 => [xy, four[1], yz, y],
        2 => [zx, yz, four[2], z],
        _ => [x, y, z, four[3]],
    };
    let n = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    let rotation = if n > 0.0 { q.map(|x| x / n) } else { [0.0, 0.0, 0.0, 1.0] };
    Transform { translation: place.t, rotation, scale }
}
