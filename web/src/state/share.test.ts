import { expect, it } from "vitest";
import { linkFor } from "./share.svelte";

it("leads a viewer to the session and a phone to its scan page, the fragment outside the query", () => {
  const viewer = new URL(linkFor("viewer", "abc_-", "lamp", "https://10.0.0.1:8000"));
  expect([viewer.pathname, viewer.search, viewer.hash]).toEqual(["/", "?token=abc_-", "#/sessions/lamp"]);
  const phone = new URL(linkFor("device", "abc_-", "lamp", "https://10.0.0.1:8000"));
  expect([phone.pathname, phone.search, phone.hash]).toEqual(["/scan.html", "?token=abc_-", "#lamp"]);
});
