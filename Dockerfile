# Not yet built: written where no Docker was at hand; its pip line is what `scripts/release` tries without extras.
# evplace on a CPU, without torch:  docker build -t evplace .
#   docker run --rm -v "$PWD:/data" evplace demo --quick
#   docker run --rm -v "$PWD:/data" -p 8000:8000 -e EVPLACE_TOKEN evplace serve --map campus.evp --source night.aedat4 --host 0.0.0.0
FROM python:3.12-slim AS build
WORKDIR /src
COPY pyproject.toml setup.py README.md LICENSE ./
COPY src src
RUN python -m venv /opt/evplace && /opt/evplace/bin/pip install --no-cache-dir '.[report,hdf5,parquet,video,web]' \
    && /opt/evplace/bin/python -m evplace_lab.cli.precompile

FROM python:3.12-slim
COPY --from=build /opt/evplace /opt/evplace
ENV PATH=/opt/evplace/bin:$PATH OPENBLAS_NUM_THREADS=1 NUMBA_CACHE_DIR=/tmp/numba MPLCONFIGDIR=/tmp/matplotlib
RUN useradd --create-home evplace
USER evplace
WORKDIR /data
ENTRYPOINT ["evplace"]
CMD ["--help"]
