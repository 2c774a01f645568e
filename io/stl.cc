#include "io/stl.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <unordered_map>

#include "io/error.h"
#include "io/results.h"

namespace acopla::io {
namespace {

using geometry::Vec3;

constexpr std::size_t binary_header = 84;  // 80 bytes of comment, a 32-bit count
constexpr std::size_t binary_record = 50;  // normal, three vertices, two spare bytes

struct PointHash {
  std::size_t operator()(const std::array<double, 3>& p) const {
    std::uint64_t hash = 1469598103934665603ULL;
    for (const double value : p) hash = (hash ^ std::bit_cast<std::uint64_t>(value)) * 1099511628211ULL;
    return static_cast<std::size_t>(hash ^ (hash >> 29));
  }
};

// Gathers triangles, welds their vertices and drops the degenerate ones.
class Welder {
 public:
  explicit Welder(const std::string& path) : path_(path) {}

  void add(const std::array<Vec3, 3>& corners) {
    for (const auto& corner : corners)
      if (!corner.allFinite())
        throw UserError({path_, 0, 0}, fmt::format("triangle {} has a coordinate that is not a finite number. "
                                                   "Export the surface again.", count_ + 1));
    ++count_;
    const Vec3 a = corners[1] - corners[0], b = corners[2] - corners[0], c = corners[2] - corners[1];
    const double longest = std::sqrt(std::max({a.squaredNorm(), b.squaredNorm(), c.squaredNorm()}));
    if (!(a.cross(b).norm() > 1e-9 * longest * longest)) {
      ++mesh_.dropped;
      return;
    }
    std::array<std::uint32_t, 3> triangle;
    for (int k = 0; k < 3; ++k) triangle[static_cast<std::size_t>(k)] = index(corners[static_cast<std::size_t>(k)]);
    mesh_.triangles.push_back(triangle);
  }

  TriangleMesh finish() {
    if (mesh_.triangles.empty())
      throw UserError({path_, 0, 0}, fmt::format("no triangle is left: the file holds {}, all degenerate. "
                                                 "Export the surface again.", count_));
    return std::move(mesh_);
  }

 private:
  std::uint32_t index(const Vec3& point) {
    // + 0.0 turns -0 into 0, so that both weld.
    const auto [entry, added] = known_.try_emplace({point[0] + 0.0, point[1] + 0.0, point[2] + 0.0},
                                                   static_cast<std::uint32_t>(mesh_.points.size()));
    if (added) mesh_.points.push_back(point);
    return entry->second;
  }

  const std::string& path_;
  std::size_t count_ = 0;
  TriangleMesh mesh_;
  std::unordered_map<std::array<double, 3>, std::uint32_t, PointHash> known_;
};

TriangleMesh read_binary(const std::string& path, const std::string& bytes) {
  std::uint32_t count;
  std::memcpy(&count, bytes.data() + 80, 4);
  Welder welder(path);
  for (std::size_t k = 0; k < count; ++k) {
    std::array<float, 9> values;
    std::memcpy(values.data(), bytes.data() + binary_header + k * binary_record + 12, sizeof values);
    welder.add({Vec3(values[0], values[1], values[2]), Vec3(values[3], values[4], values[5]),
                Vec3(values[6], values[7], values[8])});
  }
  return welder.finish();
}

// Words of an ASCII file with their line numbers.
class Words {
 public:
  explicit Words(const std::string& text) : at_(text.data()), end_(text.data() + text.size()) {}
  bool next() {
    while (at_ < end_ && std::isspace(static_cast<unsigned char>(*at_))) line_ += *at_++ == '\n';
    begin_ = at_;
    while (at_ < end_ && !std::isspace(static_cast<unsigned char>(*at_))) ++at_;
    return begin_ < at_;
  }
  void skip_line() {
    while (at_ < end_ && *at_ != '\n') ++at_;
  }
  std::string_view word() const { return {begin_, static_cast<std::size_t>(at_ - begin_)}; }
  int line() const { return line_; }

 private:
  const char *at_, *end_, *begin_ = nullptr;
  int line_ = 1;
};

TriangleMesh read_ascii(const std::string& path, const std::string& text) {
  Words words(text);
  Welder welder(path);
  const auto fail = [&](const std::string& what) {
    throw UserError({path, words.line(), 1}, fmt::format("{}. The STL file is damaged or cut short; export it again.", what));
  };
  const auto expect = [&](std::string_view wanted) {
    if (!words.next() || words.word() != wanted) fail(fmt::format("expected \"{}\"", wanted));
  };
  const auto coordinate = [&] {
    if (!words.next()) fail("the file ends inside a triangle");
    auto word = words.word();
    if (word.starts_with('+')) word.remove_prefix(1);
    double value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc{} || end != word.data() + word.size()) fail(fmt::format("\"{}\" is not a number", words.word()));
    return value;
  };
  bool ended = false;
  while (words.next()) {
    if (words.word() == "solid" || words.word() == "endsolid") {
      ended = words.word() == "endsolid";
      words.skip_line();
      continue;
    }
    if (words.word() != "facet") fail(fmt::format("expected \"facet\", found \"{}\"", words.word()));
    expect("normal");
    for (int d = 0; d < 3; ++d) coordinate();
    expect("outer");
    expect("loop");
    std::array<Vec3, 3> corners;
    for (auto& corner : corners) {
      expect("vertex");
      for (int d = 0; d < 3; ++d) corner[d] = coordinate();
    }
    expect("endloop");
    expect("endfacet");
    welder.add(corners);
  }
  if (!ended) fail("the closing \"endsolid\" is missing");
  return welder.finish();
}

}  // namespace

geometry::SurfaceMesh TriangleMesh::surface() const {
  geometry::SurfaceMesh mesh;
  mesh.points = points;
  for (const auto& triangle : triangles) mesh.add_face(geometry::FaceKind::triangle3, triangle);
  return mesh;
}

TriangleMesh read_stl(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw UserError({path, 0, 0}, "the STL file cannot be read. Check the path and its permissions.");
  const std::string bytes((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  if (bytes.empty()) throw UserError({path, 0, 0}, "the STL file is empty. Export the surface again.");

  // A binary file may start with "solid" too, so its length decides; only then the word.
  if (bytes.size() >= binary_header) {
    std::uint32_t count;
    std::memcpy(&count, bytes.data() + 80, 4);
    const std::size_t expected = binary_header + binary_record * static_cast<std::size_t>(count);
    if (bytes.size() == expected) {
      if (count == 0) throw UserError({path, 0, 0}, "the STL file holds no triangle. Export the surface again.");
      return read_binary(path, bytes);
    }
    if (!bytes.starts_with("solid"))
      throw UserError({path, 0, 0}, fmt::format("a binary STL of {} triangles has {} bytes, this file has {}: it is cut "
                                                "short or not STL. Export the surface again.", count, expected, bytes.size()));
  }
  if (!bytes.starts_with("solid"))
    throw UserError({path, 0, 0}, "this is neither ASCII nor binary STL. Export the surface as STL.");
  return read_ascii(path, bytes);
}

void write_stl(const std::string& path, const TriangleMesh& mesh) {
  std::ofstream stream(path, std::ios::binary);
  std::array<char, 80> comment{};
  stream.write(comment.data(), comment.size());
  const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
  stream.write(reinterpret_cast<const char*>(&count), 4);
  for (const auto& triangle : mesh.triangles) {
    const Vec3 &a = mesh.points[triangle[0]], &b = mesh.points[triangle[1]], &c = mesh.points[triangle[2]];
    const Vec3 normal = (b - a).cross(c - a).normalized();
    for (const auto* vector : {&normal, &a, &b, &c})
      for (int d = 0; d < 3; ++d) {
        const auto value = static_cast<float>((*vector)[d]);
        stream.write(reinterpret_cast<const char*>(&value), 4);
      }
    stream.write("\0\0", 2);
  }
  stream.close();
  if (!stream) give_up_writing(path, path);
}

}  // namespace acopla::io
