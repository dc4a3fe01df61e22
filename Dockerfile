# docker build -t bayesindent . && docker run --rm -v "$PWD:/work" bayesindent run FILE.nml
FROM debian:bookworm-slim AS build
RUN apt-get update && apt-get install --yes --no-install-recommends \
    g++ gfortran libopenblas-dev liblapack-dev libsqlite3-dev libsuitesparse-dev pkg-config python3-dev python3-venv
COPY . /source
RUN python3 -m venv /opt/bayesindent && /opt/bayesindent/bin/pip install --no-cache-dir /source

FROM debian:bookworm-slim
RUN apt-get update && apt-get install --yes --no-install-recommends \
    libcholmod3 libgfortran5 libgomp1 libopenblas0 libsqlite3-0 python3 && rm -rf /var/lib/apt/lists/*
COPY --from=build /opt/bayesindent /opt/bayesindent
WORKDIR /work
ENTRYPOINT ["/opt/bayesindent/bin/bayesindent"]
