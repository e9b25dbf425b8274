// hgm-cgal-mesher: label fields on stdin, conforming labelled tetrahedra on stdout, by CGAL's Mesh_3.
// SPDX-License-Identifier: GPL-3.0-or-later  (CGAL's Mesh_3 package is GPL; see README.md beside this file)
//
// Input (little endian):  "HGMFLD01"
//   u32 nx ny nz K          voxels and number of fields; field 0 is the outside
//   f64 spacing[3]          mm; the domain is a box with voxel (0,0,0) at the origin
//   f64 facet_angle_deg, facet_size, facet_distance, radius_edge_ratio, cell_size   sizes as multiples of the edge field
//   u32 sx sy sz, f64 sizing_spacing[3], f32 edge_mm[sx*sy*sz]     target edge length, trilinear, x fastest
//   u32 seeds, f64 xyz[3*seeds]                                    points on interfaces (every component has some)
//   f32 value[nx*ny*nz*K]   fields, the K values of a voxel together, x fastest
// Output: "HGMTET02", u32 nodes, u32 tets, f64 xyz[3*nodes], u32 corner[4*tets], u8 field[tets]
//   Tets of field 0 are the layer outside that touches the mesh.
// The label of a point is the field with the largest trilinear value. Fixed seed, no time limit: same bytes each run.

#define CGAL_MESH_3_NO_DEPRECATED_SURFACE_INDEX
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Labeled_mesh_domain_3.h>
#include <CGAL/Mesh_complex_3_in_triangulation_3.h>
#include <CGAL/Mesh_criteria_3.h>
#include <CGAL/Mesh_triangulation_3.h>
#include <CGAL/make_mesh_3.h>
#include <CGAL/refine_mesh_3.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <exception>
#include <stdexcept>
#include <unordered_map>
#include <vector>

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using FT = Kernel::FT;
using Point = Kernel::Point_3;
using Domain = CGAL::Labeled_mesh_domain_3<Kernel>;
using Tr = CGAL::Mesh_triangulation_3<Domain, CGAL::Default, CGAL::Sequential_tag>::type;
using C3t3 = CGAL::Mesh_complex_3_in_triangulation_3<Tr>;
using Criteria = CGAL::Mesh_criteria_3<Tr>;

namespace {

void take(void* into, std::size_t bytes) {
  if (std::fread(into, 1, bytes, stdin) != bytes) throw std::runtime_error("input ends too early");
}
template <class T> T take() { T value; take(&value, sizeof value); return value; }

void put(const void* from, std::size_t bytes) {
  if (std::fwrite(from, 1, bytes, stdout) != bytes) throw std::runtime_error("output cannot be written");
}
template <class T> void put(T value) { put(&value, sizeof value); }

struct Fields {
  int n[3] = {}, count = 0;
  double spacing[3] = {};
  std::vector<float> value;
  std::vector<std::uint8_t> largest;

  void read() {
    std::size_t voxels = 1;
    for (int& d : n) voxels *= d = static_cast<int>(take<std::uint32_t>());
    count = static_cast<int>(take<std::uint32_t>());
    take(spacing, sizeof spacing);
    if (count < 2 || count > 64 || voxels < 8 || voxels > (std::size_t{1} << 31)) throw std::runtime_error("field dimensions are out of range");
  }
  void read_values() {
    const std::size_t voxels = std::size_t(n[0]) * n[1] * n[2];
    value.resize(voxels * count);
    take(value.data(), value.size() * sizeof(float));
    largest.resize(voxels);
    for (std::size_t v = 0; v < voxels; ++v) {
      const float* f = &value[v * count];
      largest[v] = static_cast<std::uint8_t>(std::max_element(f, f + count) - f);
    }
  }
  int label(const Point& p) const {
    int base[3];
    double w[3];
    for (int a = 0; a < 3; ++a) {
      const double x = p[a] / spacing[a];
      if (!(x >= 0 && x < n[a] - 1)) return 0;
      base[a] = static_cast<int>(x);
      w[a] = x - base[a];
    }
    const std::size_t sx = 1, sy = n[0], sz = std::size_t(n[0]) * n[1], o = base[0] + sy * base[1] + sz * base[2];
    const std::size_t corner[8] = {o, o + sx, o + sy, o + sx + sy, o + sz, o + sx + sz, o + sy + sz, o + sx + sy + sz};
    const std::uint8_t first = largest[o];
    bool same = true;
    for (int c = 1; c < 8; ++c) same = same && largest[corner[c]] == first;
    if (same) return first;  // a trilinear blend of fields that agree on the largest agrees too
    const double weight[8] = {(1 - w[0]) * (1 - w[1]) * (1 - w[2]), w[0] * (1 - w[1]) * (1 - w[2]), (1 - w[0]) * w[1] * (1 - w[2]),
                              w[0] * w[1] * (1 - w[2]), (1 - w[0]) * (1 - w[1]) * w[2], w[0] * (1 - w[1]) * w[2],
                              (1 - w[0]) * w[1] * w[2], w[0] * w[1] * w[2]};
    int best = 0;
    double best_value = -1e30;
    for (int k = 0; k < count; ++k) {
      double sum = 0;
      for (int c = 0; c < 8; ++c) sum += weight[c] * value[corner[c] * count + k];
      if (sum > best_value) { best_value = sum; best = k; }
    }
    return best;
  }
};

struct EdgeField {
  int n[3] = {};
  double spacing[3] = {};
  std::vector<float> edge_mm;
  void read() {
    std::size_t size = 1;
    for (int& d : n) size *= d = static_cast<int>(take<std::uint32_t>());
    take(spacing, sizeof spacing);
    if (size == 0 || size > (std::size_t{1} << 28)) throw std::runtime_error("sizing grid is out of range");
    edge_mm.resize(size);
    take(edge_mm.data(), size * sizeof(float));
  }
  double at(const double p[3]) const {
    int base[3], step[3];
    double w[3];
    for (int a = 0; a < 3; ++a) {
      const double x = std::clamp(p[a] / spacing[a], 0.0, n[a] - 1.0);
      base[a] = std::min(static_cast<int>(x), std::max(0, n[a] - 2));
      w[a] = x - base[a];
      step[a] = n[a] > 1 ? 1 : 0;
    }
    double sum = 0;
    for (int c = 0; c < 8; ++c) {
      const int i = base[0] + (c & 1) * step[0], j = base[1] + (c >> 1 & 1) * step[1], k = base[2] + (c >> 2) * step[2];
      sum += (c & 1 ? w[0] : 1 - w[0]) * (c & 2 ? w[1] : 1 - w[1]) * (c & 4 ? w[2] : 1 - w[2]) *
             edge_mm[i + std::size_t(n[0]) * (j + std::size_t(n[1]) * k)];
    }
    return sum;
  }
};

// Mesh_criteria_3 calls a sizing field with (point, dimension, index).
struct Scaled {
  using FT = Kernel::FT;
  using Index = Domain::Index;
  const EdgeField* field;
  double factor;
  template <class P, class I> FT operator()(const P& p, int, const I&) const {
    const double x[3] = {CGAL::to_double(p.x()), CGAL::to_double(p.y()), CGAL::to_double(p.z())};
    return factor * field->at(x);
  }
};

void mesh() {
  char magic[8];
  take(magic, 8);
  if (std::memcmp(magic, "HGMFLD01", 8) != 0) throw std::runtime_error("this is not a label-field stream");
  Fields fields;
  fields.read();
  const double facet_angle = take<double>(), facet_size = take<double>(), facet_distance = take<double>(),
               radius_edge = take<double>(), cell_size = take<double>();
  EdgeField edge;
  edge.read();
  std::vector<Point> seeds(take<std::uint32_t>());
  for (Point& p : seeds) {
    double x[3];
    take(x, sizeof x);
    p = Point(x[0], x[1], x[2]);
  }
  fields.read_values();

  const double far_corner[3] = {(fields.n[0] - 1) * fields.spacing[0], (fields.n[1] - 1) * fields.spacing[1], (fields.n[2] - 1) * fields.spacing[2]};
  CGAL::get_default_random() = CGAL::Random(0);
  CGAL::Random random(0);
  Domain domain([&fields](const Point& p) { return fields.label(p); },
                CGAL::Bbox_3(0, 0, 0, far_corner[0], far_corner[1], far_corner[2]),
                CGAL::parameters::relative_error_bound = 2e-4, CGAL::parameters::p_rng = &random);

  C3t3 c3t3;
  const Domain::Index on_surface = domain.index_from_surface_patch_index(Domain::Surface_patch_index(0, 1));
  // Eight points far outside, so that the mesh lies within tets on all sides.
  for (int n = 0; n < 8; ++n) {
    double x[3];
    for (int a = 0; a < 3; ++a) x[a] = (n >> a & 1 ? 2.0 : -1.0) * far_corner[a];
    const auto v = c3t3.triangulation().insert(Tr::Weighted_point(Point(x[0], x[1], x[2])));
    c3t3.set_dimension(v, 3);
    c3t3.set_index(v, domain.index_from_subdomain_index(0));
  }
  for (const Point& p : seeds) {
    const auto v = c3t3.triangulation().insert(Tr::Weighted_point(p));
    if (v == Tr::Vertex_handle()) continue;
    c3t3.set_dimension(v, 2);
    c3t3.set_index(v, on_surface);
  }
  Criteria criteria(CGAL::parameters::facet_angle = facet_angle, CGAL::parameters::facet_size = Scaled{&edge, facet_size},
                    CGAL::parameters::facet_distance = Scaled{&edge, facet_distance},
                    CGAL::parameters::cell_radius_edge_ratio = radius_edge,
                    CGAL::parameters::cell_size = Scaled{&edge, cell_size});
  using namespace CGAL::parameters;
  CGAL::refine_mesh_3(c3t3, domain, criteria, no_reset_c3t3(), no_lloyd(), no_odt(), no_perturb(), no_exude());

  // Nodes in the triangulation's insertion order; cells in its iteration order: both repeat from run to run.
  std::unordered_map<Tr::Vertex_handle, std::uint32_t> number;
  std::vector<double> xyz;
  std::vector<std::uint32_t> corner;
  std::vector<std::uint8_t> field;
  const auto emit = [&](Tr::Cell_handle cell, std::uint8_t label) {
    for (int c = 0; c < 4; ++c) {
      const auto v = cell->vertex(c);
      const auto [at, fresh] = number.try_emplace(v, static_cast<std::uint32_t>(number.size()));
      if (fresh)
        for (int a = 0; a < 3; ++a) xyz.push_back(CGAL::to_double(v->point().point()[a]));
      corner.push_back(at->second);
    }
    field.push_back(label);
  };
  for (auto cell = c3t3.cells_in_complex_begin(); cell != c3t3.cells_in_complex_end(); ++cell)
    emit(cell, static_cast<std::uint8_t>(c3t3.subdomain_index(cell)));
  const std::uint32_t inner = static_cast<std::uint32_t>(number.size());
  const Tr& tr = c3t3.triangulation();
  for (auto cell = tr.finite_cells_begin(); cell != tr.finite_cells_end(); ++cell) {
    if (c3t3.is_in_complex(cell)) continue;
    bool touches = false;
    for (int c = 0; c < 4; ++c) {
      const auto at = number.find(cell->vertex(c));
      touches = touches || (at != number.end() && at->second < inner);
    }
    if (touches) emit(cell, 0);
  }
  put("HGMTET02", 8);
  put(static_cast<std::uint32_t>(number.size()));
  put(static_cast<std::uint32_t>(field.size()));
  put(xyz.data(), xyz.size() * sizeof(double));
  put(corner.data(), corner.size() * sizeof(std::uint32_t));
  put(field.data(), field.size());
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc > 1 && std::strcmp(argv[1], "--version") == 0) {
    std::printf("hgm-cgal-mesher 1 (CGAL %s)\n", CGAL_VERSION_STR);
    return 0;
  }
  try {
    mesh();
  } catch (const std::exception& e) {
    std::fprintf(stderr, "hgm-cgal-mesher: %s\n", e.what());
    return 1;
  }
  return 0;
}
