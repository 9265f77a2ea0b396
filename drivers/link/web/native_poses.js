/* SPDX-License-Identifier: MIT */
// Poses of a head that moves: points of the polar layout go from the head's frame to the scene by the pose of their
// time (ANCHOR.md, *Between two poses*).

const KEEP = 8192; // most poses that are kept: 8 s at 1,000 poses a second, or ten of the longest poses frames

// Returns the way from pose a to pose b: the rotation at a, and the axis (head's frame) and angle of the turn from
// there.
function leg(a, b) {
  const [w, x, y, z] = a.quat, q = b.quat;
  const d = [w * q[0] + x * q[1] + y * q[2] + z * q[3], w * q[1] - x * q[0] - y * q[3] + z * q[2],
    w * q[2] + x * q[3] - y * q[0] - z * q[1], w * q[3] - x * q[2] + y * q[1] - z * q[0]];
  const sign = d[0] < 0 ? -1 : 1, sine = Math.sqrt(d[1] * d[1] + d[2] * d[2] + d[3] * d[3]);
  return {
    a, b, from: a.time, to: b.time, angle: 2 * Math.atan2(sine, sign * d[0]),
    axis: sine > 0 ? [(sign * d[1]) / sine, (sign * d[2]) / sine, (sign * d[3]) / sine] : [1, 0, 0],
    rotation: [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z),
      1 - 2 * (x * x + z * z), 2 * (y * z - w * x), 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
  };
}

export class Poses {
  constructor() {
    this.forget();
  }

  forget() {
    this.frames = [];
    this.n = 0;
  }

  /** poses: as readPoses gives them. Times are Numbers from here on, exact for 104 days. */
  add(poses) {
    this.frames.push(poses.map((p) => ({...p, time: Number(p.t_ns)})));
    this.n += poses.length;
    while (this.n > KEEP) this.n -= this.frames.shift().length;
  }

  // Returns the leg between the two poses around a time. Both poses are of the newest poses frame that covers the time.
  // null: no frame does.
  #leg(t_ns) {
    for (let f = this.frames.length - 1; f >= 0; f--) {
      const poses = this.frames[f], last = poses.length - 1;
      if (!(poses[0].time <= t_ns && t_ns <= poses[last].time)) continue;
      let low = 0, high = last; // poses[low].time <= t_ns, and the next one's is later, or the last one's
      while (high - low > 1) {
        const middle = (low + high) >> 1;
        if (poses[middle].time <= t_ns) low = middle;
        else high = middle;
      }
      return leg(poses[low], poses[low + 1]);
    }
    return null;
  }

  /** Moves points from..c.n of the columns from the head's frame to the scene. `times` gives the ns of each since the
   * scan's start. Points without a pose become NaN; place() returns how many. */
  place(c, from, times) {
    let now = null, missing = 0;
    for (let i = from; i < c.n; i++) {
      const t_ns = times(i);
      if (now === null || t_ns < now.from || t_ns >= now.to) now = this.#leg(t_ns);
      if (now === null) {
        c.x[i] = c.y[i] = c.z[i] = NaN;
        missing++;
      } else {
        turn(now, (t_ns - now.from) / (now.to - now.from), c, i);
      }
    }
    return missing;
  }
}

// Turns by Rodrigues' formula in the head's frame, and then by the rotation at the leg's begin.
function turn({a, b, axis, angle, rotation: m}, f, c, i) {
  const s = Math.sin(f * angle), versine = 1 - Math.cos(f * angle), [ax, ay, az] = axis;
  let x = c.x[i], y = c.y[i], z = c.z[i];
  const ux = ay * z - az * y, uy = az * x - ax * z, uz = ax * y - ay * x;
  const wx = ay * uz - az * uy, wy = az * ux - ax * uz, wz = ax * uy - ay * ux;
  x += s * ux + versine * wx;
  y += s * uy + versine * wy;
  z += s * uz + versine * wz;
  const p = a.position_m, q = b.position_m;
  c.x[i] = p[0] + f * (q[0] - p[0]) + (m[0] * x + m[1] * y + m[2] * z);
  c.y[i] = p[1] + f * (q[1] - p[1]) + (m[3] * x + m[4] * y + m[5] * z);
  c.z[i] = p[2] + f * (q[2] - p[2]) + (m[6] * x + m[7] * y + m[8] * z);
}
