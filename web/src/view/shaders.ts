/** Shaders of what three does not draw: round lines, balls, what lies on grids. Colours are linear light; three turns them into sRGB. */

/** Straight pieces as wide as a tube, at least some pixels, round at their ends. */
export const PIECES = {
  vertex: /* glsl */ `
    attribute vec3 start;
    attribute vec3 end;
    attribute vec4 tint;
    uniform float radius;
    uniform float thinnest;
    uniform float lit;
    uniform vec2 size;
    varying vec4 shade;
    varying vec2 at;
    varying float halfLength;
    varying float width;
    void main() {
      vec4 a = projectionMatrix * modelViewMatrix * vec4(start, 1.0);
      vec4 b = projectionMatrix * modelViewMatrix * vec4(end, 1.0);
      shade = tint;
      if (a.w <= 0.0 || b.w <= 0.0) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); return; }
      vec2 p = a.xy / a.w * 0.5 * size, q = b.xy / b.w * 0.5 * size;
      vec4 mid = position.x < 0.0 ? a : b;
      float scale = projectionMatrix[1][1] * 0.5 * size.y / mid.w;
      width = max(radius * scale, thinnest);
      vec2 along = q - p;
      halfLength = 0.5 * length(along);
      along = halfLength > 1e-4 ? along / (2.0 * halfLength) : vec2(1.0, 0.0);
      vec2 across = vec2(-along.y, along.x);
      // Those that one sees through end flat: round ends would lie over each other.
      float cap = width * lit;
      vec2 here = (position.x < 0.0 ? p - along * cap : q + along * cap) + across * position.y * width;
      at = vec2(position.x * (halfLength + cap), position.y * width);
      gl_Position = vec4(here / (0.5 * size) * mid.w, mid.zw);
    }`,
  fragment: /* glsl */ `
    uniform float lit;
    uniform float fade;
    varying vec4 shade;
    varying vec2 at;
    varying float halfLength;
    varying float width;
    void main() {
      float beyond = max(abs(at.x) - halfLength, 0.0);
      float d = length(vec2(beyond, at.y)) / width;
      if (d > 1.0) discard;
      // Soft along the sides alone, so that pieces that meet leave no notch.
      float edge = 1.0 - smoothstep(1.0 - 1.2 / max(width, 1.2), 1.0, abs(at.y) / width);
      float alpha = shade.a * edge * fade;
      if (alpha < 0.02) discard;
      float up = sqrt(max(1.0 - d * d, 0.0));
      float light = mix(1.0, 0.55 + 0.5 * up, lit);
      gl_FragColor = vec4(shade.rgb * light, alpha);
      #include <colorspace_fragment>
    }`,
};

/** Balls, drawn as points: lit from above, or glowing in the dark. */
export const BALLS = {
  vertex: /* glsl */ `
    attribute vec3 tint;
    attribute float radius;
    uniform float thinnest;
    uniform vec2 size;
    varying vec3 shade;
    varying float depth;
    varying float ball;
    varying float small;
    void main() {
      shade = tint;
      vec4 eye = modelViewMatrix * vec4(position, 1.0);
      gl_Position = projectionMatrix * eye;
      float scale = projectionMatrix[1][1] * 0.5 * size.y / gl_Position.w;
      float pixels = max(radius * scale, thinnest);
      small = clamp(radius * scale / thinnest, 0.25, 1.0);
      gl_PointSize = 2.0 * pixels;
      ball = pixels / scale;
      depth = eye.z;
    }`,
  fragment: /* glsl */ `
    uniform mat4 projectionMatrix;
    uniform bool glow;
    uniform bool ghost;
    varying vec3 shade;
    varying float depth;
    varying float ball;
    varying float small;
    void main() {
      vec2 p = vec2(gl_PointCoord.x * 2.0 - 1.0, 1.0 - gl_PointCoord.y * 2.0);
      float d = dot(p, p);
      if (d > 1.0) discard;
      if (ghost) {
        // Rings, a pixel and a half wide and at least a seventh of the ball.
        float width = max(3.0 * fwidth(gl_PointCoord.x), 0.14);
        if (sqrt(d) < 1.0 - width) discard;
        gl_FragColor = vec4(shade, 0.25 + 0.35 * small);
        gl_FragDepth = gl_FragCoord.z;
      } else if (glow) {
        float core = exp(-6.0 * d) * small;
        gl_FragColor = vec4(shade * 1.6 + 0.25 * core, core);
      } else {
        float up = sqrt(1.0 - d);
        vec3 n = vec3(p, up);
        float key = max(dot(n, normalize(vec3(-0.5, 0.75, 0.6))), 0.0);
        gl_FragColor = vec4(shade * (0.45 + 0.75 * key) + 0.10 * pow(key, 24.0), 1.0);
        vec4 clip = projectionMatrix * vec4(0.0, 0.0, depth + ball * up, 1.0);
        gl_FragDepth = 0.5 * clip.z / clip.w + 0.5;
      }
      #include <colorspace_fragment>
    }`,
};

const LOOK_UP = /* glsl */ `
    uniform sampler2D map;
    uniform vec2 range;
    uniform bool dye;
    uniform vec3 ink;
    vec4 paint(float value) {
      float share = (value - range.x) / (range.y - range.x);
      if (dye) {
        float cover = 1.0 - exp(-3.0 * max(share, 0.0));
        return vec4(ink, cover);
      }
      return vec4(texture2D(map, vec2(clamp(share, 0.0, 1.0) * 255.0 / 256.0 + 0.5 / 256.0, 0.5)).rgb, 1.0);
    }`;

/** Lines between cells: a pixel wide, or a quarter of a cell where those are small; none where a cell is hardly a pixel. `p` counts cells. */
const LINES = /* glsl */ `
  vec3 ruled(vec3 color, vec3 p) {
    vec3 px = fwidth(p);
    // Along an axis that does not change there are none.
    vec3 near = mix(abs(fract(p - 0.5) - 0.5) / max(px, vec3(1e-6)), vec3(1e3), vec3(lessThan(px, vec3(1e-6))));
    float most = max(px.x, max(px.y, px.z));
    float thick = min(0.5, 0.125 / most);
    float line = clamp(thick + 0.5 - min(near.x, min(near.y, near.z)), 0.0, 1.0) * smoothstep(0.8, 0.55, most);
    return mix(color, vec3(0.5), 0.45 * line);
  }`;

/** A field in a plane: cells as they are, or smooth between their middles; lines between cells where they are wide enough. */
export const PLANE = {
  vertex: /* glsl */ `
    varying vec2 place;
    void main() {
      place = uv;
      gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
    }`,
  fragment: /* glsl */ `
    precision highp float;
    precision highp sampler2D;
    uniform sampler2D values;
    uniform vec2 cells;
    uniform bool smoothly;
    uniform bool lines;
    varying vec2 place;
    ${LOOK_UP}
    ${LINES}
    float cell(ivec2 k) { return texelFetch(values, clamp(k, ivec2(0), ivec2(cells) - 1), 0).r; }
    void main() {
      vec2 p = place * cells;
      float value;
      if (smoothly) {
        vec2 q = p - 0.5;
        ivec2 k = ivec2(floor(q));
        vec2 t = q - floor(q);
        value = mix(mix(cell(k), cell(k + ivec2(1, 0)), t.x), mix(cell(k + ivec2(0, 1)), cell(k + ivec2(1, 1)), t.x), t.y);
        // Beside a hole the cell itself.
        if (isnan(value)) value = cell(ivec2(floor(p)));
      } else value = cell(ivec2(floor(p)));
      if (isnan(value)) discard;
      gl_FragColor = paint(value);
      if (lines) gl_FragColor.rgb = ruled(gl_FragColor.rgb, vec3(p, 0.0));
      #include <colorspace_fragment>
    }`,
};

/** A field in space: smoke through which one looks, in steps from front to back, or a slice. */
export const SPACE = {
  vertex: /* glsl */ `
    uniform vec3 low;
    uniform vec3 extent;
    varying vec3 inside;
    varying vec3 seen;
    void main() {
      vec4 world = modelMatrix * vec4(position, 1.0);
      inside = (world.xyz - low) / extent;
      seen = (viewMatrix * world).xyz;
      gl_Position = projectionMatrix * viewMatrix * world;
    }`,
  smoke: /* glsl */ `
    precision highp float;
    precision highp sampler3D;
    uniform sampler3D values;
    uniform vec3 low;
    uniform vec3 extent;
    uniform vec3 viewer;
    uniform vec3 parallel;
    uniform float thick;
    uniform bool fire;
    uniform sampler3D heat;
    uniform vec3 ink;
    uniform sampler2D depths;
    uniform bool solid;
    uniform vec2 size;
    uniform mat4 unproject;
    varying vec3 inside;
    varying vec3 seen;
    vec3 black(float share) {
      float t = clamp(share, 0.0, 1.2);
      return 3.0 * pow(t, 4.0) * vec3(1.0, 0.42 * t, 0.16 * t * t);
    }
    void main() {
      // Lengths along the way, from the far side on: the viewer and all that is seen lie at negative ones.
      bool straight = dot(parallel, parallel) > 0.0;
      vec3 eye = (viewer - low) / extent;
      vec3 way = straight ? parallel / extent : inside - eye;
      way /= length(way * extent);
      vec3 a = (vec3(0.0) - inside) / way, b = (vec3(1.0) - inside) / way;
      vec3 near = min(a, b);
      float first = max(max(near.x, near.y), near.z);
      if (!straight) first = max(first, -length(seen));
      float last = 0.0;
      if (solid) {
        vec2 place = gl_FragCoord.xy / size;
        vec4 behind = unproject * vec4(vec3(place, texture2D(depths, place).r) * 2.0 - 1.0, 1.0);
        behind.xyz /= behind.w;
        last = min(last, straight ? seen.z - behind.z : length(behind.xyz) - length(seen));
      }
      if (last <= first) discard;
      const int STEPS = 72;
      float stride = (last - first) / float(STEPS);
      float t = first + fract(sin(dot(gl_FragCoord.xy, vec2(12.9898, 78.233))) * 43758.5453) * stride;
      float through = 1.0;
      vec3 light = vec3(0.0);
      for (int i = 0; i < STEPS; i++) {
        vec3 p = inside + way * t;
        float s = texture(values, p).r;
        float take = 1.0 - exp(-s * thick * stride);
        if (take > 0.001) {
          float above = texture(values, p + vec3(-0.03, -0.02, 0.05)).r;
          vec3 own = ink * (0.35 + 0.85 * exp(-2.2 * above));
          if (fire) own = own * 0.15 + black(texture(heat, p).r);
          light += through * take * own;
          through *= 1.0 - take;
          if (through < 0.01) break;
        }
        t += stride;
      }
      gl_FragColor = vec4(light, 1.0 - through);
      gl_FragColor.rgb /= max(gl_FragColor.a, 1e-4);
      #include <colorspace_fragment>
    }`,
  slice: /* glsl */ `
    precision highp float;
    precision highp sampler3D;
    uniform sampler3D values;
    uniform vec2 stored;
    uniform vec3 cells;
    uniform bool lines;
    varying vec3 inside;
    ${LOOK_UP}
    ${LINES}
    void main() {
      vec3 p = inside * cells;
      vec3 at = lines ? (min(floor(p), cells - 1.0) + 0.5) / cells : inside;
      gl_FragColor = paint(mix(stored.x, stored.y, texture(values, at).r));
      if (lines) gl_FragColor.rgb = ruled(gl_FragColor.rgb, p);
      #include <colorspace_fragment>
    }`,
};
