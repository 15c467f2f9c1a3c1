import { Mesh, type Object3D } from "three";
import { OBJExporter } from "three/addons/exporters/OBJExporter.js";
import { PLYExporter } from "three/addons/exporters/PLYExporter.js";
import { STLExporter } from "three/addons/exporters/STLExporter.js";
import { loadSurface } from "./glb";

export type MeshFormat = "obj" | "ply" | "stl";

/** The surface of a GLB as another program's file; m, z up, as every file but GLB has it. */
export async function exportSurface(url: string, format: MeshFormat): Promise<Blob> {
  const { geometry } = await loadSurface(url);
  for (const name of Object.keys(geometry.attributes)) {
    if (name !== "position" && name !== "normal") geometry.deleteAttribute(name);
  }
  return new Blob([WRITERS[format](new Mesh(geometry))]);
}

const WRITERS: Readonly<Record<MeshFormat, (mesh: Object3D) => BlobPart>> = {
  obj: (mesh) => new OBJExporter().parse(mesh),
  ply: (mesh) => new PLYExporter().parse(mesh, () => undefined, { binary: true, littleEndian: true }) ?? "",
  stl: (mesh) => new STLExporter().parse(mesh, { binary: true }),
};
