// The scene: what is drawn of an episode at a time, in groups that can be hidden.

import {
  BufferAttribute, BufferGeometry, CircleGeometry, Color, DirectionalLight, FogExp2, Group, HemisphereLight, Mesh, MeshBasicMaterial,
  MeshLambertMaterial, Scene, Vector3, WebGLRenderer,
} from "three";
import { Labels } from "./labels.js";
import { landOf } from "./land.js";
import { Line, RESOLUTION } from "./lines.js";
import { HAZE, HAZE_DENSITY, SUN, makeSea, makeSky } from "./sea.js";
import { HULL_NAMES, OBSTACLE_NAMES, circle, foam, heightOf, hullOf, obstacleOf, waterline } from "./shapes.js";

const DEG = Math.PI / 180, KNOT = 1852 / 3600, VECTOR_SECONDS = 60;
export const DESCRIPTORS = ["fixed", "vessel", "land"];
export const SIDES = { port: "#e5322d", starboard: "#15a05a", bow: "#2f6fe0", centre: "#e07a1f" };

/** Groups of the scene: caption, and whether they are shown at first. */
export const GROUPS = {
  land: ["Land", true], vessels: ["Ships", true], obstacles: ["Obstacles", true], detections: ["Detections", true], covariance: ["Uncertainty 2σ", false],
  labels: ["Labels", true], ais: ["AIS symbols", true], shadows: ["Radar shadow", true], rings: ["Range rings", true],
  route: ["Route", true], track: ["Own track", true], tracks: ["Ship tracks", false], vectors: ["Speed vectors", true],
  thrust: ["Thrust", true], closest: ["Closest", false],
};

const text = (s) => String(s).replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`);
export const degrees = (rad) => String(Math.round(((rad / DEG) % 360) + 360) % 360).padStart(3, "0") + "°";
export const knots = (speed) => (speed / KNOT).toFixed(1);
export const targetName = (d) => `T${String(d.id).padStart(2, "0")}`;

/** Triangles with a colour and an opacity each corner, made anew every frame. */
class Patches extends Mesh {
  constructor(order, capacity) {
    const g = new BufferGeometry();
    g.setAttribute("position", new BufferAttribute(new Float32Array(capacity * 3), 3));
    g.setAttribute("color", new BufferAttribute(new Float32Array(capacity * 4), 4));
    super(g, new MeshBasicMaterial({ vertexColors: true, transparent: true, depthWrite: false, side: 2 }));
    this.frustumCulled = false;
    this.renderOrder = order;
    this.capacity = capacity;
  }

  begin() { this.n = 0; }

  /** Corners [x, z, opacity] of a quadrangle. */
  quad(colour, a, b, c, d) {
    if (this.n + 6 > this.capacity) return;
    for (const [x, z, alpha] of [a, b, c, a, c, d]) {
      this.geometry.attributes.position.setXYZ(this.n, x, 0, z);
      this.geometry.attributes.color.setXYZW(this.n++, colour.r, colour.g, colour.b, alpha);
    }
  }

  end() {
    this.geometry.setDrawRange(0, this.n);
    this.geometry.attributes.position.needsUpdate = this.geometry.attributes.color.needsUpdate = true;
  }
}

export class View {
  constructor(canvas, labels, rig) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true });
    this.rig = rig;
    this.scene = new Scene();
    this.scene.fog = new FogExp2(HAZE, HAZE_DENSITY);
    this.scene.add((this.sky = makeSky()), (this.sea = makeSea()));
    this.scene.add(new HemisphereLight("#eaf4ff", "#4f8296", 1.75));
    const sun = new DirectionalLight("#fff1dc", 2.3);
    sun.position.copy(SUN);
    this.scene.add(sun);
    this.labels = new Labels(labels);
    this.groups = {};
    for (const name of Object.keys(GROUPS)) this.scene.add((this.groups[name] = new Group()));
    this.solid = new MeshLambertMaterial({ vertexColors: true, side: 2 });
    this.froth = new MeshBasicMaterial({ vertexColors: true, transparent: true, depthWrite: false });
    this.groups.shadows.add((this.shadows = new Patches(1, 64 * 6 * 12)));
    this.scene.add((this.wakes = new Patches(2, 48 * 6 * 26)));
    this.things = [];
    this.spots = [];
    this.visible = Object.fromEntries(Object.entries(GROUPS).map(([name, [, on]]) => [name, on]));
    this.clock = 0;
    this.selected = -1;
  }

  /** Everything that an episode's header and columns decide; again whenever they grew. */
  load(episode) {
    this.episode = episode;
    const h = episode.header, first = !this.colours;
    this.colours = h.colours;
    if (first) {
      this.makeOverlays();
      this.reach = Math.max(320, 0.62 * Math.hypot(...h.route.reduce(([a, b], [n, e]) => [Math.max(a, Math.abs(n)), Math.max(b, Math.abs(e))], [0, 0])) * 2);
      this.rig.home(h.length[h.own], this.reach);
    }
    this.makeLand(h);
    this.makeRoute(h);
    this.makeTracks();
  }

  colour(role, line = true) {
    const [fill, edge] = this.colours[role];
    return (line ? edge : fill) || fill || edge;
  }

  // --- made once -------------------------------------------------------------------------------------------------------
  makeOverlays() {
    const { rings, thrust, vectors, closest } = this.groups, h = this.episode.header;
    rings.add((this.ringRoot = new Group()));
    this.ringLabels = [];
    const ring = (r, role, dash, width, caption) => {
      this.ringRoot.add(new Line(this.colour(role), width, { dash, order: 4, alpha: role === "ring" ? 0.75 : 0.95, fade: 1 / 1600 }).set(circle(r, 160).map(([x, z]) => [x, 0, z]), true));
      this.ringLabels.push([r, caption, role]);
    };
    for (const r of [200, 500, 1000]) if (!(h.radar && r > 0.97 * h.radar)) ring(r, "ring", r / 60, 1.2, `${r} m`);
    if (h.lidar) ring(h.lidar, "ring_lidar", h.lidar / 30, 1.6, `LiDAR ${Math.round(h.lidar)} m`);
    if (h.radar) ring(h.radar, "ring_radar", 0, 1.8, `radar ${Math.round(h.radar)} m`);
    thrust.add((this.arrowRoot = new Group()));
    this.arrows = h.thrusters.map(([x, y, side]) => {
      const arrow = makeArrow(SIDES[side]);
      this.arrowRoot.add(arrow);
      return { arrow, x, y, side };
    });
    this.ownVector = new Line("#fff3c4", 2.2, { order: 12 });
    vectors.add(this.ownVector);
    this.closestLine = new Line(this.colour("cpa"), 2, { dash: 6, order: 12 });
    closest.add(this.closestLine);
    this.selection = new Line("#ffffff", 2.5, { order: 20, through: true });
    this.scene.add(this.selection);
    this.discs = [];
  }

  makeLand(h) {
    if (!h.land) return; // a later piece of a live episode
    this.groups.land.clear();
    for (const rings of h.land) this.groups.land.add(landOf(rings, this.solid));
  }

  makeRoute(h) {
    const { route } = this.groups;
    if (JSON.stringify(h.route) === this.routeDrawn) return;
    this.routeDrawn = JSON.stringify(h.route);
    route.clear();
    const points = h.route.map(([n, e]) => [e, 0.02, -n]), red = this.colour("route");
    if (points.length > 1) route.add(new Line(red, 2, { dash: 14, order: 6 }).set(dense(points, 20)));
    points.slice(1).forEach(([x, , z]) => {
      if (h.acceptance) route.add(new Line(red, 1.6, { order: 6, alpha: 0.8, dash: 4 }).set(circle(h.acceptance).map(([a, b]) => [x + a, 0.02, z + b]), true));
      route.add(new Line(red, 2, { order: 6 }).set([[x, 0, z], [x, 9, z]]));
    });
  }

  makeTracks() {
    const { episode } = this, { track, tracks } = this.groups, T = episode.t.length;
    this.trackEvery = Math.max(1, Math.ceil(T / 3000));
    this.trackLines ??= [];
    const { north, east, active } = episode.series;
    for (let j = 0; j < episode.V; j++) {
      if (!active.rows[j].some((on) => on)) continue;
      const own = j === episode.own;
      const line = (this.trackLines[j] ??= this.addTo(own ? track : tracks, new Line(own ? "#a53fd6" : this.colour("track_ship"), own ? 4 : 2, { order: 7, alpha: own ? 0.95 : 0.85 })));
      const points = [];
      for (let i = 0; i < T; i += this.trackEvery) if (active.rows[j][i]) points.push([east.rows[j][i], 0.03, -north.rows[j][i]]);
      line.first = active.rows[j].indexOf(1);
      line.set(points);
    }
    this.trackEnd ??= this.addTo(track, new Line("#a53fd6", 4, { order: 7, alpha: 0.95 }));
  }

  addTo(group, object) {
    group.add(object);
    return object;
  }

  /** Solid, foam and marks of a source; made anew when another object took its slot. */
  thing(s) {
    const { episode } = this, h = episode.header, vessel = episode.isVessel(s);
    const size = vessel ? [h.length[s], h.beam[s]] : [h.radius[s - episode.V]];
    const key = [h.kinds[s], h.names[s], ...size].join();
    const known = this.things[s];
    if (known?.key === key) return known;
    for (const object of known?.objects ?? []) object.removeFromParent();
    const kind = vessel ? HULL_NAMES[h.kinds[s]] ?? "ship" : OBSTACLE_NAMES[h.kinds[s]] ?? "iceberg";
    const role = s === episode.own ? "own_hull" : `${kind}_hull`;
    const geometry = vessel ? hullOf(h.kinds[s], ...size, this.colour(role, false)) : obstacleOf(h.kinds[s], size[0], s - episode.V);
    const body = new Mesh(geometry, this.solid), objects = [body];
    const outline = vessel ? waterline(...size) : circle(0.9 * size[0], 28);
    const width = vessel ? 0.35 * size[1] + 0.5 : 0.16 * size[0] + 0.3;
    const edge = new Mesh(foam(outline, width, "#ffffff", 0.5), this.froth);
    edge.renderOrder = 3;
    body.add(edge);
    if (kind === "iceberg") {
      const under = new Mesh(foam(circle(0.6 * size[0], 28), 0.75 * size[0], "#56c4cf", 0.75), this.froth);
      under.renderOrder = 2;
      body.add(under);
    }
    (s === episode.own ? this.scene : vessel ? this.groups.vessels : this.groups.obstacles).add(body);
    const made = { key, body, objects, kind, size, height: heightOf(geometry), half: vessel ? size[0] / 2 : size[0] };
    if (vessel && s !== episode.own) made.vector = this.addTo(this.groups.vectors, new Line(this.colour("vector"), 2.2, { order: 12 }));
    if (h.ais_class[s] && s !== episode.own) made.ais = this.addTo(this.groups.ais, new Line(this.colour("ais"), 2.4, { order: 15, through: true }));
    objects.push(...[made.vector, made.ais].filter(Boolean));
    return (this.things[s] = made);
  }

  disc(k) {
    return (this.discs[k] ??= this.makeDisc());
  }

  makeDisc() {
    const root = new Group();
    const fill = new Mesh(new CircleGeometry(1, 48).rotateX(-Math.PI / 2), new MeshBasicMaterial({ color: "#ff9a1f", transparent: true, opacity: 0.42, depthWrite: false, fog: false }));
    fill.renderOrder = 8;
    const ring = circle(1, 48).map(([x, z]) => [x, 0, z]);
    const rim = new Line("#ff8a12", 2.6, { order: 9 }).set(ring, true);
    const ghost = new Line("#ff8a12", 1.6, { order: 9, alpha: 0.55, through: true }).set(ring, true);
    root.add(fill, rim, ghost);
    this.groups.detections.add(root);
    const sigma = this.addTo(this.groups.covariance, new Line(this.colour("covariance"), 1.8, { dash: 0.25, order: 10 }).set(ring, true));
    const vector = this.addTo(this.groups.vectors, new Line("#ff9a1f", 1.8, { dash: 8, order: 12 }));
    return { root, sigma, vector };
  }

  // --- every frame -----------------------------------------------------------------------------------------------------
  update(t, dt) {
    const { episode, rig } = this, h = episode.header, [i, f] = episode.index(t);
    this.clock += dt;
    const states = [];
    for (let s = 0; s < episode.S; s++) states[s] = episode.series.active.rows[s][i] ? episode.state(s, i, f) : null;
    const own = states[episode.own] ?? episode.state(episode.own, i, f);
    const focus = states[this.selected] ?? own;
    rig.update(own, focus);
    for (const name of Object.keys(GROUPS)) this.groups[name].visible = this.visible[name];
    this.weather(i, f);
    const wanted = [];
    this.targets = episode.targets(t);
    const bySource = new Map(this.targets.map((d) => [d.source, d]));
    this.spots = [];
    this.bodies(t, states, own, wanted, bySource);
    this.detections(wanted, states, bySource);
    this.own(own, t, i, f);
    this.shade(states, own);
    this.rings(own, wanted);
    h.route.slice(1).forEach(([n, e], k) => wanted.push({ key: `w${k}`, at: [e, 9, -n], html: `WP${k + 1}`, role: "waypoint", priority: 3, group: "route" }));
    this.nearest(states, own, i, wanted);
    const mark = states[this.selected];
    this.selection.visible = !!mark;
    if (mark) {
      const r = 1.25 * this.things[this.selected].half + 1;
      this.selection.set(circle(r).map(([x, z]) => [mark.east + x, 0.1, -mark.north + z]), true);
    }
    this.wanted = wanted.filter((l) => !l.group || this.visible[l.group]);
    return own;
  }

  draw(width, height, taken) {
    this.sky.position.copy(this.rig.camera.position);
    this.sea.position.set(this.rig.camera.position.x, 0, this.rig.camera.position.z);
    this.renderer.render(this.scene, this.rig.camera);
    this.labels.update(this.visible.labels ? this.wanted : [], this.rig.camera, width, height, taken);
    const p = new Vector3();
    for (const spot of this.spots) {
      p.set(...spot.at).project(this.rig.camera);
      Object.assign(spot, { x: ((p.x + 1) / 2) * width, y: ((1 - p.y) / 2) * height, front: p.z < 1 });
    }
  }

  /** Source at a point of the canvas, -1 for none. */
  pick(x, y) {
    let best = 1, which = -1;
    const { camera, canvas } = this.rig, scale = canvas.clientHeight / (2 * Math.tan((camera.fov * DEG) / 2));
    for (const { source, at, half, x: sx, y: sy, front } of this.spots) {
      if (!front) continue;
      const distance = camera.position.distanceTo(new Vector3(...at));
      const score = Math.hypot(sx - x, sy - y) / Math.max(22, (0.8 * half * scale) / distance);
      if (score < best) [best, which] = [score, source];
    }
    return which;
  }

  resize(width, height, ratio) {
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    RESOLUTION.value.set(width, height);
    this.rig.resize(width, height);
  }

  weather(i, f) {
    const { episode } = this, height = episode.between("wave_height", 0, i, f), to = episode.between("wave_to", 0, i, f);
    const wind = episode.between("wind", 0, i, f), u = this.sea.material.uniforms;
    u.time.value = this.clock;
    u.steep.value = 0.03 + 0.022 * Math.min(height, 4) + 0.0016 * Math.min(wind, 20);
    u.towards.value.set(Math.sin(to), -Math.cos(to));
  }

  bodies(t, states, own, wanted, bySource) {
    const { episode, wakes } = this, h = episode.header, white = new Color("#ffffff");
    wakes.begin();
    for (let s = 0; s < episode.S; s++) {
      const q = states[s];
      if (!q) {
        for (const object of this.things[s]?.objects ?? []) object.visible = false;
        if (this.trackLines[s] && episode.isVessel(s)) this.cutTrack(s, t);
        continue;
      }
      const thing = this.thing(s), { body } = thing;
      for (const object of thing.objects) object.visible = true;
      body.position.set(q.east, 0, -q.north);
      body.rotation.y = -q.psi;
      // on the map of the top camera a ship is never too small to be seen
      const enlarged = this.rig.mode === "top" ? Math.max(1, (episode.isVessel(s) ? 0.045 : 0.015) * this.rig.view.distance / (2 * thing.half)) : 1;
      body.scale.setScalar(enlarged);
      thing.reach = thing.half * enlarged;
      const away = Math.hypot(q.north - own.north, q.east - own.east);
      const group = s < episode.V ? "vessels" : "obstacles";
      if (s === episode.own || this.visible[group]) this.spots.push({ source: s, at: [q.east, thing.height / 3, -q.north], half: thing.half });
      if (episode.isVessel(s)) {
        this.cutTrack(s, t);
        if ((s === episode.own || this.visible.vessels) && q.sog > 0.3 && away < 3000) this.wake(s, t, q, thing, white);
        thing.vector?.set(vector(q, q.sog, q.course, 1.2));
      }
      if (thing.ais) this.aisSymbol(s, t, thing, q);
      if (s !== episode.own && episode.isVessel(s) && !bySource.has(s)) {
        wanted.push({ key: `n${s}`, at: this.over(q.east, thing.height, -q.north, thing), role: "unseen", priority: 4,
          html: `${text(h.names[s])}<small>not detected</small>`, group: "vessels" });
      }
    }
    wakes.end();
  }

  /** Where the stem of a label stands: on top of a thing, or at its upper edge on a map. */
  over(x, y, z, thing) {
    return this.rig.mode === "top" ? [x, 0, z - (thing?.reach ?? 0)] : [x, y, z];
  }

  cutTrack(j, t) {
    const { episode } = this, line = this.trackLines[j], [i] = episode.index(t);
    if (!line) return;
    const n = Math.floor(i / this.trackEvery) - Math.floor(line.first / this.trackEvery) + 1;
    line.cut(n);
    if (j === episode.own) {
      const k = Math.floor(i / this.trackEvery) * this.trackEvery, { north, east } = episode.series;
      const points = [];
      for (let m = k; m <= i; m++) points.push([east.rows[j][m], 0.03, -north.rows[j][m]]);
      this.trackEnd.set([...points, [episode.at("east", j, t), 0.03, -episode.at("north", j, t)]]);
    }
  }

  /** Foam astern, over where the ship was. */
  wake(s, t, q, { size: [L, B] }, white) {
    const { episode } = this, n = 12, step = Math.min(2.2, (3.2 * L) / q.sog / n);
    let last = null;
    for (let k = 0; k <= n; k++) {
      const at = t - k * step;
      if (at < episode.start) break;
      const [i, f] = episode.index(at);
      if (!episode.series.active.rows[s][i]) break;
      const p = k ? episode.state(s, i, f) : q;
      const [sn, cn] = [Math.sin(p.psi), Math.cos(p.psi)];
      const x = p.east - sn * 0.46 * L, z = -(p.north - cn * 0.46 * L);
      const w = B * (0.34 + 0.075 * k), a = 0.62 * (1 - k / n) ** 1.4 * Math.min(1, q.sog / 2.5);
      const here = [[x - cn * w, z - sn * w, 0], [x, z, a], [x + cn * w, z + sn * w, 0]];
      if (last) {
        this.wakes.quad(white, last[0], last[1], here[1], here[0]);
        this.wakes.quad(white, last[1], last[2], here[2], here[1]);
      }
      last = here;
    }
  }

  aisSymbol(s, t, thing, q) {
    const r = this.episode.report(s, t);
    thing.ais.visible = !!r;
    if (!r) return;
    const away = this.rig.camera.position.distanceTo(new Vector3(r.east, 0, -r.north));
    const size = Math.max(0.6 * thing.half, 0.022 * away), psi = Number.isFinite(r.heading) ? r.heading : 0;
    const [sn, cn] = [Math.sin(psi), Math.cos(psi)];
    thing.ais.set([[0.62, 0], [-0.38, 0.33], [-0.38, -0.33]].map(([a, b]) => [r.east + size * (a * sn + b * cn), 0.3, -(r.north + size * (a * cn - b * sn))]), true);
  }

  detections(wanted, states, bySource) {
    const { episode } = this, h = episode.header, camera = this.rig.camera.position;
    this.targets.forEach((d, k) => {
      const { root, sigma, vector: ahead } = this.disc(k), moving = d.descriptor === 1 && d.motion_known && Number.isFinite(d.cog);
      const known = Number.isFinite(d.radius), r = known ? d.radius : 6;
      root.visible = true;
      root.position.set(d.east, 0.06, -d.north);
      root.rotation.y = moving ? -d.cog : 0;
      // a vessel is as long as the estimated size and a third as wide
      root.scale.set(moving && known ? r / 3 : r, 1, r);
      const [major, minor, turn] = axes(d);
      sigma.visible = major > 0;
      sigma.position.set(d.east, 0.08, -d.north);
      sigma.rotation.y = -turn;
      sigma.scale.set(2 * minor || 1, 1, 2 * major || 1);
      ahead.visible = moving && d.sog > 0.2;
      if (ahead.visible) ahead.set(vector(d, d.sog, d.cog, 0.2));
      const q = states[d.source], thing = q && this.things[d.source], kind = DESCRIPTORS[d.descriptor] ?? "?";
      const name = thing && d.source < episode.V ? ` <i>${text(h.names[d.source])}</i>` : "";
      const motion = moving && Number.isFinite(d.sog) ? `<small>COG ${degrees(d.cog)} · SOG ${knots(d.sog)} kn</small>` : "";
      const away = Math.hypot(d.east - camera.x, -d.north - camera.z);
      const base = thing && this.visible[d.source < episode.V ? "vessels" : "obstacles"] ? thing.height : 1;
      wanted.push({ key: `d${d.id}`, at: this.over(d.east, base, -d.north, thing), html: `<b>${targetName(d)}</b> ${kind}${name}${motion}`, group: "detections",
        role: moving ? "target moving" : "target", priority: (moving ? 5 : 4) - Math.tanh(away / 900) });
    });
    this.discs.slice(this.targets.length).forEach(({ root, sigma, vector: ahead }) => (root.visible = sigma.visible = ahead.visible = false));
  }

  own(q, t, i, f) {
    const { episode } = this, L = episode.header.length[episode.own], B = episode.header.beam[episode.own];
    this.arrowRoot.position.set(q.east, 0, -q.north);
    this.arrowRoot.rotation.y = -q.psi;
    this.arrows.forEach(({ arrow, x, y, side }, k) => {
      const fx = episode.between("thrust_x", k, i, f), fy = episode.between("thrust_y", k, i, f), share = Math.hypot(fx, fy);
      arrow.visible = share > 0.01;
      if (!arrow.visible) return;
      // the jet, opposite to the force on the hull
      const length = 1.1 * L * share;
      const spread = side === "bow" ? -Math.sign(fy) * 0.4 * B : y + Math.sign(y) * 0.16 * B;
      arrow.position.set(spread, 0.075 * L, -x);
      arrow.rotation.y = Math.atan2(-fy, fx);
      const width = 0.3 * L * Math.max(0.35, Math.sqrt(share));
      arrow.scale.set(width, width, length);
    });
    this.ownVector.set(vector(q, q.sog, q.course, 0.15));
    this.ownVector.visible = q.sog > 0.1;
  }

  /** What the radar cannot see because something is in the way. */
  shade(states, own) {
    const { episode, shadows } = this, reach = episode.header.radar, grey = new Color("#24313b");
    shadows.begin();
    for (let s = 0; reach && this.visible.shadows && s < episode.S; s++) {
      const q = states[s];
      if (!q || s === episode.own) continue;
      const { size } = this.thing(s), dn = q.north - own.north, de = q.east - own.east, d = Math.hypot(dn, de), bearing = Math.atan2(de, dn);
      const aspect = bearing - q.psi;
      const half = episode.isVessel(s) ? 0.5 * (Math.abs(size[0] * Math.sin(aspect)) + Math.abs(size[1] * Math.cos(aspect))) : size[0];
      if (d <= half || d >= reach) continue;
      const open = Math.asin(half / d), n = 2 + Math.floor(open * 8), near = Math.sqrt(d * d - half * half);
      const at = (r, b, a) => [own.east + r * Math.sin(b), -(own.north + r * Math.cos(b)), a];
      const fades = [[near, 0.34], [Math.min(reach, near + 0.3 * (reach - near)), 0.24], [reach, 0.1]];
      for (let k = 0; k < n; k++) {
        const b0 = bearing - open + (2 * open * k) / n, b1 = bearing - open + (2 * open * (k + 1)) / n;
        for (let m = 0; m < 2; m++) {
          const [[r0, a0], [r1, a1]] = [fades[m], fades[m + 1]];
          shadows.quad(grey, at(r0, b0, a0), at(r0, b1, a0), at(r1, b1, a1), at(r1, b0, a1));
        }
      }
    }
    shadows.end();
  }

  rings(own, wanted) {
    this.ringRoot.position.set(own.east, 0.02, -own.north);
    const b = this.rig.yaw + 13 * DEG;
    for (const [r, caption, role] of this.ringLabels) {
      wanted.push({ key: caption, at: [own.east + r * Math.sin(b), 0, -(own.north + r * Math.cos(b))], html: caption, role: role === "ring_lidar" ? "ring lidar" : "ring",
        priority: -r / 1e4, flat: true, group: "rings" });
    }
  }

  nearest(states, own, i, wanted) {
    const { distance, source } = this.episode.closest(i), q = states[source];
    this.closestLine.visible = !!q;
    if (!q) return;
    this.closestLine.set([[own.east, 0.5, -own.north], [q.east, 0.5, -q.north]]);
    wanted.push({ key: "closest", at: [(own.east + q.east) / 2, 0.5, -(own.north + q.north) / 2], html: `${distance.toFixed(0)} m`, role: "cpa", priority: 6, flat: true, group: "closest" });
  }
}

/** From where something is to where it will be, with a head. */
function vector({ north, east }, speed, course, y) {
  const reach = speed * VECTOR_SECONDS, [s, c] = [Math.sin(course), Math.cos(course)];
  if (reach < 3) return [];
  const h = Math.min(0.12 * reach, 14), at = (a, b) => [east + a * s + b * c, y, -(north + a * c - b * s)];
  return [at(0, 0), at(reach, 0), at(reach - h, 0.45 * h), at(reach, 0), at(reach - h, -0.45 * h)];
}

/** Standard deviations along the axes of the position's covariance, and the bearing of the larger. */
function axes({ cov_nn: a, cov_ne: b, cov_ee: c }) {
  if (![a, b, c].every(Number.isFinite)) return [0, 0, 0];
  const mean = (a + c) / 2, spread = Math.hypot((a - c) / 2, b);
  return [Math.sqrt(Math.max(0, mean + spread)), Math.sqrt(Math.max(0, mean - spread)), 0.5 * Math.atan2(2 * b, a - c)];
}

function dense(points, step) {
  const out = [points[0]];
  for (let i = 1; i < points.length; i++) {
    const [a, b] = [points[i - 1], points[i]], n = Math.ceil(Math.hypot(b[0] - a[0], b[2] - a[2]) / step);
    for (let k = 1; k <= n; k++) out.push(a.map((v, m) => v + ((b[m] - v) * k) / n));
  }
  return out;
}

/** Arrow of length 1 along +z, as wide as it needs to be. */
function makeArrow(colour) {
  const profile = [[0.05, 0], [0.05, 0.66], [0.13, 0.66], [0, 1]], n = 14, xyz = [];
  for (let k = 0; k + 1 < profile.length; k++) {
    const [[r0, z0], [r1, z1]] = [profile[k], profile[k + 1]];
    for (let i = 0; i < n; i++) {
      const p = (r, z, j) => [r * Math.cos((2 * Math.PI * j) / n), r * Math.sin((2 * Math.PI * j) / n), z];
      for (const q of [p(r0, z0, i), p(r0, z0, i + 1), p(r1, z1, i + 1), p(r0, z0, i), p(r1, z1, i + 1), p(r1, z1, i)]) xyz.push(...q);
    }
  }
  const g = new BufferGeometry();
  g.setAttribute("position", new BufferAttribute(new Float32Array(xyz), 3));
  g.computeVertexNormals();
  return new Mesh(g, new MeshLambertMaterial({ color: colour, emissive: colour, emissiveIntensity: 0.35, side: 2, fog: false }));
}
