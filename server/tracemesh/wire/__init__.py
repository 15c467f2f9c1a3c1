"""Every message between device, server and browser. Imports nothing else of tracemesh.

`device`: what a device sends while it scans and what the server answers. `live`: what a browser receives while it
watches. `resources`: the bodies of the REST API. The browser's TypeScript types are generated from these models.
"""
