import {
  BufferAttribute,
  type BufferGeometry,
  type Color,
  DataTexture,
  DoubleSide,
  LinearFilter,
  Mesh,
  ShaderMaterial,
  SRGBColorSpace,
} from "three";
import { diverging, sample } from "../geometry/colormaps";
import type { Field } from "../state/fields";
import { lookNamed, type LookName } from "./looks";
import type { Palette } from "./palette";

const vertexShader = /* glsl */ `
  attribute float scalar;
  uniform float range;
  varying vec3 eyeNormal;
  varying vec3 eyePosition;
  varying float value;
  void main() {
    vec4 eye = modelViewMatrix * vec4(position, 1.0);
    eyeNormal = normalMatrix * normal;
    eyePosition = eye.xyz;
    value = scalar / range;
    gl_Position = projectionMatrix * eye;
  }`;

const before = /* glsl */ `
  uniform vec3 base;
  uniform vec3 inside;
  uniform sampler2D map;
  uniform float opacity;
  varying vec3 eyeNormal;
  varying vec3 eyePosition;
  varying float value;`;

const after = /* glsl */ `
  void main() {
    vec3 n = normalize(eyeNormal) * (gl_FrontFacing ? 1.0 : -1.0);
    vec3 color = look(n, normalize(-eyePosition));
    gl_FragColor = vec4(gl_FrontFacing ? color : mix(color, inside, 0.55), opacity);
    #include <colorspace_fragment>
  }`;

/** The reconstructed surface with one material whose look changes. */
export class SurfaceLayer {
  readonly object: Mesh<BufferGeometry, ShaderMaterial>;

  constructor(geometry: BufferGeometry, palette: Palette, look: LookName) {
    const colors = new DataTexture(sample(diverging, 256), 256, 1);
    colors.colorSpace = SRGBColorSpace;
    colors.magFilter = colors.minFilter = LinearFilter;
    colors.needsUpdate = true;
    const material = new ShaderMaterial({
      vertexShader,
      fragmentShader: fragment(look),
      side: DoubleSide,
      forceSinglePass: true,
      polygonOffset: true,
      polygonOffsetFactor: 2,
      polygonOffsetUnits: 8,
      uniforms: {
        base: { value: palette.surface },
        inside: { value: palette.inside },
        map: { value: colors },
        range: { value: 1 },
        opacity: { value: 1 },
      },
    });
    this.object = new Mesh(geometry, material);
    this.field = undefined;
  }

  /** The values that looks with a scale show. */
  set field(field: Field | undefined) {
    const { geometry } = this.object;
    const values = field?.values ?? new Float32Array(geometry.getAttribute("position").count);
    geometry.setAttribute("scalar", new BufferAttribute(values, 1));
    this.#uniform("range").value = field?.range ?? 1;
  }

  set look(name: LookName) {
    this.object.material.fragmentShader = fragment(name);
    this.object.material.needsUpdate = true;
  }

  /** 0 is not there, 1 is solid. */
  set opacity(value: number) {
    this.#uniform("opacity").value = value;
    this.object.material.transparent = value < 1;
    this.object.material.depthWrite = value > 0.5;
  }

  recolor(palette: Palette): void {
    this.#uniform("base").value = palette.surface;
    this.#uniform("inside").value = palette.inside;
  }

  dispose(): void {
    (this.#uniform("map").value as DataTexture).dispose();
    this.object.geometry.dispose();
    this.object.material.dispose();
  }

  #uniform(name: string): { value: Color | DataTexture | number } {
    return this.object.material.uniforms[name] as { value: Color | DataTexture | number };
  }
}

function fragment(look: LookName): string {
  return before + lookNamed(look).chunk + after;
}
