/** Values at the vertices of a surface, shown as colours from blue over white to orange. */

export type FieldName = "mean" | "gaussian" | "distance";

export interface Field {
  readonly values: Float32Array;
  /** The colours go from minus this to plus this. */
  readonly range: number;
}

export const FIELD_TITLES: Readonly<Record<FieldName, { readonly title: string; readonly unit: string }>> = {
  mean: { title: "Mean curvature", unit: "1/m" },
  gaussian: { title: "Gaussian curvature", unit: "1/m²" },
  distance: { title: "Distance to truth", unit: "mm" },
};
