// Four cameras, one way to turn them: drag or one finger turns, wheel or pinch zooms, right button, shift or two fingers move.

import { PerspectiveCamera, Raycaster, Vector2, Vector3 } from "three";

const DEG = Math.PI / 180;
export const CAMERAS = { chase: "Chase", bridge: "Bridge", top: "Top", free: "Free" };
const LOW = { chase: 3, bridge: -35, top: 89.9, free: 2 }, HIGH = { chase: 80, bridge: 35, top: 89.9, free: 89 };

export class Rig {
  constructor(canvas, changed) {
    this.camera = new PerspectiveCamera(52, 1, 0.5, 45000);
    this.changed = changed;
    this.mode = "chase";
    this.pose = null;
    this.listen(canvas);
  }

  /** Sizes decide where the cameras start. */
  home(length, reach) {
    this.length = length;
    this.views = {
      chase: { yaw: 0, pitch: 15, distance: Math.max(4.2 * length, 20), pan: [0, 0] },
      bridge: { yaw: 0, pitch: 3, distance: 0, pan: [0, 0] },
      top: { yaw: 0, pitch: 89.9, distance: reach, pan: [0, 0] },
      free: { yaw: 40, pitch: 22, distance: Math.max(12 * length, 60), pan: [0, 0] },
    };
  }

  use(mode) {
    this.mode = mode;
    this.changed();
  }

  get view() { return this.views[this.mode]; }

  /** Compass direction of the view [rad]. */
  get yaw() {
    const turns = this.mode === "chase" || this.mode === "bridge";
    return this.view.yaw * DEG + (turns && this.pose ? this.pose.psi : 0);
  }

  /** Follow `own`; the free camera goes around `focus`.  Poses: { north, east, psi, height }. */
  update(own, focus) {
    this.pose = own;
    const { camera, view, yaw } = this, pitch = view.pitch * DEG;
    const ahead = new Vector3(Math.sin(yaw), 0, -Math.cos(yaw));
    camera.up.set(0, 1, 0);
    if (this.mode === "bridge") {
      const b = new Vector3(Math.sin(own.psi), 0, -Math.cos(own.psi));
      camera.position.set(own.east, Math.max(0.34 * this.length, 2.5), -own.north).addScaledVector(b, -0.12 * this.length);
      camera.lookAt(camera.position.clone().addScaledVector(ahead, Math.cos(pitch)).add(new Vector3(0, -Math.sin(pitch), 0)));
    } else {
      const centre = this.mode === "free" ? focus : own;
      const target = new Vector3(centre.east + view.pan[0], this.mode === "chase" ? 0.22 * this.length : 0, -centre.north + view.pan[1]);
      if (this.mode === "top") camera.up.copy(ahead);
      camera.position.copy(target).addScaledVector(ahead, -view.distance * Math.cos(pitch));
      camera.position.y += view.distance * Math.sin(pitch);
      if (this.mode === "chase") target.addScaledVector(ahead, 0.55 * view.distance);
      if (this.mode === "top") camera.position.set(target.x, view.distance, target.z);
      camera.lookAt(target);
    }
    camera.updateMatrixWorld();
  }

  resize(width, height) {
    this.camera.aspect = width / height;
    this.camera.fov = width < height ? 66 : 52;
    this.camera.updateProjectionMatrix();
  }

  /** Where on the water a point of the canvas lies, [north, east]; null for the sky.  x, y in [-1, 1]. */
  water(x, y) {
    const caster = new Raycaster();
    caster.setFromCamera(new Vector2(x, y), this.camera);
    const { origin, direction } = caster.ray;
    if (direction.y >= -1e-4) return null;
    const p = origin.clone().addScaledVector(direction, -origin.y / direction.y);
    return [-p.z, p.x];
  }

  turn(dx, dy) {
    const { view, mode } = this;
    if (mode === "top") return this.move(dx, dy);
    const sign = mode === "bridge" ? -1 : 1;
    view.yaw += sign * dx * 0.25;
    view.pitch = Math.min(HIGH[mode], Math.max(LOW[mode], view.pitch + sign * dy * 0.25));
  }

  move(dx, dy) {
    const { view, mode, yaw } = this;
    if (mode === "chase" || mode === "bridge") return this.turn(dx, dy);
    const scale = (1.0 * view.distance) / this.canvas.clientHeight;
    const [s, c] = [Math.sin(yaw), Math.cos(yaw)];
    view.pan[0] += scale * (-dx * c + dy * s);
    view.pan[1] += scale * (-dx * s - dy * c);
  }

  zoom(factor) {
    const { view, mode } = this;
    if (mode === "bridge") {
      this.camera.fov = Math.min(75, Math.max(12, this.camera.fov * factor));
      this.camera.updateProjectionMatrix();
    } else {
      view.distance = Math.min(mode === "top" ? 9000 : 4000, Math.max(mode === "chase" ? 1.6 * this.length : 5, view.distance * factor));
    }
  }

  listen(canvas) {
    this.canvas = canvas;
    const down = new Map();
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    canvas.addEventListener("pointerdown", (e) => {
      canvas.setPointerCapture(e.pointerId);
      down.set(e.pointerId, [e.clientX, e.clientY]);
    });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (e) => down.delete(e.pointerId));
    canvas.addEventListener("pointermove", (e) => {
      const last = down.get(e.pointerId);
      if (!last) return;
      const [dx, dy] = [e.clientX - last[0], e.clientY - last[1]];
      if (down.size === 2) {
        const other = [...down.entries()].find(([id]) => id !== e.pointerId)[1];
        const gap = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
        this.zoom(gap(last) / gap([e.clientX, e.clientY]));
        this.move(dx / 2, dy / 2);
      } else if (e.shiftKey || e.buttons === 2) {
        this.move(dx, dy);
      } else {
        this.turn(dx, dy);
      }
      down.set(e.pointerId, [e.clientX, e.clientY]);
      this.changed();
    });
    canvas.addEventListener("wheel", (e) => {
      e.preventDefault();
      this.zoom(Math.exp(0.0012 * e.deltaY));
      this.changed();
    }, { passive: false });
  }
}
