import { expect, it } from "vitest";
import { parseRoute } from "./route.svelte";

it("finds the session in an address and takes anything else for the list", () => {
  expect(parseRoute("#/sessions/demo-1")).toEqual({ page: "session", id: "demo-1" });
  for (const other of ["", "#/", "#/sessions/", "#/sessions/a/b", "#/sessions/%2e%2e", "#/other"]) {
    expect(parseRoute(other)).toEqual({ page: "sessions" });
  }
});
