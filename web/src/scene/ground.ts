import { type Color, DoubleSide, Mesh, PlaneGeometry, ShaderMaterial, Vector3 } from "three";

const vertexShader = /* glsl */ `
  varying vec2 place;
  void main() {
    vec4 world = modelMatrix * vec4(position, 1.0);
    place = world.xy;
    gl_Position = projectionMatrix * viewMatrix * world;
  }`;

const fragmentShader = /* glsl */ `
  uniform vec3 color;
  uniform vec3 centre;
  uniform float spacing;
  uniform float radius;
  varying vec2 place;
  float lines(vec2 p) {
    vec2 width = fwidth(p);
    vec2 near = abs(fract(p - 0.5) - 0.5) / max(width, vec2(1e-6));
    return 1.0 - min(min(near.x, near.y), 1.0);
  }
  void main() {
    float fade = 1.0 - smoothstep(0.25, 1.0, distance(place, centre.xy) / radius);
    float strength = max(0.3 * lines(place / spacing), 0.7 * lines(place / (5.0 * spacing)));
    gl_FragColor = vec4(color, strength * fade);
    #include <colorspace_fragment>
  }`;

/** A faint grid on the ground plane that fades out around the object. */
export class Ground {
  readonly #material = new ShaderMaterial({
    vertexShader,
    fragmentShader,
    transparent: true,
    depthWrite: false,
    side: DoubleSide,
    forceSinglePass: true,
    uniforms: {
      color: { value: null },
      centre: { value: new Vector3() },
      spacing: { value: 0.1 },
      radius: { value: 1 },
    },
  });
  readonly object = new Mesh(new PlaneGeometry(2, 2), this.#material);

  constructor(color: Color) {
    this.recolor(color);
    this.object.frustumCulled = false;
    this.object.renderOrder = -1;
    this.object.scale.setScalar(0);
  }

  recolor(color: Color): void {
    this.#material.uniforms["color"] = { value: color };
  }

  /** Centre on the ground (m), spacing of the lines (m), and how far they reach (m). */
  place(centre: Vector3, spacing: number, radius: number): void {
    Object.assign(this.#material.uniforms, {
      centre: { value: centre },
      spacing: { value: spacing },
      radius: { value: radius },
    });
    this.object.position.copy(centre);
    this.object.scale.setScalar(radius);
  }

  dispose(): void {
    this.object.geometry.dispose();
    this.#material.dispose();
  }
}
