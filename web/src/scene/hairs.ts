import { BufferAttribute, BufferGeometry, type Color, LineBasicMaterial, LineSegments } from "three";

/** Thin straight lines that stand on points: normals, or the spikes of a porcupine plot. */
export class HairsLayer {
  readonly #material = new LineBasicMaterial({ transparent: true, opacity: 0.75 });
  readonly object = new LineSegments(new BufferGeometry(), this.#material);

  constructor(color: Color) {
    this.recolor(color);
    this.object.frustumCulled = false;
    this.object.visible = false;
  }

  /** A line from every point along its vector times `scale`; flat lists, m. */
  set(points: ArrayLike<number>, vectors: ArrayLike<number>, scale: number): void {
    const ends = new Float32Array(2 * points.length);
    for (let i = 0; i < points.length; i += 1) {
      const start = 6 * Math.floor(i / 3) + (i % 3);
      ends[start] = points[i] as number;
      ends[start + 3] = (points[i] as number) + scale * (vectors[i] as number);
    }
    this.object.geometry.dispose();
    this.object.geometry = new BufferGeometry().setAttribute("position", new BufferAttribute(ends, 3));
    this.object.visible = points.length > 0;
  }

  clear(): void {
    this.object.visible = false;
  }

  recolor(color: Color): void {
    this.#material.color.copy(color);
  }

  dispose(): void {
    this.object.geometry.dispose();
    this.#material.dispose();
  }
}
