// An episode as the page holds it: columns that grow, and what was the case at a time.

const NONE = -2147483648; // stands for NaN and infinity

/** Header and columns of what usv_gym.replay.html.pack made. */
export async function unpack(base64) {
  const packed = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const raw = new Uint8Array(await new Response(stream).arrayBuffer());
  const length = new DataView(raw.buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(raw.subarray(4, 4 + length)));
  let at = 4 + length;
  const columns = {};
  for (const [name, rows, count, quantum, order] of header.columns) {
    const values = new Float64Array(rows * count);
    for (let i = 0, value = 0, change = 0; i < values.length; i++) {
      let coded = 0, place = 1, byte;
      do {
        byte = raw[at++];
        coded += (byte & 127) * place;
        place *= 128;
      } while (byte > 127);
      const step = coded % 2 ? -(coded + 1) / 2 : coded / 2;
      change = order === 2 ? change + step : step;
      value += change;
      values[i] = value === NONE ? NaN : value * quantum;
    }
    columns[name] = { rows, count, values };
  }
  return { header, columns };
}

/** Rows of numbers that grow together. */
class Series {
  constructor(rows) {
    this.rows = Array.from({ length: rows }, () => new Float32Array(0));
    this.length = 0;
  }

  append({ count, values }) {
    const length = this.length + count;
    this.rows = this.rows.map((row, r) => {
      if (row.length < length) {
        const grown = new Float32Array(this.length ? Math.max(length, 2 * row.length) : length);
        grown.set(row);
        row = grown;
      }
      row.set(values.subarray(r * count, (r + 1) * count), this.length);
      return row;
    });
    this.length = length;
  }
}

export class Episode {
  constructor() {
    this.series = {};
    this.t = [];
    this.reports = []; // of the TDM: { t, targets }
    this.ais = []; // by source: reports in order of time
    this.header = null;
  }

  /** Take over a whole episode, or what is new in a running one. */
  extend({ header, columns }) {
    this.header = header;
    const table = { d_: [], a_: [] };
    for (const [name, column] of Object.entries(columns)) {
      const rows = table[name.slice(0, 2)];
      if (rows) {
        for (let i = 0; i < column.count; i++) (rows[i] ??= {})[name.slice(2)] = column.values[i];
      } else if (name === "t") {
        for (const t of column.values) this.t.push(t);
      } else {
        (this.series[name] ??= new Series(column.rows)).append(column);
      }
    }
    const byTime = new Map();
    for (const row of table.d_) {
      if (!byTime.has(row.t)) byTime.set(row.t, []);
      byTime.get(row.t).push(row);
    }
    for (const t of [...byTime.keys()].sort((a, b) => a - b)) this.reports.push({ t, targets: byTime.get(t) });
    for (const row of table.a_) {
      const known = (this.ais[row.source] ??= []);
      if (!known.length || known.at(-1).t < row.t) known.push(row);
    }
  }

  get start() { return this.t[0]; }
  get end() { return this.t.at(-1); }
  get own() { return this.header.own; }
  get V() { return this.header.vessels; }
  get S() { return this.header.sources; }

  isVessel(s) { return s < this.V; }

  /** Index of the sample at or before t, and how far on it is to the next. */
  index(t) {
    const i = Math.max(0, upper(this.t, t, (x) => x) - 1);
    const step = this.t[i + 1] - this.t[i];
    return [i, step > 0 ? Math.min(1, Math.max(0, (t - this.t[i]) / step)) : 0];
  }

  /** Value of a series at t, straight between samples unless it is a code. */
  at(name, row, t) {
    const [i, f] = this.index(t);
    return this.between(name, row, i, f);
  }

  between(name, row, i, f) {
    const values = this.series[name].rows[row];
    const a = values[i];
    return f > 0 && i + 1 < this.t.length ? a + (values[i + 1] - a) * f : a;
  }

  /** Everything about place and motion of source s. */
  state(s, i, f) {
    const active = this.series.active.rows[s];
    if (f > 0 && i + 1 < this.t.length && !active[i + 1]) f = 0;
    const get = (name) => this.between(name, s, i, f);
    const vessel = this.isVessel(s);
    return {
      active: active[i] > 0, north: get("north"), east: get("east"), distance: get("distance"),
      seen: this.series.seen.rows[s][i],
      psi: vessel ? get("psi") : 0, sog: vessel ? get("sog") : 0, course: vessel ? get("course") : 0,
      rot: vessel ? get("rot") : 0,
    };
  }

  /** Targets of the TDM that were current at t. */
  targets(t) {
    const k = upper(this.reports, t + 1e-6, (r) => r.t) - 1;
    const patience = Math.max(5, 4 * this.header.tdm_period, 2.5 * (this.t[1] - this.t[0] || 0));
    return k >= 0 && t - this.reports[k].t < patience ? this.reports[k].targets : [];
  }

  /** Last AIS report of a source that got through, if it is not stale. */
  report(s, t) {
    const reports = this.ais[s];
    if (!reports) return null;
    const k = upper(reports, t + 1e-6, (r) => r.t) - 1;
    return k >= 0 && t - reports[k].t < 180 ? reports[k] : null;
  }

  /** Nearest active source and its distance, at sample i. */
  closest(i) {
    let best = Infinity, which = -1;
    for (let s = 0; s < this.S; s++) {
      if (s === this.own || !this.series.active.rows[s][i]) continue;
      const d = this.series.distance.rows[s][i];
      if (d < best) [best, which] = [d, s];
    }
    return { distance: best, source: which };
  }
}

/** How many of a sorted list are not above x. */
function upper(list, x, key) {
  let low = 0, high = list.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (key(list[middle]) <= x) low = middle + 1;
    else high = middle;
  }
  return low;
}
