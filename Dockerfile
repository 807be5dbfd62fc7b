# The core of Errand: `docker build -t errand .`, then as `errand run`:
#   docker run --rm --user "$(id -u)" -v "$PWD/out:/work/out" errand --say "fetch me a drink"
FROM debian:12-slim

# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install -y --no-install-recommends \
        python3 python3-venv libegl1 libgl1 libgl1-mesa-dri libglib2.0-0 libsm6 libx11-6 \
    && rm -rf /var/lib/apt/lists/*

WORKDIR /opt/errand
COPY . .
RUN python3 -m venv /opt/venv \
    && /opt/venv/bin/pip install --no-cache-dir --constraint constraints.txt '.[visuals]' \
    && /opt/venv/bin/python /opt/errand/docs/file_schemas.py

# Any user may run it: compiled code and runs are written where all may write.
ENV PATH=/opt/venv/bin:$PATH NUMBA_CACHE_DIR=/var/cache/errand HOME=/work
WORKDIR /work
RUN mkdir -p /var/cache/errand \
    && errand warm-up \
    && chmod -R a+rwX /var/cache/errand /work

ENTRYPOINT ["errand", "run"]
CMD ["fetch_drink"]
