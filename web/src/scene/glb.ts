import { BufferAttribute, type BufferGeometry, Matrix4, Mesh } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { symmetricRange } from "../geometry/colormaps";

export interface LoadedSurface {
  /** z up, m, with `normal` and `curvature` (mean curvature, 1/m) attributes. */
  readonly geometry: BufferGeometry;
  readonly triangles: number;
  /** The colour map of the curvature goes from minus this to plus this, 1/m. */
  readonly curvatureRange: number;
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
  const curvature = geometry.getAttribute("_mean_curvature") ?? new BufferAttribute(new Float32Array(vertices), 1);
  geometry.setAttribute("curvature", curvature);
  return {
    geometry,
    triangles: (geometry.getIndex()?.count ?? vertices) / 3,
    curvatureRange: symmetricRange(curvature.array),
  };
}
