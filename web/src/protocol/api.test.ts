import { expect, it } from "vitest";
import { Api, ApiProblem } from "./api";

function answering(body: unknown, status = 200) {
  const asked: [string, RequestInit | undefined][] = [];
  const fetcher = ((url: string, init?: RequestInit) => {
    asked.push([url, init]);
    return Promise.resolve(new Response(status === 204 ? null : JSON.stringify(body), { status, statusText: "Nope" }));
  }) as typeof fetch;
  return { api: new Api("/api/v1", fetcher), asked };
}

it("sends JSON and reads JSON", async () => {
  const { api, asked } = answering({ id: "a" });
  expect(await api.createSession("Vase")).toEqual({ id: "a" });
  const [url, init] = asked[0] ?? [];
  expect(url).toBe("/api/v1/sessions");
  expect(init).toMatchObject({ method: "POST", body: '{"name":"Vase"}', headers: { "content-type": "application/json" } });
});

it("turns problem details into an error in the server's words", async () => {
  const { api } = answering({ title: "Not found", status: 404, detail: "No session is called x." }, 404);
  await expect(api.session("x")).rejects.toEqual(new ApiProblem(404, "Not found", "No session is called x."));
  await expect(api.session("x")).rejects.toThrow("No session is called x.");
});

it("says status and reason when an answer is no problem document", async () => {
  const api = new Api("", () => Promise.resolve(new Response("<html>", { status: 502, statusText: "Bad Gateway" })));
  await expect(api.sessions()).rejects.toThrow("502 Bad Gateway");
});

it("needs no body in the answer to a deletion", async () => {
  await expect(answering(null, 204).api.deleteSession("a")).resolves.toBeUndefined();
});

it("follows a list from page to page", async () => {
  const pages = new Map([
    ["/api/v1/sessions/a/curves?limit=500", '</api/v1/sessions/a/curves?limit=500&after=1>; rel="next"'],
    ["/api/v1/sessions/a/curves?limit=500&after=1", undefined],
  ]);
  const fetcher = ((url: string) => {
    const link = pages.get(url);
    return Promise.resolve(new Response(JSON.stringify([{ index: url.length }]), { headers: link ? { link } : {} }));
  }) as typeof fetch;
  const found = await new Api("/api/v1", fetcher).curves("a");
  expect(found.map((curve) => curve.index)).toEqual([...pages.keys()].map((url) => url.length));
});
