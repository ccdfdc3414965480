/*
 * A sphere under one distant light, shaded in WebGL2 from a table of the BRDF over the half and difference angles
 * (Rusinkiewicz 1998). One context draws all spheres, which are then copied: browsers give a page few contexts.
 */

const VERTEX = `#version 300 es
in vec2 corner;
out vec2 place;
void main() { place = corner * 1.06; gl_Position = vec4(corner, 0.0, 1.0); }`;

// The table's texel is (phi_d + theta_d * n_phi_d, theta_h + phi_h * n_theta_h) and holds ln f.
const FRAGMENT = `#version 300 es
precision highp float;
in vec2 place;
out vec4 colour;
uniform sampler2D table;
uniform ivec4 nodes;          // phi_h, theta_h, theta_d, phi_d
uniform vec4 ends;            // the last of theta_d, phi_d, phi_h; pixel size
uniform float theta_h[96];
uniform vec3 light;
uniform float exposure;

vec3 at(int ph, int th, int td, int pd) {
  return texelFetch(table, ivec2(pd + td * nodes.w, th + ph * nodes.y), 0).rgb;
}
vec3 slab(int ph, int th, float td, float pd) {
  int a = min(int(td), nodes.z - 2), b = min(int(pd), nodes.w - 2);
  float u = clamp(td - float(a), 0.0, 1.0), v = clamp(pd - float(b), 0.0, 1.0);
  return mix(mix(at(ph, th, a, b), at(ph, th, a, b + 1), v), mix(at(ph, th, a + 1, b), at(ph, th, a + 1, b + 1), v), u);
}
vec3 turned(int ph, float angle, float td, float pd) {
  int low = 0, high = nodes.y - 1;
  while (high - low > 1) { int middle = (low + high) / 2; if (theta_h[middle] <= angle) low = middle; else high = middle; }
  float u = clamp((angle - theta_h[low]) / (theta_h[low + 1] - theta_h[low]), 0.0, 1.0);
  return mix(slab(ph, low, td, pd), slab(ph, low + 1, td, pd), u);
}
vec3 brdf(vec3 wi, vec3 wo) {
  const float degree = 57.29577951;
  vec3 wh = normalize(wi + wo);
  float phi = atan(wh.y, wh.x), angle = acos(clamp(wh.z, -1.0, 1.0));
  vec3 flat_ = vec3(cos(phi) * wi.x + sin(phi) * wi.y, cos(phi) * wi.y - sin(phi) * wi.x, wi.z);
  vec3 d = vec3(cos(angle) * flat_.x - sin(angle) * flat_.z, flat_.y, sin(angle) * flat_.x + cos(angle) * flat_.z);
  float phi_d = atan(d.y, d.x) * degree;
  if (ends.y < 200.0) phi_d = abs(phi_d); else if (phi_d < 0.0) phi_d += 360.0;
  float td = acos(clamp(d.z, -1.0, 1.0)) * degree / ends.x * float(nodes.z - 1);
  float pd = phi_d / ends.y * float(nodes.w - 1);
  if (nodes.x == 1) return exp(turned(0, angle * degree, td, pd));
  float ph = (phi < 0.0 ? phi * degree + 360.0 : phi * degree) / ends.z * float(nodes.x - 1);
  int k = min(int(ph), nodes.x - 2);
  return exp(mix(turned(k, angle * degree, td, pd), turned(k + 1, angle * degree, td, pd), ph - float(k)));
}
void main() {
  float r2 = dot(place, place);
  float edge = 1.0 - smoothstep(1.0 - 2.0 * ends.w, 1.0, sqrt(r2));
  if (edge <= 0.0) { colour = vec4(0.0); return; }
  vec3 n = vec3(place, sqrt(max(1.0 - r2, 1e-4)));
  n = normalize(n);
  vec3 t = normalize(cross(vec3(0.0, 1.0, 1e-3), n)), b = cross(n, t);
  vec3 view = vec3(0.0, 0.0, 1.0);
  vec3 wi = vec3(dot(light, t), dot(light, b), dot(light, n)), wo = vec3(dot(view, t), dot(view, b), dot(view, n));
  vec3 radiance = wi.z > 0.0 ? brdf(wi, wo) * wi.z * exposure : vec3(0.0);
  // Compressed by the brightest channel, so that hues stay.
  float most = max(max(radiance.r, radiance.g), max(radiance.b, 1e-6));
  vec3 shown = radiance * (1.0 - exp(-most)) / most;
  shown = mix(12.92 * shown, 1.055 * pow(shown, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, shown));
  colour = vec4(shown * edge, edge);
}`;

const FLOOR = 1e-7;

let shared;

/** The page's renderer, or null where WebGL2 is missing. */
export function renderer() {
  if (shared === undefined || shared?.gl.isContextLost()) {
    try {
      shared = new Renderer();
    } catch {
      shared = null;
    }
  }
  return shared;
}

class Renderer {
  constructor() {
    this.canvas = document.createElement("canvas");
    const gl = this.canvas.getContext("webgl2", {
      alpha: true,
      premultipliedAlpha: true,
      preserveDrawingBuffer: true,
    });
    if (!gl) throw new Error("no WebGL2");
    this.gl = gl;
    this.program = gl.createProgram();
    for (const [kind, source] of [
      [gl.VERTEX_SHADER, VERTEX],
      [gl.FRAGMENT_SHADER, FRAGMENT],
    ]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(this.program, shader);
    }
    gl.linkProgram(this.program);
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS))
      throw new Error(gl.getProgramInfoLog(this.program));
    gl.useProgram(this.program);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 3, -1, -1, 3]), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(gl.getAttribLocation(this.program, "corner"), 2, gl.FLOAT, false, 0, 0);
    this.at = (name) => gl.getUniformLocation(this.program, name);
  }

  /** Bring a table, as the service answers it, to the device. */
  upload(table) {
    const { gl } = this;
    const [ph, th, td, pd, channels] = table.shape;
    const values = floats(table.values);
    const texels = new Float32Array(ph * th * td * pd * 4);
    for (let k = 0; k < ph * th * td * pd; k += 1) {
      for (let c = 0; c < 3; c += 1)
        texels[4 * k + c] = Math.log(Math.max(values[k * channels + (channels === 3 ? c : 0)], FLOOR));
    }
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
      gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, pd * td, th * ph, 0, gl.RGBA, gl.FLOAT, texels);
    return {
      texture,
      nodes: [ph, th, td, pd],
      theta_h: table.theta_h_deg,
      ends: [table.theta_d_deg, table.phi_d_deg, table.phi_h_deg].map((a) => a.at(-1)),
    };
  }

  release(loaded) {
    this.gl.deleteTexture(loaded.texture);
  }

  /** Draw an uploaded table's sphere and copy it into a 2-D canvas; `light` is a unit vector, z to the viewer. */
  draw(loaded, target, light, exposure) {
    const { gl } = this;
    const size = target.width;
    if (this.canvas.width !== size) this.canvas.width = this.canvas.height = size;
    gl.viewport(0, 0, size, size);
    gl.bindTexture(gl.TEXTURE_2D, loaded.texture);
    gl.uniform4i(this.at("nodes"), ...loaded.nodes);
    gl.uniform4f(this.at("ends"), ...loaded.ends, 2.12 / size);
    gl.uniform1fv(this.at("theta_h"), new Float32Array(loaded.theta_h));
    gl.uniform3f(this.at("light"), ...light);
    gl.uniform1f(this.at("exposure"), exposure);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    const context = target.getContext("2d");
    context.clearRect(0, 0, size, size);
    context.drawImage(this.canvas, 0, 0);
  }
}

/** Base64 of little-endian 32-bit floats as numbers. */
function floats(text) {
  const raw = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const view = new DataView(raw.buffer);
  return Float32Array.from({ length: raw.length / 4 }, (_, k) => view.getFloat32(4 * k, true));
}
