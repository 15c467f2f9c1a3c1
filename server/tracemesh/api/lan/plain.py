"""Plain HTTP beside HTTPS: gives away the authority's certificate with help, and sends everybody else to HTTPS."""

import html
from collections.abc import Callable, Collection
from urllib.parse import quote, urlsplit

from cryptography.hazmat.primitives.serialization import Encoding
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.routing import Route

from tracemesh.api.lan.authority import Authority

CERTIFICATE = "/tracemesh-ca.crt"
PAGE = """<!doctype html><html lang="en"><meta charset="utf-8"><title>Trust this tracemesh</title>
<meta name="viewport" content="width=device-width">
<style>body {{ font: 17px/1.5 system-ui; max-width: 34em; margin: 2em auto; padding: 0 1em; color-scheme: light dark }}
a.big {{ display: inline-block; padding: .7em 1.2em; border-radius: .6em; background: #0b63ce; color: #fff }}
code {{ overflow-wrap: anywhere; font-size: 13px }} summary {{ font-weight: 600; margin-top: .8em }}</style>
<h1>Trust this tracemesh</h1>
<p>Phones give their sensors to secure pages only. Install the certificate of this server once; it is good for machines
of local networks only, never for sites of the internet.</p>
<p><a class="big" href="{certificate}">1. Get the certificate</a></p>
<details open><summary>iPhone, iPad</summary><ol><li>In Safari, allow the download of the profile.
<li>Settings &rarr; General &rarr; VPN &amp; Device Management &rarr; tracemesh &rarr; Install.
<li>Settings &rarr; General &rarr; About &rarr; Certificate Trust Settings: switch tracemesh on.</ol></details>
<details open><summary>Android</summary><ol><li>Settings &rarr; Security &rarr; More &rarr; Encryption and credentials
&rarr; Install a certificate &rarr; CA certificate; the names differ a little between makers.
<li>Choose the file <code>tracemesh-ca.crt</code> among the downloads.</ol></details>
<details><summary>Windows</summary><ol><li>Open the file, Install Certificate &rarr; Current User.
<li>Place it in: Trusted Root Certification Authorities.</ol></details>
<details><summary>macOS</summary><ol><li>Open the file: Keychain Access takes it.
<li>Open it there, Trust &rarr; Always Trust.</ol></details>
<details><summary>Linux, and Firefox everywhere</summary><p>Settings &rarr; Certificates &rarr; Authorities
&rarr; Import,
and trust it for websites. Programs: <code>SSL_CERT_FILE=tracemesh-ca.crt tracemesh-bridge ...</code></p></details>
<p>Its SHA-256 fingerprint, which the server also prints where it was started:<br><code>{fingerprint}</code></p>
<p><a class="big" href="{secure}">2. Go on to the secure page</a></p></html>"""


def plain_app(authority: Authority, names: Callable[[], Collection[str]], port: int) -> Starlette:
    """`names`: how this machine may be called, the best first; `port`: where HTTPS is."""

    def secure(request: Request) -> str:
        """The same machine as it was called, if that is one of its names: nobody is sent elsewhere."""
        known = list(names())
        try:
            asked = urlsplit(f"//{request.headers.get('host', '')}").hostname or ""
        except ValueError:
            asked = ""
        host = asked if asked in known else known[0]
        return f"https://{f'[{host}]' if ':' in host else host}:{port}"

    async def page(request: Request) -> Response:
        return HTMLResponse(
            PAGE.format(
                certificate=CERTIFICATE, fingerprint=authority.fingerprint, secure=html.escape(f"{secure(request)}/")
            )
        )

    async def certificate(request: Request) -> Response:
        content = authority.certificate.public_bytes(Encoding.DER)
        headers = {"Content-Disposition": 'attachment; filename="tracemesh-ca.crt"'}
        return Response(content, headers=headers, media_type="application/x-x509-ca-cert")

    async def elsewhere(request: Request) -> Response:
        """Without the query: what stood in it went over the network for all to read, and is better not used."""
        return RedirectResponse(secure(request) + "/" + quote(request.url.path).lstrip("/"), 308)

    methods = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"]
    routes = [
        Route("/", page),
        Route(CERTIFICATE, certificate),
        Route("/{rest:path}", elsewhere, methods=methods),
    ]
    return Starlette(routes=routes)
