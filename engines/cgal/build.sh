#!/usr/bin/env bash
# Builds hgm-cgal-mesher against Debian's libcgal-dev: engines/cgal/build.sh OUTDIR
set -euo pipefail
source_dir=$(cd "$(dirname "$0")" && pwd)
out=${1:?usage: build.sh OUTDIR}
mkdir -p "$out"
if [ -x "$out/hgm-cgal-mesher" ] && [ "$out/hgm-cgal-mesher" -nt "$source_dir/hgm-cgal-mesher.cpp" ] && [ "$out/hgm-cgal-mesher" -nt "$source_dir/build.sh" ]; then
  exit 0
fi
# -frounding-math: CGAL's interval arithmetic needs it. -ffp-contract=off: the same bytes on every x86-64 machine.
"${CXX:-g++}" -std=c++17 -O2 -DNDEBUG -frounding-math -ffp-contract=off -o "$out/hgm-cgal-mesher.part" \
  "$source_dir/hgm-cgal-mesher.cpp" -lmpfr -lgmp
mv "$out/hgm-cgal-mesher.part" "$out/hgm-cgal-mesher"
