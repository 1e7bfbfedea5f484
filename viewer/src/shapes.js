// Solids with a colour per face: hulls by class, ice, land, marks.  Metres; bow along -z, starboard +x, up +y, water at y = 0.

import { BufferAttribute, BufferGeometry, Color } from "three";

class Solid {
  constructor() {
    this.xyz = [];
    this.rgb = [];
  }

  face(colour, ...points) {
    const c = new Color(colour);
    for (let i = 1; i + 1 < points.length; i++) {
      for (const p of [points[0], points[i], points[i + 1]]) {
        this.xyz.push(...p);
        this.rgb.push(c.r, c.g, c.b);
      }
    }
    return this;
  }

  /** Prism between two outlines [x, z] at heights y0 and y1, with a lid. */
  prism(colour, bottom, y0, top, y1, lid = colour) {
    bottom.forEach((p, i) => {
      const j = (i + 1) % bottom.length;
      this.face(colour, [p[0], y0, p[1]], [bottom[j][0], y0, bottom[j][1]], [top[j][0], y1, top[j][1]], [top[i][0], y1, top[i][1]]);
    });
    return this.face(lid, ...top.map((p) => [p[0], y1, p[1]]));
  }

  /** Box from z0 (forward) to z1 (aft), half width w, heights y0 to y1; `lean` pulls the top in at the front. */
  box(colour, z0, z1, w, y0, y1, lean = 0, x = 0, lid = colour) {
    const foot = [[x - w, z0], [x + w, z0], [x + w, z1], [x - w, z1]];
    const head = [[x - w, z0 + lean], [x + w, z0 + lean], [x + w, z1], [x - w, z1]];
    return this.prism(colour, foot, y0, head, y1, lid);
  }

  /** Upright cylinder or cone frustum. */
  tube(colour, x, z, r0, y0, r1, y1, n = 10, lid = colour) {
    const ring = (r) => Array.from({ length: n }, (_, k) => [x + r * Math.cos((2 * Math.PI * k) / n), z + r * Math.sin((2 * Math.PI * k) / n)]);
    return this.prism(colour, ring(r0), y0, ring(r1), y1, lid);
  }

  geometry() {
    const g = new BufferGeometry();
    g.setAttribute("position", new BufferAttribute(new Float32Array(this.xyz), 3));
    g.setAttribute("color", new BufferAttribute(new Float32Array(this.rgb), 3));
    g.computeVertexNormals();
    return g;
  }
}

/** Hull lofted through stations [x / L from the stern, half width at the water / (B / 2), at deck, deck height]. */
function hull(solid, L, B, stations, { side, boot, deck, rail = 0 }) {
  const point = ([x, , , h], w, y) => [(w * B) / 2, y * h, L / 2 - x * L];
  const band = 0.22;
  for (let k = 0; k + 1 < stations.length; k++) {
    const a = stations[k], b = stations[k + 1];
    for (const s of [-1, 1]) {
      const at = (q, y) => point(q, s * (q[1] + (q[2] - q[1]) * y), y);
      solid.face(boot, at(a, 0), at(b, 0), at(b, band), at(a, band));
      solid.face(side, at(a, band), at(b, band), at(b, 1 + rail), at(a, 1 + rail));
    }
    const d = (q, s) => point(q, s * q[2], 1);
    solid.face(deck, d(a, -1), d(b, -1), d(b, 1), d(a, 1));
  }
  const stern = stations[0], stem = stations.at(-1);
  solid.face(side, ...[[-1, band], [1, band], [1, 1 + rail], [-1, 1 + rail]].map(([s, y]) => point(stem, s * (stem[1] + (stem[2] - stem[1]) * y), y)));
  solid.face(boot, ...[[-1, 0], [1, 0], [1, band], [-1, band]].map(([s, y]) => point(stern, s * (stern[1] + (stern[2] - stern[1]) * y), y)));
  solid.face(side, ...[[-1, band], [1, band], [1, 1 + rail], [-1, 1 + rail]].map(([s, y]) => point(stern, s * (stern[1] + (stern[2] - stern[1]) * y), y)));
}

const WHITE = "#f4f6f6", GLASS = "#22323c", STEEL = "#9aa7ae", DARK = "#39444b";

function ship(L, B, colour) {
  const o = new Solid(), h = 0.065 * L, w = B / 2;
  hull(o, L, B, [
    [0, 0.72, 0.9, h], [0.1, 0.94, 1, h], [0.62, 1, 1, h], [0.78, 0.86, 1, h * 1.06], [0.9, 0.46, 0.78, h * 1.22], [0.97, 0.14, 0.4, h * 1.36], [1, 0, 0.06, h * 1.42],
  ], { side: colour, boot: "#8e3b34", deck: "#7d8a86", rail: 0.1 });
  const Z = (x) => L / 2 - x * L;
  let y = h;
  for (const [front, wide, tall] of [[0.31, 0.84, 0.032], [0.3, 0.8, 0.028], [0.29, 0.76, 0.028], [0.285, 0.72, 0.03]]) {
    o.box(WHITE, Z(front), Z(0.1), w * wide, y, y + tall * L);
    o.box(GLASS, Z(front) - 0.002 * L, Z(0.12), w * wide + 0.001 * L, y + 0.45 * tall * L, y + 0.7 * tall * L);
    y += tall * L;
  }
  o.box(WHITE, Z(0.275), Z(0.235), w * 1.02, y, y + 0.012 * L); // bridge wings
  o.box(GLASS, Z(0.275), Z(0.18), w * 0.66, y + 0.006 * L, y + 0.026 * L, 0.003 * L);
  o.box(WHITE, Z(0.278), Z(0.175), w * 0.7, y + 0.026 * L, y + 0.032 * L);
  o.box(colour, Z(0.15), Z(0.105), w * 0.3, y, y + 0.055 * L, 0.008 * L, 0, DARK); // funnel
  o.box(WHITE, Z(0.147), Z(0.104), w * 0.305, y + 0.025 * L, y + 0.036 * L, 0.004 * L);
  o.tube(WHITE, 0, Z(0.215), 0.005 * L, y, 0.003 * L, y + 0.095 * L, 6);
  o.box(STEEL, Z(0.218), Z(0.212), w * 0.3, y + 0.075 * L, y + 0.08 * L);
  for (const x of [0.37, 0.515, 0.66]) o.box("#b9a98a", Z(x + 0.115), Z(x), w * 0.68, h, h * 1.28, 0, 0, "#cfc3a6");
  for (const x of [0.5, 0.645]) {
    o.tube("#e9e4d6", 0, Z(x), 0.011 * L, h, 0.007 * L, h + 0.095 * L, 8);
    o.box("#e9e4d6", Z(x + 0.1), Z(x), 0.004 * L, h + 0.08 * L, h + 0.09 * L);
  }
  o.tube(WHITE, 0, Z(0.92), 0.004 * L, h * 1.2, 0.002 * L, h + 0.1 * L, 6);
  return o.geometry();
}

function vessel(L, B, colour) {
  const o = new Solid(), h = 0.075 * L, w = B / 2, Z = (x) => L / 2 - x * L;
  hull(o, L, B, [
    [0, 0.8, 0.96, h * 0.8], [0.45, 1, 1, h * 0.82], [0.56, 0.98, 1, h * 1.25], [0.75, 0.82, 1, h * 1.45], [0.9, 0.38, 0.72, h * 1.8], [1, 0, 0.08, h * 2.15],
  ], { side: colour, boot: "#b5443a", deck: "#8c9a8f", rail: 0.16 });
  o.box(WHITE, Z(0.8), Z(0.5), w * 0.86, h * 1.2, h * 2.4);
  o.box(GLASS, Z(0.802), Z(0.52), w * 0.87, h * 1.8, h * 2.1);
  o.box(WHITE, Z(0.77), Z(0.55), w * 0.72, h * 2.4, h * 3.5, 0.012 * L);
  o.box(GLASS, Z(0.773), Z(0.555), w * 0.74, h * 2.85, h * 3.3, 0.012 * L);
  o.box("#e2762d", Z(0.775), Z(0.54), w * 0.78, h * 3.5, h * 3.68);
  for (const x of [-0.55, 0.55]) o.box(colour, Z(0.5), Z(0.46), w * 0.14, h * 0.8, h * 3.1, 0, x * w, DARK);
  o.tube(WHITE, 0, Z(0.62), 0.009 * L, h * 3.6, 0.005 * L, h * 6, 6);
  o.box(STEEL, Z(0.625), Z(0.612), w * 0.42, h * 5, h * 5.2);
  for (const x of [-0.8, 0.8]) o.box("#e2762d", Z(0.05), Z(0.02), w * 0.07, h * 0.8, h * 2.8, 0, x * w); // A-frame
  o.box("#e2762d", Z(0.05), Z(0.02), w * 0.87, h * 2.7, h * 2.95);
  o.box("#c9b27a", Z(0.38), Z(0.26), w * 0.34, h * 0.8, h * 1.5, 0, -0.35 * w);
  o.tube("#5d6a71", 0.4 * w, Z(0.24), 0.03 * L, h * 0.8, 0.03 * L, h * 1.3, 10);
  return o.geometry();
}

function boat(L, B, colour) {
  const o = new Solid(), h = 0.09 * L, w = B / 2, Z = (x) => L / 2 - x * L;
  hull(o, L, B, [
    [0, 0.82, 0.95, h], [0.5, 0.95, 1, h], [0.75, 0.74, 0.94, h * 1.15], [0.92, 0.26, 0.5, h * 1.35], [1, 0, 0.06, h * 1.45],
  ], { side: WHITE, boot: colour, deck: "#d9cdb2", rail: 0.12 });
  o.box(WHITE, Z(0.8), Z(0.34), w * 0.66, h, h * 1.75, 0.08 * L);
  o.box(GLASS, Z(0.66), Z(0.36), w * 0.62, h * 1.7, h * 2.5, 0.06 * L);
  o.box(colour, Z(0.6), Z(0.32), w * 0.66, h * 2.5, h * 2.7);
  o.tube(STEEL, 0, Z(0.4), 0.008 * L, h * 2.6, 0.005 * L, h * 4.2, 6);
  o.box(DARK, Z(0.02), Z(-0.03), w * 0.16, h * 0.4, h * 1.5);
  return o.geometry();
}

function usv(L, B, colour) {
  const o = new Solid(), h = 0.085 * L, w = B / 2, Z = (x) => L / 2 - x * L;
  hull(o, L, B, [
    [0, 0.86, 1, h], [0.5, 0.96, 1, h], [0.72, 0.8, 0.97, h * 1.1], [0.88, 0.4, 0.68, h * 1.28], [0.96, 0.14, 0.32, h * 1.4], [1, 0, 0.05, h * 1.46],
  ], { side: colour, boot: DARK, deck: "#56626a", rail: 0.1 });
  o.box("#cfd6d9", Z(0.68), Z(0.26), w * 0.58, h, h * 2.1, 0.13 * L, 0, "#e9edef");
  o.box(GLASS, Z(0.612), Z(0.3), w * 0.59, h * 1.5, h * 1.85, 0.05 * L);
  o.box("#2b3439", Z(0.2), Z(0.06), w * 0.66, h, h * 1.3); // engine hatch
  o.box("#6d7a82", Z(0.8), Z(0.73), w * 0.26, h * 1.05, h * 1.22);
  o.box("#2b3439", Z(0.9), Z(0.88), w * 0.1, h * 1.2, h * 1.5);
  for (const x of [-0.5, 0.5]) o.tube(DARK, x * w, Z(-0.005), 0.018 * L, h * 0.15, 0.018 * L, h * 0.6, 8);
  for (const x of [-0.46, 0.46]) o.tube(STEEL, x * w, Z(0.32), 0.007 * L, h * 2, 0.005 * L, h * 4, 6);
  o.box(STEEL, Z(0.33), Z(0.31), w * 0.5, h * 3.85, h * 4.05);
  o.box(WHITE, Z(0.335), Z(0.305), w * 0.34, h * 4.35, h * 4.65); // radar
  o.tube(STEEL, 0, Z(0.32), 0.012 * L, h * 4, 0.012 * L, h * 4.4, 8);
  o.tube("#20292e", 0, Z(0.45), 0.022 * L, h * 2.1, 0.02 * L, h * 2.75, 10); // LiDAR
  o.tube(DARK, -0.46 * w, Z(0.32), 0.003 * L, h * 4, 0.002 * L, h * 6.2, 5);
  o.tube(DARK, 0.46 * w, Z(0.32), 0.003 * L, h * 4, 0.002 * L, h * 5.4, 5);
  for (const s of [-1, 1]) o.box("#30393e", Z(0.85), Z(0.02), 0.02 * B, h * 0.62, h * 0.86, 0, s * w * 1.0); // fender
  return o.geometry();
}

/** Numbers in [0, 1) that are the same every time. */
function random(seed) {
  let a = seed * 2654435761 + 1013904223;
  return () => {
    a = (a + 0x6d2b79f5) | 0;
    let t = Math.imul(a ^ (a >>> 15), 1 | a);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

/** Irregular polyhedron on the disc of radius r: rings of shifted points under a few summits. */
function crag(o, r, seed, { height, colours, shelf }) {
  const rnd = random(seed + 1), n = 15, levels = 6, tall = 0.72 + 0.5 * rnd();
  const summits = Array.from({ length: 3 }, (_, k) => ({
    x: (k ? 1.15 : 0.3) * (rnd() - 0.5) * r, z: (k ? 1.15 : 0.3) * (rnd() - 0.5) * r, h: tall * height * r * (k ? 0.55 + 0.4 * rnd() : 1),
  }));
  const reach = Array.from({ length: n }, () => 0.8 + 0.2 * rnd());
  const top = (x, z) => {
    let y = 0;
    for (const s of summits) y = Math.max(y, s.h * (1 - Math.hypot(x - s.x, z - s.z) / (0.95 * r)));
    return y;
  };
  const rings = [];
  for (let k = 0; k <= levels; k++) {
    const f = 1 - k / levels;
    rings.push(Array.from({ length: n }, (_, i) => {
      const a = (2 * Math.PI * (i + (k % 2) / 2 + 0.3 * (rnd() - 0.5))) / n;
      const q = r * (reach[i] + 0.06 * (rnd() - 0.5)) * f ** 0.85;
      const x = q * Math.cos(a), z = q * Math.sin(a);
      const cliff = k === 0 ? 0 : shelf * r;
      return [x, k === 0 ? -0.05 : cliff + top(x, z) * (0.82 + 0.36 * rnd()), z];
    }));
  }
  const pick = (y, k) => colours[Math.min(colours.length - 1, k === 0 ? 0 : 1 + Math.floor((y / (height * r)) * (colours.length - 1.01)))];
  for (let k = 0; k < levels; k++) {
    for (let i = 0; i < n; i++) {
      const j = (i + 1) % n, a = rings[k], b = rings[k + 1];
      const t = k % 2 ? [[a[i], a[j], b[j]], [a[i], b[j], b[i]]] : [[a[i], a[j], b[i]], [a[j], b[j], b[i]]];
      for (const points of t) o.face(pick((points[0][1] + points[1][1] + points[2][1]) / 3, k), ...points);
    }
  }
  return o;
}

function obstacle(kind, r, seed) {
  const o = new Solid();
  if (kind === "iceberg") {
    return crag(o, r, seed, { height: 0.78, shelf: 0.1, colours: ["#a8d8e6", "#d5ebf3", "#e6f2f7", "#f4f9fb", "#ffffff"] }).geometry();
  }
  if (kind === "islet" || kind === "lighthouse") {
    crag(o, r, seed, { height: kind === "islet" ? 0.5 : 0.26, shelf: 0.03, colours: ["#8f8775", "#a49a80", "#8c9a5c", "#7c8f53", "#948d7a"] });
  }
  if (kind === "lighthouse") {
    const y = 0.2 * r, R = Math.max(0.13 * r, 1.2), H = Math.max(1.1 * r, 14);
    for (let k = 0; k < 4; k++) {
      const f = (q) => R * (1 - 0.35 * q / 4);
      o.tube(k % 2 ? "#c8382f" : WHITE, 0, 0, f(k), y + (H * k) / 4, f(k + 1), y + (H * (k + 1)) / 4, 14);
    }
    o.tube(DARK, 0, 0, R * 0.95, y + H, R * 0.95, y + H * 1.03, 14);
    o.tube("#ffe9a3", 0, 0, R * 0.5, y + H * 1.03, R * 0.5, y + H * 1.13, 10);
    o.tube("#c8382f", 0, 0, R * 0.65, y + H * 1.13, 0.05, y + H * 1.22, 10);
  } else if (kind === "buoy") {
    const R = Math.max(r, 0.6);
    o.tube("#f2c230", 0, 0, R * 0.85, -0.1, R * 0.95, R * 0.55, 14, "#d9a91d");
    for (const [x, z] of [[1, 1], [1, -1], [-1, 1], [-1, -1]]) o.tube("#2b3439", 0.35 * R * x, 0.35 * R * z, 0.07 * R, R * 0.5, 0.05 * R, R * 2.3, 5);
    o.tube("#f2c230", 0, 0, 0.5 * R, R * 1.2, 0.42 * R, R * 2.1, 12);
    o.tube("#12181c", 0, 0, 0.42 * R, R * 2.35, 0.02, R * 3, 10);
    o.tube("#12181c", 0, 0, 0.42 * R, R * 3.05, 0.02, R * 3.7, 10);
  } else if (kind === "platform") {
    const w = 0.62 * r, y = Math.max(0.55 * r, 8);
    for (const x of [-1, 1]) for (const z of [-1, 1]) o.tube("#d9b43a", x * w * 0.8, z * w * 0.8, 0.09 * r, -0.2, 0.09 * r, y, 10);
    o.box("#8b98a0", -w, w, w, y, y + 0.12 * r, 0, 0, "#a9b4ba");
    o.box(WHITE, -w * 0.9, -w * 0.15, w * 0.85, y + 0.12 * r, y + 0.5 * r, 0, 0, "#dfe5e8");
    o.box(GLASS, -w * 0.91, -w * 0.14, w * 0.86, y + 0.3 * r, y + 0.36 * r);
    o.box("#d9b43a", w * 0.2, w * 0.8, w * 0.3, y + 0.12 * r, y + 0.3 * r, 0, -w * 0.4);
    o.tube("#c8382f", w * 0.5, w * 0.45, 0.14 * r, y + 0.1 * r, 0.03 * r, y + 1.35 * r, 4);
    o.box("#3f7f5a", -w * 0.7, -w * 0.1, w * 0.3, y + 0.5 * r, y + 0.53 * r);
  }
  return o.geometry();
}

const HULLS = { 0: ship, 1: vessel, 2: boat, 3: usv };
export const HULL_NAMES = { 0: "ship", 1: "vessel", 2: "boat", 3: "usv" };
export const OBSTACLE_NAMES = { 10: "iceberg", 11: "buoy", 12: "islet", 13: "lighthouse", 14: "platform" };

export const hullOf = (kind, L, B, colour) => (HULLS[kind] ?? ship)(L, B, colour);
export const obstacleOf = (kind, r, seed) => obstacle(OBSTACLE_NAMES[kind] ?? "iceberg", r, seed);

/** How high a solid reaches, for labels. */
export const heightOf = (geometry) => {
  geometry.computeBoundingBox();
  return geometry.boundingBox.max.y;
};

/** Foam where a solid meets the water: a strip around its outline [x, z], fading outwards over `width`. */
export function foam(outline, width, colour, alpha) {
  const c = new Color(colour), xyz = [], rgba = [];
  const out = outline.map(([x, z]) => {
    const d = Math.hypot(x, z) || 1;
    return [x + (x / d) * width, z + (z / d) * width];
  });
  outline.forEach((p, i) => {
    const j = (i + 1) % outline.length;
    for (const [q, a] of [[p, alpha], [outline[j], alpha], [out[j], 0], [p, alpha], [out[j], 0], [out[i], 0]]) {
      xyz.push(q[0], 0, q[1]);
      rgba.push(c.r, c.g, c.b, a);
    }
  });
  const g = new BufferGeometry();
  g.setAttribute("position", new BufferAttribute(new Float32Array(xyz), 3));
  g.setAttribute("color", new BufferAttribute(new Float32Array(rgba), 4));
  return g;
}

export const circle = (r, n = 64) =>
  Array.from({ length: n }, (_, k) => [r * Math.sin((2 * Math.PI * k) / n), -r * Math.cos((2 * Math.PI * k) / n)]);

export const waterline = (L, B) =>
  [[0.5, 0], [0.42, 0.22], [0.25, 0.46], [-0.1, 0.5], [-0.5, 0.43]].map(([x, y]) => [y * B, -x * L])
    .concat([[-0.5, -0.43], [-0.1, -0.5], [0.25, -0.46], [0.42, -0.22]].map(([x, y]) => [y * B, -x * L]));
