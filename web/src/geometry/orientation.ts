/** A unit quaternion [w, x, y, z], device to world (ENU). */
export type Quaternion = [number, number, number, number];

/** Orientation from the W3C angles of a deviceorientation event (degrees): alpha about z, beta about the new x, gamma
 * about the newest y; the device's x points right, y to its top, z out of its screen. */
export function fromDeviceAngles(alpha: number, beta: number, gamma: number): Quaternion {
  return product(product(about(2, alpha), about(0, beta)), about(1, gamma));
}

export function product(a: Quaternion, b: Quaternion): Quaternion {
  const [aw, ax, ay, az] = a;
  const [bw, bx, by, bz] = b;
  return [
    aw * bw - ax * bx - ay * by - az * bz,
    aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw,
  ];
}

/** A device vector in the world. */
export function rotate(q: Quaternion, v: readonly [number, number, number]): [number, number, number] {
  const [w, x, y, z] = q;
  const turned = product(product(q, [0, ...v]), [w, -x, -y, -z]);
  return [turned[1], turned[2], turned[3]];
}

/** Same rotation, with the sign that is nearer to `before`, so that a series has no jumps. */
export function continued(q: Quaternion, before: Quaternion | undefined): Quaternion {
  const dot = before ? q[0] * before[0] + q[1] * before[1] + q[2] * before[2] + q[3] * before[3] : 1;
  return dot < 0 ? [-q[0], -q[1], -q[2], -q[3]] : q;
}

/** Whether these four numbers are a rotation: finite and of length one, nearly. */
export function isRotation(q: Quaternion): boolean {
  return Math.abs(Math.hypot(...q) - 1) < 0.01;
}

function about(axis: 0 | 1 | 2, degrees: number): Quaternion {
  const half = (degrees * Math.PI) / 360;
  const q: Quaternion = [Math.cos(half), 0, 0, 0];
  q[axis + 1] = Math.sin(half);
  return q;
}
