import {
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
import { lookNamed, type LookName } from "./looks";
import type { Palette } from "./palette";

const vertexShader = /* glsl */ `
  attribute float curvature;
  uniform float range;
  varying vec3 eyeNormal;
  varying vec3 eyePosition;
  varying float value;
  void main() {
    vec4 eye = modelViewMatrix * vec4(position, 1.0);
    eyeNormal = normalMatrix * normal;
    eyePosition = eye.xyz;
    value = curvature / range;
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

  constructor(geometry: BufferGeometry, curvatureRange: number, palette: Palette, look: LookName) {
    const colors = new DataTexture(sample(diverging, 256), 256, 1);
    colors.colorSpace = SRGBColorSpace;
    colors.magFilter = colors.minFilter = LinearFilter;
    colors.needsUpdate = true;
    const material = new ShaderMaterial({
      vertexShader,
      fragmentShader: fragment(look),
      side: DoubleSide,
      transparent: true,
      polygonOffset: true,
      polygonOffsetFactor: 2,
      polygonOffsetUnits: 8,
      uniforms: {
        base: { value: palette.surface },
        inside: { value: palette.inside },
        map: { value: colors },
        range: { value: curvatureRange },
        opacity: { value: 1 },
      },
    });
    this.object = new Mesh(geometry, material);
  }

  set look(name: LookName) {
    this.object.material.fragmentShader = fragment(name);
    this.object.material.needsUpdate = true;
  }

  /** 0 is not there, 1 is solid. */
  set opacity(value: number) {
    this.#uniform("opacity").value = value;
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
