#!/usr/bin/env bash
# Makes what a release consists of: packaging/release.sh [OUT]     (OUT: target/release-VERSION)
#
#   hgm-VERSION-x86_64-linux      the program, linked statically: runs on any Linux on x86-64 with SSE4.2
#   hgm-VERSION-*.whl             the Python wheel
#   hgm-VERSION-containers.tar.gz recipes of the containers and the Boutiques descriptor
#   hgm-VERSION.cdx.json          what is inside and under which licence (CycloneDX)
#   SHA256SUMS                    checksums of all of them
#
# Static with the C library of the machine it is built on (glibc), not musl: another mathematical library rounds differently, and
# results would no longer be the same bytes as those of `./run demo`.
set -euo pipefail
cd "$(dirname "$0")/.."

say() { printf '\n== %s\n' "$*" >&2; }

version=$(sed -n 's/^version = "\(.*\)"$/\1/p' Cargo.toml | head -1)
out=${1:-target/release-$version}
target=x86_64-unknown-linux-gnu
if [ -n "$(git status --porcelain 2>/dev/null)" ] && [ -z "${HGM_RELEASE_UNCOMMITTED:-}" ]; then
  echo "There are changes that are not committed: commit them first, a release is what a commit says." >&2
  exit 1
fi
# Nothing is left of a release that broke off.
rm -rf "$out.part"
mkdir -p "$out.part"

say "static program"
# With --target the flag is the program's alone; procedural macros are libraries and cannot be static.
CARGO_TARGET_X86_64_UNKNOWN_LINUX_GNU_LINKER="$PWD/packaging/static-linker" RUSTFLAGS="-C target-cpu=x86-64-v2 -C target-feature=+crt-static" \
  cargo build --release --locked --bin hgm --target "$target"
program="$out.part/hgm-$version-x86_64-linux"
# Without its tables of names, which nobody who runs it needs.
strip -o "$program" "${CARGO_TARGET_DIR:-target}/$target/release/hgm"
# ldd is content with a static program that can be placed anywhere (static-pie); one that is not static names its libraries.
# Read whole before it is searched: a pipe that grep leaves early fails ldd now and then, and with it the search.
libraries=$(ldd "$program" 2>&1 || true)
if grep -q '=>' <<< "$libraries"; then
  printf '%s is not static:\n%s\n' "$program" "$libraries" >&2
  exit 1
fi
[ "$("$program" --version)" = "hgm $version" ] || {
  echo "$program does not say that it is hgm $version" >&2
  exit 1
}

if [ -f pyproject.toml ]; then
  say "wheel"
  python3 -m pip wheel --quiet --no-deps --wheel-dir "$out.part" .
fi

say "recipes of the containers"
# The same bytes from the same commit: no times, no owners, names in order.
tar --sort=name --mtime=@0 --owner=0 --group=0 --numeric-owner -cf - packaging .dockerignore | gzip -n \
  > "$out.part/hgm-$version-containers.tar.gz"

say "licences"
python3 packaging/sbom.py > "$out.part/hgm-$version.cdx.json"

say "checksums"
(cd "$out.part" && sha256sum -- * > ../sums.part && mv ../sums.part SHA256SUMS && sha256sum --check --quiet SHA256SUMS)
rm -rf "$out"
mv "$out.part" "$out"
ls -l "$out"
