// Lines of constant width in pixels, lying in the scene.

import { BufferAttribute, BufferGeometry, Color, Mesh, ShaderMaterial, Vector2 } from "three";

export const RESOLUTION = { value: new Vector2(1, 1) };

const VERTEX = /* glsl */ `
  attribute vec3 along;
  attribute vec2 where; // side, length so far
  uniform vec2 resolution;
  uniform float width;
  varying float run;
  varying float side;
  varying float far;
  void main() {
    vec4 p = modelViewMatrix * vec4(position, 1.0);
    vec3 d = mat3(modelViewMatrix) * along;
    vec2 s = (d.xy * -p.z + p.xy * d.z) * vec2(projectionMatrix[0][0], projectionMatrix[1][1]) * resolution;
    vec2 n = length(s) > 1e-9 ? normalize(vec2(-s.y, s.x)) : vec2(0.0);
    gl_Position = projectionMatrix * p;
    gl_Position.xy += n * where.x * (width + 1.0) / resolution * gl_Position.w;
    run = where.y;
    side = where.x;
    far = length(p.xyz);
  }`;

const FRAGMENT = /* glsl */ `
  uniform vec3 colour;
  uniform float alpha, dash, width, fade;
  varying float run;
  varying float side;
  varying float far;
  void main() {
    if (dash > 0.0 && fract(run / dash) > 0.58) discard;
    float edge = clamp((1.0 - abs(side)) * (width + 1.0) * 0.5, 0.0, 1.0);
    gl_FragColor = vec4(colour, alpha * edge * exp(-far * fade));
  }`;

export class Line extends Mesh {
  /** `dash` in metres, 0 for solid; `through`: seen through things. */
  constructor(colour, width = 2, { alpha = 1, dash = 0, through = false, order = 10, fade = 1 / 9000 } = {}) {
    const uniforms = {
      resolution: RESOLUTION, width: { value: width }, alpha: { value: alpha }, dash: { value: dash }, fade: { value: fade },
      colour: { value: new Color().setStyle(colour.slice(0, 7), "") },
    };
    super(new BufferGeometry(), new ShaderMaterial({
      vertexShader: VERTEX, fragmentShader: FRAGMENT, uniforms, transparent: true, depthWrite: false, depthTest: !through, side: 2,
    }));
    this.frustumCulled = false;
    this.renderOrder = order;
    this.capacity = 0;
  }

  /** Points [x, y, z]; a loop closes on itself. */
  set(points, loop = false) {
    const list = loop ? [...points, points[0]] : points, n = list.length;
    this.geometry.setDrawRange(0, Math.max(0, 6 * (n - 1)));
    if (n < 2) return this;
    if (n > this.capacity) this.grow(Math.max(n, Math.min(2 * this.capacity, 4096)));
    const { position, along, where } = this.geometry.attributes;
    let run = 0;
    for (let i = 0; i < n; i++) {
      const p = list[i];
      const a = list[i > 0 ? i - 1 : loop ? n - 2 : 0], b = list[i < n - 1 ? i + 1 : loop ? 1 : i];
      if (i) run += Math.hypot(p[0] - list[i - 1][0], p[1] - list[i - 1][1], p[2] - list[i - 1][2]);
      for (let s = 0; s < 2; s++) {
        position.setXYZ(2 * i + s, p[0], p[1], p[2]);
        along.setXYZ(2 * i + s, b[0] - a[0], b[1] - a[1], b[2] - a[2]);
        where.setXY(2 * i + s, s ? 1 : -1, run);
      }
    }
    position.needsUpdate = along.needsUpdate = where.needsUpdate = true;
    return this;
  }

  /** Show only the first n points. */
  cut(n) {
    this.geometry.setDrawRange(0, Math.max(0, 6 * (n - 1)));
  }

  grow(n) {
    const g = new BufferGeometry(), index = [];
    for (const [name, size] of [["position", 3], ["along", 3], ["where", 2]]) {
      g.setAttribute(name, new BufferAttribute(new Float32Array(2 * n * size), size));
    }
    for (let i = 0; i + 1 < n; i++) index.push(2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 1, 2 * i + 3, 2 * i + 2);
    g.setIndex(index);
    g.setDrawRange(0, this.geometry.drawRange.count);
    this.geometry.dispose();
    this.geometry = g;
    this.capacity = n;
  }
}
