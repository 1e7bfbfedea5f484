// Land: each polygon of the header rises from its shore line to a low plateau.

import { BufferAttribute, Color, ExtrudeGeometry, Mesh, Shape, Vector2 } from "three";

const HEIGHT = 7, SHORE = 4; // [m] of the plateau; how far in its edge stands from the shore line
const SAND = new Color("#d9c48d"), GRASS = new Color("#7d9a5c"), ROCK = new Color("#9a9180");

const corners = (ring) => Array.from({ length: ring.length / 2 }, (_, i) => new Vector2(ring[2 * i + 1], ring[2 * i])); // east, north

/** Mesh of one polygon: rings of north, east, north, .. [m], the shell first. */
export function landOf(rings, material) {
  const [shell, ...holes] = rings.map(corners);
  const shape = new Shape(shell);
  shape.holes = holes.map((hole) => new Shape(hole));
  const solid = new ExtrudeGeometry(shape, { depth: 0.01, bevelThickness: HEIGHT, bevelSize: SHORE, bevelOffset: -SHORE, bevelSegments: 3 });
  solid.rotateX(-Math.PI / 2); // east, north, up -> east, up, -north
  const { position, normal } = solid.attributes, colours = new Float32Array(3 * position.count);
  for (let i = 0; i < position.count; i++) {
    const y = position.getY(i);
    const colour = y < 0.25 * HEIGHT ? SAND : normal.getY(i) > 0.6 ? GRASS : ROCK;
    colour.toArray(colours, 3 * i);
  }
  solid.setAttribute("color", new BufferAttribute(colours, 3));
  const mesh = new Mesh(solid, material);
  mesh.matrixAutoUpdate = false;
  return mesh;
}
