# The program in a container. NOT BUILT WHERE revisit IS TESTED (no container runtime there): the same commands are run
# on a bare Debian 12 by `make deb` and its test; say so if a line here fails.
#   docker build -t revisit .
#   docker run --rm -v "$PWD":/data -w /data revisit detect drive.bag --out results
#   docker run --rm -v "$PWD":/data -w /data -p 8137:8137 revisit view map --host 0.0.0.0
FROM debian:12 AS build
COPY . /revisit
RUN apt-get update -qq && apt-get install -y -qq --no-install-recommends make ca-certificates && make -C /revisit deb

FROM debian:12-slim
LABEL org.opencontainers.image.title="revisit" org.opencontainers.image.licenses="Apache-2.0"
COPY --from=build /revisit/out/deb/revisit_*.deb /tmp/
RUN apt-get update -qq && apt-get install -y -qq --no-install-recommends /tmp/revisit_*.deb && rm -rf /tmp/*.deb /var/lib/apt/lists/*
ENTRYPOINT ["/usr/bin/revisit"]
