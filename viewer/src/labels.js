// Texts over the picture, as flags on stems: nearest and most important first, and none over another.

import { Vector3 } from "three";

const STEMS = [12, 36, 60, 88, 120, 156], SHIFTS = [0.5, 0.12, 0.88];

export class Labels {
  constructor(parent) {
    this.parent = parent;
    this.pool = [];
    this.sizes = new Map();
    this.chosen = new Map();
  }

  /** Place `wanted`: { key, at: [x, y, z], html, role, priority, flat, colour }; `taken` are rectangles to keep clear of. */
  update(wanted, camera, width, height, taken) {
    const boxes = [...taken], shown = [], chosen = new Map(), p = new Vector3();
    for (const label of wanted) {
      p.set(...label.at).project(camera);
      label.x = ((p.x + 1) / 2) * width;
      label.y = ((1 - p.y) / 2) * height;
      label.depth = p.z;
    }
    const seen = wanted.filter((l) => l.depth < 1 && l.x > 0 && l.x < width && l.y > 4 && l.y < height);
    for (const label of seen.sort((a, b) => b.priority - a.priority)) {
      const [w, h] = this.size(label);
      const clash = (a) => boxes.some((b) => a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]);
      const options = label.flat ? [[0, 0.5]] : STEMS.flatMap((stem) => SHIFTS.map((shift) => [stem, shift]));
      const last = this.chosen.get(label.key);
      if (last) options.unshift(last);
      for (const [stem, shift] of options) {
        const x = Math.round(label.x - shift * w), y = Math.round(label.flat ? label.y - h / 2 : label.y - stem - h);
        const box = [x - 2, y - 2, x + w + 2, y + h + 2];
        if (box[0] < 0 || box[1] < 0 || box[2] > width || box[3] > height) continue;
        const pole = [label.x - 1, label.y - stem, label.x + 1, label.y];
        if (clash(box) || (!label.flat && clash(pole))) continue;
        boxes.push(box);
        if (!label.flat) boxes.push(pole);
        chosen.set(label.key, [stem, shift]);
        shown.push([label, x, y, stem]);
        break;
      }
    }
    this.chosen = chosen;
    while (this.pool.length < shown.length) this.pool.push(this.parent.appendChild(document.createElement("div")));
    this.pool.forEach((element, k) => {
      element.hidden = k >= shown.length;
      if (element.hidden) return;
      const [label, x, y, stem] = shown[k];
      if (element.text !== label.html) element.innerHTML = element.text = label.html;
      element.className = `label ${label.role}`;
      element.style.transform = `translate(${x}px, ${y}px)`;
      element.style.setProperty("--stem", `${label.flat ? 0 : stem}px`);
      element.style.setProperty("--foot", `${Math.round(label.x - x)}px`);
    });
  }

  size({ html, role }) {
    const key = role + html.replace(/\d/g, "0");
    if (!this.sizes.has(key)) {
      const probe = this.parent.appendChild(document.createElement("div"));
      probe.className = `label ${role}`;
      probe.innerHTML = html;
      this.sizes.set(key, [probe.offsetWidth + 1, probe.offsetHeight]);
      probe.remove();
    }
    return this.sizes.get(key);
  }
}
