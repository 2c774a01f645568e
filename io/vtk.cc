#include "io/vtk.h"

#include <fmt/format.h>

#include <array>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "io/error.h"
#include "io/results.h"

namespace acopla::io {
namespace {

using geometry::FaceKind;

// Collects the arrays of a file: the header names their offsets, the raw bytes follow in one block.
class Appended {
 public:
  template <class T>
  std::string array(const std::string& name, int components, const std::vector<T>& values) {
    const char* type = std::is_same_v<T, double> ? "Float64" : std::is_same_v<T, float> ? "Float32" : "Int32";
    const auto line = fmt::format(
        "<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"appended\" offset=\"{}\"/>\n", type, name,
        components, bytes_.size());
    const std::uint64_t size = values.size() * sizeof(T);
    append(&size, sizeof size);
    append(values.data(), size);
    return line;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  void append(const void* data, std::size_t size) {
    if (size) bytes_.append(static_cast<const char*>(data), size);
  }
  std::string bytes_;
};

std::vector<float> flat(std::span<const Eigen::Vector3d> points) {
  std::vector<float> values;
  values.reserve(3 * points.size());
  for (const auto& point : points)
    for (int d = 0; d < 3; ++d) values.push_back(static_cast<float>(point[d]));
  return values;
}

void write_file(const std::string& path, const std::string& text) {
  std::ofstream stream(path, std::ios::binary);
  stream << text;
  stream.close();
  if (!stream) give_up_writing(path, path);
}

void write_poly_data(const std::string& path, std::span<const Eigen::Vector3d> points,
                     const std::vector<PointData>& data, const char* cells, const std::vector<std::int32_t>& nodes,
                     const std::vector<std::int32_t>& offsets) {
  Appended appended;
  std::string xml = "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
                    "header_type=\"UInt64\">\n<PolyData>\n";
  const auto count = [&](const char* kind) { return std::strcmp(cells, kind) == 0 ? offsets.size() : 0; };
  xml += fmt::format("<Piece NumberOfPoints=\"{}\" NumberOfVerts=\"{}\" NumberOfLines=\"{}\" NumberOfStrips=\"0\" "
                     "NumberOfPolys=\"{}\">\n<PointData>\n",
                     points.size(), count("Verts"), count("Lines"), count("Polys"));
  for (const auto& field : data)  // single precision is what a picture needs; the HDF5 series keeps doubles
    xml += appended.array(field.name, field.components, std::vector<float>(field.values.begin(), field.values.end()));
  xml += "</PointData>\n<Points>\n" + appended.array("Points", 3, flat(points)) + "</Points>\n";
  xml += fmt::format("<{}>\n", cells) + appended.array("connectivity", 1, nodes) +
         appended.array("offsets", 1, offsets) + fmt::format("</{}>\n", cells);
  xml += "</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_" + appended.bytes() + "\n</AppendedData>\n</VTKFile>\n";
  write_file(path, xml);
}

}  // namespace

void write_points(const std::string& path, std::span<const Eigen::Vector3d> points,
                  const std::vector<PointData>& data) {
  std::vector<std::int32_t> nodes, offsets;
  for (std::int32_t k = 0; k < static_cast<std::int32_t>(points.size()); ++k) {
    nodes.push_back(k);
    offsets.push_back(k + 1);
  }
  write_poly_data(path, points, data, "Verts", nodes, offsets);
}

void write_surface(const std::string& path, const geometry::SurfaceMesh& mesh, const std::vector<PointData>& data) {
  std::vector<std::int32_t> nodes, offsets;
  for (std::size_t face = 0; face < mesh.face_count(); ++face) {
    const auto all = mesh.nodes(face);
    for (std::size_t k = 0; k < geometry::corners_of(mesh.kind(face)); ++k)
      nodes.push_back(static_cast<std::int32_t>(all[k]));
    offsets.push_back(static_cast<std::int32_t>(nodes.size()));
  }
  const bool lines = mesh.face_count() > 0 && geometry::corners_of(mesh.kind(0)) == 2;  // two dimensions
  write_poly_data(path, mesh.points, data, lines ? "Lines" : "Polys", nodes, offsets);
}

// Only what add() writes is read: one file a line.
void PvdSeries::keep_until(double time) {
  files_.clear();
  std::ifstream list(path_);
  const auto folder = std::filesystem::absolute(path_).parent_path();
  for (std::string line; std::getline(list, line);) {
    double when = 0;
    std::array<char, 1024> name{};
    if (std::sscanf(line.c_str(), "<DataSet timestep=\"%lf\" file=\"%1023[^\"]\"", &when, name.data()) == 2 && when <= time * (1 + 1e-10))
      files_.emplace_back(when, (folder / name.data()).string());
  }
}

void PvdSeries::add(double time, const std::string& file) {
  files_.emplace_back(time, file);
  std::string xml = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n"
                    "<Collection>\n";
  const auto folder = std::filesystem::path(path_).parent_path();
  for (const auto& [when, name] : files_) {
    const std::filesystem::path full(name);
    const auto shown = full.is_absolute() ? std::filesystem::relative(full, std::filesystem::absolute(folder)) : full;
    xml += fmt::format("<DataSet timestep=\"{:.12g}\" file=\"{}\"/>\n", when, shown.string());
  }
  xml += "</Collection>\n</VTKFile>\n";
  write_file(path_ + ".part", xml);
  std::filesystem::rename(path_ + ".part", path_);
}

}  // namespace acopla::io
