//! Small files of every format, written by hand.
#![allow(dead_code)] // each test binary uses some

use tumble_interface::Mesh;

/// A tetrahedron with outward faces and three different edge lengths.
pub fn tetrahedron() -> Mesh {
    Mesh {
        vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]],
        triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
        ..Mesh::default()
    }
}

/// Corners of the unit cube and its six faces, outward.
pub const CUBE: [[f64; 3]; 8] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [1.0, 1.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 1.0],
    [1.0, 1.0, 1.0],
    [0.0, 1.0, 1.0],
];
pub const CUBE_FACES: [[u32; 4]; 6] = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];

/// The cube as fans: (a, b, c), (a, c, d) of each face.
pub fn cube() -> Mesh {
    let triangles = CUBE_FACES.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    Mesh { vertices: CUBE.to_vec(), triangles, ..Mesh::default() }
}

pub fn volume(mesh: &Mesh) -> f64 {
    let six = |[a, b, c]: [[f64; 3]; 3]| {
        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    };
    mesh.triangles.iter().map(|t| six(t.map(|i| mesh.vertices[i as usize]))).sum::<f64>() / 6.0
}

/// The cube with quads, as OBJ.
pub fn obj() -> Vec<u8> {
    let mut text = "# a cube\no cube\n".to_owned();
    for [x, y, z] in CUBE {
        text += &format!("v {x} {y} {z}\n");
    }
    for [a, b, c, d] in CUBE_FACES {
        text += &format!("f {} {} {} {}\n", a + 1, b + 1, c + 1, d + 1);
    }
    text.into_bytes()
}

/// The cube with quads, as PLY; `format` as in the header.
pub fn ply(format: &str) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat {format} 1.0\ncomment a cube\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar red\nelement face 6\nproperty list uchar int vertex_indices\nend_header\n"
    )
    .into_bytes();
    match format {
        "ascii" => {
            let rows = CUBE.map(|[x, y, z]| format!("{x} {y} {z} 255\n"));
            let faces = CUBE_FACES.map(|[a, b, c, d]| format!("4 {a} {b} {c} {d}\n"));
            bytes.extend(rows.concat().bytes().chain(faces.concat().bytes()));
        }
        _ => {
            let swap = |mut word: [u8; 4]| {
                if format == "binary_big_endian" {
                    word.reverse();
                }
                word
            };
            for x in CUBE {
                bytes.extend(x.iter().flat_map(|x| swap((*x as f32).to_le_bytes())));
                bytes.push(255);
            }
            for face in CUBE_FACES {
                bytes.push(4);
                bytes.extend(face.iter().flat_map(|i| swap(i.to_le_bytes())));
            }
        }
    }
    bytes
}

/// A skirt of six sides as it is sewn from one panel: the texture goes on where the vertices begin again. All numbers are whole parts of a
/// power of two.
pub fn skirt() -> Mesh {
    let around = [[1.0, 0.0], [0.5, 0.875], [-0.5, 0.875], [-1.0, 0.0], [-0.5, -0.875], [0.5, -0.875]];
    let vertices = [0.0, 0.5].iter().flat_map(|z| around.map(|[x, y]| [x, y, *z])).collect();
    let mut mesh = Mesh { vertices, ..Mesh::default() };
    for i in 0..6_u32 {
        let at = |(i, j): (u32, u32)| i % 6 + 6 * j;
        let flat = |(i, j): (u32, u32)| [0.125 * f64::from(i) - 0.25, 0.25 + 0.0625 * f64::from(j)];
        for t in [[(i, 0), (i + 1, 0), (i + 1, 1)], [(i, 0), (i + 1, 1), (i, 1)]] {
            mesh.triangles.push(t.map(at));
            mesh.texture.push(Some(t.map(flat)));
        }
    }
    mesh
}

/// Vertices of a mesh with texture, split where they have several, those of one place in a row; and its triangles of them.
pub fn split(mesh: &Mesh) -> (Vec<([f64; 3], [f64; 2])>, Vec<[u32; 3]>) {
    let corner = |t: usize, k: usize| (mesh.triangles[t][k], mesh.texture[t].unwrap()[k]);
    let mut all: Vec<(u32, [f64; 2])> = (0..mesh.triangles.len()).flat_map(|t| (0..3).map(move |k| corner(t, k))).collect();
    all.sort_by(|a, b| a.partial_cmp(b).unwrap());
    all.dedup();
    let number = |t: usize, k: usize| all.iter().position(|c| *c == corner(t, k)).unwrap() as u32;
    let triangles = (0..mesh.triangles.len()).map(|t| [0, 1, 2].map(|k| number(t, k))).collect();
    (all.iter().map(|(i, at)| (mesh.vertices[*i as usize], *at)).collect(), triangles)
}

/// A mesh with texture as ASCII PLY, with these names of its coordinates.
pub fn ply_textured(mesh: &Mesh, [u, v]: [&str; 2]) -> Vec<u8> {
    let (vertices, triangles) = split(mesh);
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\nproperty float {u}\n\
         property float {v}\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        vertices.len(),
        triangles.len()
    );
    vertices.iter().for_each(|([x, y, z], [u, v])| text += &format!("{x} {y} {z} {u} {v}\n"));
    triangles.iter().for_each(|[a, b, c]| text += &format!("3 {a} {b} {c}\n"));
    text.into_bytes()
}

/// The same with the coordinates in lists of the faces, and vertices that are not split.
pub fn ply_wedges(mesh: &Mesh) -> Vec<u8> {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\nelement face {}\n\
         property list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n",
        mesh.vertices.len(),
        mesh.triangles.len()
    );
    mesh.vertices.iter().for_each(|[x, y, z]| text += &format!("{x} {y} {z}\n"));
    for ([a, b, c], texture) in mesh.triangles.iter().zip(&mesh.texture) {
        let flat: Vec<String> = texture.unwrap().as_flattened().iter().map(f64::to_string).collect();
        text += &format!("3 {a} {b} {c} 6 {}\n", flat.join(" "));
    }
    text.into_bytes()
}

/// The same as GLB, whose y points up and v down.
pub fn glb_textured(mesh: &Mesh) -> Vec<u8> {
    glb_placed(mesh, "")
}

/// The same, placed by a node with these words.
pub fn glb_placed(mesh: &Mesh, words: &str) -> Vec<u8> {
    let (vertices, triangles) = split(mesh);
    let (n, m) = (vertices.len(), triangles.len());
    let floats = |all: Vec<f64>| all.into_iter().flat_map(|x| (x as f32).to_le_bytes());
    let mut buffer: Vec<u8> = floats(vertices.iter().flat_map(|([x, y, z], _)| [*x, *z, 0.0 - y]).collect()).collect();
    buffer.extend(floats(vertices.iter().flat_map(|v| [v.1[0], 1.0 - v.1[1]]).collect()));
    buffer.extend(triangles.as_flattened().iter().flat_map(|i| (*i as u16).to_le_bytes()));
    let json = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}], "nodes": [{{{words}"mesh": 0}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "TEXCOORD_0": 1}}, "indices": 2}}]}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": {n}, "type": "VEC3"}},
                      {{"bufferView": 1, "componentType": 5126, "count": {n}, "type": "VEC2"}},
                      {{"bufferView": 2, "componentType": 5123, "count": {}, "type": "SCALAR"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": {}}}, {{"buffer": 0, "byteOffset": {}, "byteLength": {}}},
                        {{"buffer": 0, "byteOffset": {}, "byteLength": {}}}],
        "buffers": [{{"byteLength": {}}}]}}"#,
        3 * m,
        12 * n,
        12 * n,
        8 * n,
        20 * n,
        6 * m,
        buffer.len()
    );
    glb(&json, &buffer)
}

/// Any mesh as ASCII STL.
pub fn stl_ascii(mesh: &Mesh) -> Vec<u8> {
    let mut text = "solid thing\n".to_owned();
    for t in &mesh.triangles {
        text += "  facet normal 0 0 0\n    outer loop\n";
        for [x, y, z] in t.map(|i| mesh.vertices[i as usize]) {
            text += &format!("      vertex {x} {y} {z}\n");
        }
        text += "    endloop\n  endfacet\n";
    }
    (text + "endsolid thing\n").into_bytes()
}

/// Any mesh as binary STL, after a comment of 80 bytes.
pub fn stl_binary(mesh: &Mesh, comment: &[u8]) -> Vec<u8> {
    let mut bytes = comment.to_vec();
    bytes.resize(80, b' ');
    bytes.extend((mesh.triangles.len() as u32).to_le_bytes());
    for t in &mesh.triangles {
        bytes.extend([0; 12]);
        bytes.extend(t.iter().flat_map(|i| mesh.vertices[*i as usize]).flat_map(|x| (x as f32).to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

/// A GLB of JSON text and buffer.
pub fn glb(json: &str, buffer: &[u8]) -> Vec<u8> {
    let chunk = |name: &[u8], data: &[u8], fill: u8| {
        let mut data = data.to_vec();
        data.resize(data.len().next_multiple_of(4), fill);
        [&(data.len() as u32).to_le_bytes(), name, &data].concat()
    };
    let chunks = [chunk(b"JSON", json.as_bytes(), b' '), chunk(b"BIN\0", buffer, 0)].concat();
    [&b"glTF"[..], &2_u32.to_le_bytes(), &(12 + chunks.len() as u32).to_le_bytes(), &chunks].concat()
}

/// The tetrahedron: positions at byte 0, indices (u16) at byte 48.
pub fn glb_buffer() -> Vec<u8> {
    let mesh = tetrahedron();
    let positions = mesh.vertices.iter().flatten().flat_map(|x| (*x as f32).to_le_bytes());
    positions.chain(mesh.triangles.iter().flatten().flat_map(|i| (*i as u16).to_le_bytes())).collect()
}

/// JSON of the tetrahedron, shown by these nodes; `scene` lists the top ones.
pub fn glb_json(nodes: &str, scene: &str) -> String {
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [{scene}]}}], "nodes": [{nodes}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 1}}]}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}},
                      {{"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 48}}, {{"buffer": 0, "byteOffset": 48, "byteLength": 24}}],
        "buffers": [{{"byteLength": 72}}]}}"#
    )
}

/// Bytes of the arm: a prism of three rings along z, carried by two bones, and three clips. All numbers are floats but indices and joints.
pub fn arm_buffer() -> Vec<u8> {
    let mut bytes = Vec::new();
    let floats = |bytes: &mut Vec<u8>, all: &[f32]| all.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
    // 0: nine positions.
    for z in [0.0, 1.0, 2.0] {
        floats(&mut bytes, &[0.2, 0.0, z, -0.1, 0.2, z, -0.1, -0.2, z]);
    }
    // 108: triangles of two sides of three quadrilaterals, and two ends, as u16; 108 bytes.
    let mut triangles = vec![[0_u16, 2, 1], [6, 7, 8]];
    for ring in [0, 3] {
        for k in 0..3 {
            let (a, b) = (ring + k, ring + (k + 1) % 3);
            triangles.extend([[a, b, b + 3], [a, b + 3, a + 3]]);
        }
    }
    bytes.extend(triangles.as_flattened().iter().flat_map(|i| i.to_le_bytes()));
    bytes.resize(192, 0);
    // 192: joints as u8, 216 + 12: weights.
    for ring in 0..3 {
        for _ in 0..3 {
            bytes.extend(if ring == 1 { [0_u8, 1, 0, 0] } else { [ring / 2, 0, 0, 0] });
        }
    }
    for ring in 0..3 {
        for _ in 0..3 {
            floats(&mut bytes, if ring == 1 { &[0.5, 0.5, 0.0, 0.0] } else { &[1.0, 0.0, 0.0, 0.0] });
        }
    }
    // 372: inverse bind matrices, by columns: the elbow is 1 up.
    for z in [0.0, -1.0] {
        floats(&mut bytes, &[1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, z, 1.0]);
    }
    // 500: times 0 and 2; 508: two turns, 0 and 90 degrees about x; 540: two movements.
    let half = std::f32::consts::FRAC_1_SQRT_2;
    floats(&mut bytes, &[0.0, 2.0]);
    floats(&mut bytes, &[0.0, 0.0, 0.0, 1.0, half, 0.0, 0.0, half]);
    floats(&mut bytes, &[0.0, 0.0, 0.0, 1.0, 2.0, 3.0]);
    // 564: the same movements with rates of 1 along x before and after.
    floats(&mut bytes, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0]);
    bytes
}

/// JSON of the arm; `buffer` is what the buffer says of itself beside its length.
pub fn arm_json(buffer: &str) -> String {
    let length = arm_buffer().len();
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [3]}}],
        "nodes": [{{"name": "upper", "children": [1]}}, {{"name": "lower", "translation": [0, 0, 1]}},
                  {{"mesh": 0, "skin": 0, "translation": [9, 9, 9]}}, {{"name": "figure", "children": [2, 0]}}],
        "skins": [{{"joints": [0, 1], "inverseBindMatrices": 4}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "JOINTS_0": 2, "WEIGHTS_0": 3}}, "indices": 1}}]}}],
        "animations": [
          {{"name": "bend", "samplers": [{{"input": 5, "output": 6}}], "channels": [{{"sampler": 0, "target": {{"node": 1, "path": "rotation"}}}}]}},
          {{"name": "jump", "samplers": [{{"input": 5, "output": 7, "interpolation": "STEP"}}],
            "channels": [{{"sampler": 0, "target": {{"node": 3, "path": "translation"}}}}]}},
          {{"samplers": [{{"input": 5, "output": 8, "interpolation": "CUBICSPLINE"}}],
            "channels": [{{"sampler": 0, "target": {{"node": 3, "path": "translation"}}}}]}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 9, "type": "VEC3"}},
                      {{"bufferView": 1, "componentType": 5123, "count": 42, "type": "SCALAR"}},
                      {{"bufferView": 2, "componentType": 5121, "count": 9, "type": "VEC4"}},
                      {{"bufferView": 3, "componentType": 5126, "count": 9, "type": "VEC4"}},
                      {{"bufferView": 4, "componentType": 5126, "count": 2, "type": "MAT4"}},
                      {{"bufferView": 5, "componentType": 5126, "count": 2, "type": "SCALAR"}},
                      {{"bufferView": 6, "componentType": 5126, "count": 2, "type": "VEC4"}},
                      {{"bufferView": 7, "componentType": 5126, "count": 2, "type": "VEC3"}},
                      {{"bufferView": 8, "componentType": 5126, "count": 6, "type": "VEC3"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 108}}, {{"buffer": 0, "byteOffset": 108, "byteLength": 84}},
                        {{"buffer": 0, "byteOffset": 192, "byteLength": 36}}, {{"buffer": 0, "byteOffset": 228, "byteLength": 144}},
                        {{"buffer": 0, "byteOffset": 372, "byteLength": 128}}, {{"buffer": 0, "byteOffset": 500, "byteLength": 8}},
                        {{"buffer": 0, "byteOffset": 508, "byteLength": 32}}, {{"buffer": 0, "byteOffset": 540, "byteLength": 24}},
                        {{"buffer": 0, "byteOffset": 564, "byteLength": 72}}],
        "buffers": [{{{buffer} "byteLength": {length}}}]}}"#
    )
}

/// A skinned and animated arm as GLB.
pub fn arm() -> Vec<u8> {
    glb(&arm_json(""), &arm_buffer())
}

/// Bytes as base64.
pub fn base64(bytes: &[u8]) -> String {
    const SIGNS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for three in bytes.chunks(3) {
        let word = three.iter().fold(0_u32, |w, b| w << 8 | u32::from(*b)) << (8 * (3 - three.len()));
        let signs = (0..4).map(|k| if k <= three.len() { SIGNS[(word >> (18 - 6 * k)) as usize & 63] as char } else { '=' });
        text.extend(signs);
    }
    text
}

pub fn glb_tetrahedron(nodes: &str, scene: &str) -> Vec<u8> {
    glb(&glb_json(nodes, scene), &glb_buffer())
}
