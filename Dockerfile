# The server with its web app. Data lives in /data, everything else may be read-only.
FROM node:20-bookworm-slim AS web
WORKDIR /src/web
COPY web/package.json web/package-lock.json ./
RUN npm ci --no-fund --no-audit
COPY web ./
RUN npm run build

FROM python:3.12-slim-bookworm AS build
WORKDIR /src
COPY pyproject.toml README.md LICENSE CHANGELOG.md ./
COPY server server
COPY device_bridge device_bridge
COPY --from=web /src/server/tracemesh/web server/tracemesh/web
RUN python -m venv /opt/tracemesh && /opt/tracemesh/bin/pip install --no-cache-dir '.[cluster,postgres,s3]'

FROM python:3.12-slim-bookworm
RUN install --directory --owner=10001 --group=10001 /data
COPY --from=build /opt/tracemesh /opt/tracemesh
ENV TRACEMESH_HOST=0.0.0.0 TRACEMESH_DATA_DIR=/data OPENBLAS_NUM_THREADS=1
USER 10001:10001
VOLUME /data
EXPOSE 8000
HEALTHCHECK --interval=10s --timeout=3s --start-period=20s \
  CMD ["/opt/tracemesh/bin/python", "-c", "import urllib.request; urllib.request.urlopen('http://127.0.0.1:8000/healthz', timeout=2)"]
CMD ["/opt/tracemesh/bin/tracemesh", "serve"]
