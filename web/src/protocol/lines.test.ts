import { expect, it } from "vitest";
import { jsonLines } from "./lines";

it("puts lines together however they are cut, umlauts included", async () => {
  const bytes = new TextEncoder().encode('{"a":"ä"}\n{"a":2}\n');
  for (let cut = 0; cut <= bytes.length; cut += 1) {
    const body = new ReadableStream<Uint8Array<ArrayBuffer>>({
      start(controller) {
        controller.enqueue(bytes.slice(0, cut));
        controller.enqueue(bytes.slice(cut));
        controller.close();
      },
    });
    const found = [];
    for await (const line of jsonLines(new Response(body))) found.push(line);
    expect(found).toEqual([{ a: "ä" }, { a: 2 }]);
  }
});
