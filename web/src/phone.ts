import { mount } from "svelte";
import "./app.css";
import PhonePage from "./panels/phone/PhonePage.svelte";
import { Api } from "./protocol/api";
import { PhoneStore } from "./state/phone.svelte";
import { ViewStore } from "./state/view.svelte";

const target = document.getElementById("app");
if (!target) throw new Error("The page has no #app element.");
new ViewStore(document.documentElement, localStorage, (query) => matchMedia(query).matches);
const session = location.hash.slice(1);

mount(PhonePage, { target, props: { store: new PhoneStore(new Api(), session, window) } });
