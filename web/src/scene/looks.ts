/** Ways to look at a surface: each is one GLSL function `vec3 look(vec3 n, vec3 v)` of the unit normal and the unit
 * direction to the eye, both in eye space, on one shared material. Uniforms: base (surface colour, linear), value and
 * map (a scalar in -1..1 and its colours). */

import type { FieldName } from "../state/fields";

export type LookName = "shaded" | "isophotes" | "reflection" | "normals" | FieldName;

export interface Look {
  readonly name: LookName;
  readonly label: string;
  readonly hint: string;
  /** Its colours mean something. */
  readonly colored: boolean;
  /** The values at the vertices that it shows. */
  readonly field?: FieldName;
  readonly chunk: string;
}

const LIT = /* glsl */ `
  vec3 lit(vec3 color, vec3 n, vec3 v) {
    float key = max(dot(n, normalize(vec3(-0.35, 0.6, 0.75))), 0.0);
    float fill = max(dot(n, normalize(vec3(0.8, -0.1, 0.3))), 0.0);
    float sky = 0.5 + 0.5 * n.y;
    float rim = pow(1.0 - max(dot(n, v), 0.0), 4.0);
    vec3 h = normalize(v + normalize(vec3(-0.35, 0.6, 0.75)));
    float gloss = 0.12 * pow(max(dot(n, h), 0.0), 40.0);
    return color * (0.16 + 0.2 * sky + 0.72 * key * key + 0.16 * fill) + 0.04 * rim + gloss;
  }
  float stripes(float phase) {
    float width = max(fwidth(phase), 1e-5);
    float wave = abs(fract(phase) - 0.5) * 2.0;
    float sharp = smoothstep(0.5 - width, 0.5 + width, wave);
    return mix(sharp, 0.5, smoothstep(0.35, 0.7, width));
  }`;

const SCALAR = /* glsl */ `vec3 look(vec3 n, vec3 v) {
    vec3 color = texture2D(map, vec2(0.5 + 0.5 * clamp(value, -1.0, 1.0), 0.5)).rgb;
    return color * (0.72 + 0.28 * max(dot(n, v), 0.0));
  }`;

export const looks: readonly Look[] = [
  {
    name: "shaded",
    label: "Shaded",
    hint: "Soft light from above the left shoulder",
    colored: false,
    chunk: `${LIT} vec3 look(vec3 n, vec3 v) { return lit(base, n, v); }`,
  },
  {
    name: "isophotes",
    label: "Isophotes",
    hint: "Lines of equal brightness: kinks show a jump of the normal's change",
    colored: false,
    chunk: `${LIT} vec3 look(vec3 n, vec3 v) {
      float band = stripes(12.0 * acos(clamp(dot(n, normalize(vec3(-0.35, 0.6, 0.75))), -1.0, 1.0)) / 3.14159265);
      return lit(mix(base * 0.12, base * 1.1, band), n, v);
    }`,
  },
  {
    name: "reflection",
    label: "Reflection lines",
    hint: "A ceiling of parallel lamps, mirrored in the surface",
    colored: false,
    chunk: `${LIT} vec3 look(vec3 n, vec3 v) {
      vec3 r = reflect(-v, n);
      float band = stripes(8.0 * atan(r.x, r.y + 1.6));
      return mix(vec3(0.02), vec3(0.95), band) * (0.75 + 0.25 * max(dot(n, v), 0.0));
    }`,
  },
  {
    name: "normals",
    label: "Normal map",
    hint: "Rings around the line of sight, red to blue, show continuity and symmetry",
    colored: true,
    chunk: `${LIT} vec3 look(vec3 n, vec3 v) {
      vec3 side = normalize(cross(vec3(0.0, 1.0, 0.0), v));
      vec2 p = vec2(dot(n, side), dot(n, cross(v, side)));
      float angle = acos(clamp(dot(n, v), -1.0, 1.0)) / 1.57079633;
      float ring = stripes(7.0 * angle);
      vec3 warm = vec3(0.72, 0.05, 0.04);
      vec3 cool = vec3(0.03, 0.14, 0.62);
      vec3 hue = mix(cool, warm, smoothstep(-0.7, 0.7, p.x + 0.35 * p.y));
      return mix(hue, mix(hue, vec3(1.0), 0.78), ring);
    }`,
  },
  {
    name: "mean",
    label: "Mean curvature",
    hint: "Mean of the principal curvatures, positive where the surface bends away from its outward normal",
    colored: true,
    field: "mean",
    chunk: SCALAR,
  },
  {
    name: "gaussian",
    label: "Gaussian curvature",
    hint: "Product of the principal curvatures: positive on bumps and dents, negative on saddles, 0 on what unrolls",
    colored: true,
    field: "gaussian",
    chunk: SCALAR,
  },
  {
    name: "distance",
    label: "Distance to truth",
    hint: "From the true surface, positive outside it",
    colored: true,
    field: "distance",
    chunk: SCALAR,
  },
];

export function lookNamed(name: LookName): Look {
  return looks.find((look) => look.name === name) as Look;
}
