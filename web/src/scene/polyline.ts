import {
  type Color,
  DynamicDrawUsage,
  GreaterDepth,
  Group,
  InstancedInterleavedBuffer,
  InterleavedBufferAttribute,
  Sphere,
} from "three";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";

const FLOATS_PER_SEGMENT = 6;
const GHOST_OPACITY = 0.22;
/** How much larger a full buffer becomes. */
const GROWTH = 1.25;

/** A wide line that grows at its end; what lies behind the surface shows through faintly. */
export class Polyline {
  readonly object = new Group();
  readonly #front = new LineMaterial({ transparent: true });
  readonly #ghost = new LineMaterial({
    transparent: true,
    depthFunc: GreaterDepth,
    depthWrite: false,
    opacity: GHOST_OPACITY,
  });
  #geometry = emptyGeometry(64);
  #capacity = 64;

  constructor() {
    this.#compose();
  }

  /** Width in px, colour and opacity. */
  style(width: number, color: Color, opacity = 1): void {
    for (const material of [this.#front, this.#ghost]) {
      material.linewidth = width;
      material.color.copy(color);
    }
    this.#front.opacity = opacity;
    this.#ghost.opacity = GHOST_OPACITY * opacity;
  }

  /** Draw these points, [x0, y0, z0, ...] m; those before `first` have not changed since the last call. */
  set(positions: Float32Array, first = 0): void {
    const segments = Math.max(positions.length / 3 - 1, 0);
    const start = segments > this.#capacity ? 0 : Math.max(first - 1, 0);
    if (segments > this.#capacity) this.#grow(segments);
    this.#write(positions, start, segments);
    this.#geometry.instanceCount = segments;
    this.object.visible = segments > 0;
  }

  dispose(): void {
    this.#geometry.dispose();
    this.#front.dispose();
    this.#ghost.dispose();
  }

  #write(positions: Float32Array, start: number, segments: number): void {
    const buffer = segmentBuffer(this.#geometry);
    const array = buffer.array as Float32Array;
    for (let from = 3 * start, to = FLOATS_PER_SEGMENT * start; from < 3 * segments; from += 3) {
      for (let k = 0; k < FLOATS_PER_SEGMENT; k += 1, to += 1) array[to] = positions[from + k] as number;
    }
    renew(buffer, FLOATS_PER_SEGMENT * start, FLOATS_PER_SEGMENT * Math.max(segments, start));
    buffer.needsUpdate = true;
  }

  #grow(segments: number): void {
    this.#geometry.dispose();
    this.#capacity = Math.max(segments, Math.ceil(GROWTH * this.#capacity));
    this.#geometry = emptyGeometry(this.#capacity);
    this.#compose();
  }

  #compose(): void {
    this.object.clear();
    const front = new LineSegments2(this.#geometry, this.#front);
    const ghost = new LineSegments2(this.#geometry, this.#ghost);
    front.renderOrder = 2;
    ghost.renderOrder = 1;
    this.object.add(ghost, front);
    for (const line of [front, ghost]) line.frustumCulled = false;
  }
}

function emptyGeometry(capacity: number): LineSegmentsGeometry {
  const geometry = new LineSegmentsGeometry();
  const buffer = new InstancedInterleavedBuffer(new Float32Array(FLOATS_PER_SEGMENT * capacity), FLOATS_PER_SEGMENT, 1);
  buffer.setUsage(DynamicDrawUsage);
  geometry.setAttribute("instanceStart", new InterleavedBufferAttribute(buffer, 3, 0));
  geometry.setAttribute("instanceEnd", new InterleavedBufferAttribute(buffer, 3, 3));
  geometry.boundingSphere = new Sphere();
  geometry.instanceCount = 0;
  return geometry;
}

/** Have floats of a buffer drawn anew, with those that still wait: in a hidden page nothing is drawn, and all wait. */
function renew(buffer: InstancedInterleavedBuffer, begin: number, end: number): void {
  const waiting = [...buffer.updateRanges];
  const first = Math.min(begin, ...waiting.map(({ start }) => start));
  const last = Math.max(end, ...waiting.map(({ start, count }) => start + count));
  buffer.clearUpdateRanges();
  buffer.addUpdateRange(first, last - first);
}

function segmentBuffer(geometry: LineSegmentsGeometry): InstancedInterleavedBuffer {
  return (geometry.getAttribute("instanceStart") as InterleavedBufferAttribute).data as InstancedInterleavedBuffer;
}
