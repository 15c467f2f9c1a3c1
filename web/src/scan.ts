import { mount } from "svelte";
import "./app.css";
import ScanPage from "./panels/scan/ScanPage.svelte";
import { Api } from "./protocol/api";
import { ScanStore } from "./state/scan.svelte";
import { ViewStore } from "./state/view.svelte";

const target = document.getElementById("app");
if (!target) throw new Error("The page has no #app element.");
new ViewStore(document.documentElement, localStorage, (query) => matchMedia(query).matches);
const session = location.hash.slice(1);

mount(ScanPage, { target, props: { store: new ScanStore(new Api(), session, window) } });
