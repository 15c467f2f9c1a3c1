// Generate src/wire.gen.ts from the server's models. `node scripts/wire.mjs --check` only says whether it is stale.
import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { compile } from "json-schema-to-typescript";

const target = fileURLToPath(new URL("../src/wire.gen.ts", import.meta.url));
const root = fileURLToPath(new URL("../../", import.meta.url));
const python = process.env.PYTHON ?? `${root}.venv/bin/python`;

/** What the compiler needs: no alias per field, draft-7 tuples, and every field present, as the server sends it. */
function simplify(schema) {
  if (Array.isArray(schema)) return schema.map(simplify);
  if (schema === null || typeof schema !== "object") return schema;
  const { title: _title, prefixItems, minItems: _min, maxItems: _max, ...rest } = schema;
  const result = {};
  for (const [key, value] of Object.entries(rest)) {
    result[key] = key === "properties" ? simplifyEach(value) : simplify(value);
  }
  if (prefixItems) {
    Object.assign(result, { items: simplify(prefixItems), minItems: prefixItems.length, maxItems: prefixItems.length });
  }
  if (result.properties) result.required = Object.keys(result.properties);
  return result;
}

function simplifyEach(record) {
  return Object.fromEntries(Object.entries(record).map(([name, schema]) => [name, simplify(schema)]));
}

const schema = JSON.parse(execFileSync(python, ["-m", "tracemesh.wire.schema"], { encoding: "utf8", cwd: root }));
const document = { type: "object", additionalProperties: false, properties: {}, $defs: simplifyEach(schema.$defs) };
const text = await compile(document, "Wire", {
  additionalProperties: false,
  unreachableDefinitions: true,
  bannerComment: "/* Generated from the server's models by `npm run wire`; do not edit. */",
  style: { printWidth: 120 },
});
const wanted = text.replace(/export interface Wire \{\}\n/, "").replace(
  /\/\*\*\n \* This interface was referenced by `Wire`'s JSON-Schema\n \* via the `definition` "[A-Za-z]+"\.\n \*\/\n/g,
  "",
).replace(/\n \*\n \* This interface was referenced by `Wire`'s JSON-Schema\n \* via the `definition` "[A-Za-z]+"\./g, "");

if (process.argv.includes("--check")) {
  if (readFileSync(target, "utf8") !== wanted) {
    console.error("src/wire.gen.ts is stale: run `npm run wire`");
    process.exit(1);
  }
} else {
  writeFileSync(target, wanted);
}
