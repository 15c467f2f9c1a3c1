import { expect, it } from "vitest";
import { isNetwork, nameFor } from "./files";

it("tells a network by its name or by what it says of itself", async () => {
  expect(await isNetwork(new File(["{}"], "vase.network.json"))).toBe(true);
  expect(await isNetwork(new File(['{"format": "tracemesh-network", "version": 1'], "vase"))).toBe(true);
  expect(await isNetwork(new File(["5\n0\n"], "vase.rawnet"))).toBe(false);
  expect(await isNetwork(new File(['{"type": "hello"}\n'], "vase.ndjson"))).toBe(false);
});

it("names a session after its file", () => {
  expect(["a.b.network.json", "scan.rawnet", "plain", ".hidden"].map(nameFor)).toEqual(["a.b", "scan", "plain", ".hidden"]);
});
