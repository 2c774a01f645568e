// Files for ParaView, read back by their own rules: offsets of appended raw blocks, each led by its
// size.
#include <cstring>
#include <regex>

#include "io/vtk.h"
#include "tests/unit/io/scratch.h"

namespace acopla::io {
namespace {

using Vtk = Scratch;

// The bytes of the array of that name.
std::string block(const std::string& file, const std::string& name) {
  std::smatch match;
  const auto text = file.substr(0, file.find("<AppendedData"));
  EXPECT_TRUE(
      std::regex_search(text, match, std::regex("Name=\"" + name + "\"[^>]*offset=\"(\\d+)\"")))
      << name;
  const auto start = file.find("\n_", file.find("<AppendedData")) + 2 + std::stoul(match[1]);
  std::uint64_t size;
  std::memcpy(&size, file.data() + start, 8);
  return file.substr(start + 8, size);
}

template <class T>
std::vector<T> values(const std::string& bytes) {
  std::vector<T> all(bytes.size() / sizeof(T));
  std::memcpy(all.data(), bytes.data(), bytes.size());
  return all;
}

TEST_F(Vtk, PointsWithData) {
  const std::vector<Eigen::Vector3d> points{{0, 0, 0}, {1, 2, 3}};
  write_points(path("p.vtp"), points,
               {{"radius", 1, {0.5, 0.25}}, {"velocity", 3, {1, 2, 3, 4, 5, 6}}});
  const auto file = read("p.vtp");
  EXPECT_NE(file.find("NumberOfPoints=\"2\" NumberOfVerts=\"2\""), std::string::npos);
  EXPECT_EQ(values<float>(block(file, "radius")), (std::vector<float>{0.5, 0.25}));
  EXPECT_EQ(values<float>(block(file, "velocity"))[5], 6);
  EXPECT_EQ(values<float>(block(file, "Points")), (std::vector<float>{0, 0, 0, 1, 2, 3}));
  EXPECT_EQ(values<std::int32_t>(block(file, "offsets")), (std::vector<std::int32_t>{1, 2}));
}

TEST_F(Vtk, QuadraticFacesAreDrawnByTheirCorners) {
  geometry::SurfaceMesh mesh;
  for (int k = 0; k < 9; ++k) mesh.points.emplace_back(k, 0, 0);
  mesh.add_face(geometry::FaceKind::quad9, std::vector<std::uint32_t>{0, 1, 2, 3, 4, 5, 6, 7, 8});
  mesh.add_face(geometry::FaceKind::triangle3, std::vector<std::uint32_t>{4, 5, 6});
  write_surface(path("s.vtp"), mesh, {});
  const auto file = read("s.vtp");
  EXPECT_EQ(values<std::int32_t>(block(file, "connectivity")),
            (std::vector<std::int32_t>{0, 1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(values<std::int32_t>(block(file, "offsets")), (std::vector<std::int32_t>{4, 7}));
  EXPECT_NE(file.find("NumberOfPolys=\"2\""), std::string::npos);
}

TEST_F(Vtk, LinesAreLines) {
  geometry::SurfaceMesh mesh;
  for (int k = 0; k < 3; ++k) mesh.points.emplace_back(k, 0, 0);
  mesh.add_face(geometry::FaceKind::line2, std::vector<std::uint32_t>{0, 1});
  mesh.add_face(geometry::FaceKind::line2, std::vector<std::uint32_t>{1, 2});
  write_surface(path("l.vtp"), mesh, {});
  const auto file = read("l.vtp");
  EXPECT_NE(file.find("NumberOfLines=\"2\""), std::string::npos);
  EXPECT_NE(file.find("<Lines>"), std::string::npos);
}

TEST_F(Vtk, ASeriesNamesItsFilesRelativeToItself) {
  PvdSeries series(path("run.pvd"));
  series.add(0.1, path("surfaces/a_00001.vtp"));
  series.add(0.2, "surfaces/a_00002.vtp");
  const auto file = read("run.pvd");
  EXPECT_NE(file.find("timestep=\"0.1\" file=\"surfaces/a_00001.vtp\""), std::string::npos) << file;
  EXPECT_NE(file.find("timestep=\"0.2\" file=\"surfaces/a_00002.vtp\""), std::string::npos) << file;
  EXPECT_FALSE(std::filesystem::exists(path("run.pvd.part")));
}

TEST_F(Vtk, AFolderThatIsNotThere) {
  expect_mistake([&] { write_points(path("no/p.vtp"), {}, {}); }, "the file cannot be written");
}

}  // namespace
}  // namespace acopla::io
