import { type BufferGeometry, Matrix4, Mesh } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { symmetricRange } from "../geometry/colormaps";
import type { Field, FieldName } from "../state/fields";

export interface LoadedSurface {
  /** z up, m, with normals. */
  readonly geometry: BufferGeometry;
  readonly triangles: number;
  /** Curvatures of the vertices, as far as the file has them. */
  readonly fields: Partial<Record<FieldName, Field>>;
}

const FROM_Y_UP = new Matrix4().makeRotationX(Math.PI / 2);

/** Fetch a GLB and turn its (only) triangle mesh from glTF's y-up into our z-up world. */
export async function loadSurface(url: string): Promise<LoadedSurface> {
  const scene = (await new GLTFLoader().loadAsync(url)).scene;
  scene.updateMatrixWorld(true);
  let mesh: Mesh<BufferGeometry> | undefined;
  scene.traverse((object) => {
    if (object instanceof Mesh) mesh ??= object as Mesh<BufferGeometry>;
  });
  if (!mesh) throw new Error("The file holds no surface.");
  const geometry = mesh.geometry.clone().applyMatrix4(mesh.matrixWorld).applyMatrix4(FROM_Y_UP);
  if (!geometry.hasAttribute("normal")) geometry.computeVertexNormals();
  const vertices = geometry.getAttribute("position").count;
  return {
    geometry,
    triangles: (geometry.getIndex()?.count ?? vertices) / 3,
    fields: { ...field("mean", geometry), ...field("gaussian", geometry) },
  };
}

function field(name: "mean" | "gaussian", geometry: BufferGeometry): Partial<Record<FieldName, Field>> {
  const attribute = `_${name}_curvature`;
  if (!geometry.hasAttribute(attribute)) return {};
  const values = Float32Array.from(geometry.getAttribute(attribute).array);
  return { [name]: { values, range: symmetricRange(values) } };
}
