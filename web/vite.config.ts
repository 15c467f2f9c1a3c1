import { fileURLToPath } from "node:url";
import { svelte } from "@sveltejs/vite-plugin-svelte";
import { defineConfig } from "vitest/config";

const server = process.env.TRACEMESH_SERVER ?? "http://127.0.0.1:8000";

export default defineConfig({
  plugins: [svelte()],
  build: {
    outDir: fileURLToPath(new URL("../server/tracemesh/web", import.meta.url)),
    emptyOutDir: true,
    target: "es2022",
    rolldownOptions: { input: ["index.html", "scan.html"].map((name) => fileURLToPath(new URL(name, import.meta.url))) },
    chunkSizeWarningLimit: 900,
  },
  server: { proxy: { "/api": { target: server, ws: true } } },
  test: { include: ["src/**/*.test.ts"], environment: "node" },
});
