# The programs without a compiler around them: `docker build -t tg .`, then
# `docker run --rm --user "$(id -u):$(id -g)" -v "$PWD":/data tg tgtrain DATASET -o model.tgz`. Not tried yet.
FROM debian:12 AS build
WORKDIR /source
COPY scripts/install_packages.sh scripts/
RUN scripts/install_packages.sh build
COPY . .
RUN cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release -DTG_TESTS=OFF -DTG_BENCH=OFF \
  && cmake --build build && cmake --install build --prefix /usr/local --strip
# The packages that hold the programs' shared libraries; what dpkg does not find by its name is part of the base system.
RUN ldd /usr/local/bin/tg* | awk '$3 ~ /^\// {print $3}' | sort -u | xargs realpath | xargs dpkg -S 2>/dev/null \
  | cut -d: -f1 | sort -u > /usr/local/runtime_packages; test -s /usr/local/runtime_packages

FROM debian:12-slim
COPY --from=build /usr/local /usr/local
# The drivers are opened by name: Mesa's, on the CPU where the container is given no GPU. colmap and ffmpeg are
# for tgtrain photos.
RUN apt-get update -qq \
  && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $(cat /usr/local/runtime_packages) \
    libglfw3 libfontconfig1 libvulkan1 mesa-vulkan-drivers libegl1 libgl1-mesa-dri colmap ffmpeg \
  && rm -rf /var/lib/apt/lists/* && tgtrain --version && tgeval --version && tgconvert --version && tgview --version
WORKDIR /data
CMD ["tgview", "--help"]
