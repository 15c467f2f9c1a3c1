import { mount } from "svelte";
import "./app.css";
import App from "./App.svelte";
import { Api } from "./protocol/api";
import { Router } from "./state/route.svelte";
import { ViewStore } from "./state/view.svelte";

const target = document.getElementById("app");
if (!target) throw new Error("The page has no #app element.");

mount(App, {
  target,
  props: {
    api: new Api(),
    router: new Router(window),
    view: new ViewStore(document.documentElement, localStorage, (query) => matchMedia(query).matches),
  },
});
