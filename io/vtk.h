// Pictures for ParaView: a .pvd series of appended-raw .vtp files of points and surfaces.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "geometry/surface_mesh.h"

namespace acopla::io {

/// Values per point: 1 or 3 components, as one flat list.
struct PointData {
  std::string name;
  int components = 1;
  std::vector<double> values;
};

/// Writes one .vtp file of points (vertices). @throws UserError when the file cannot be written.
void write_points(const std::string& path, std::span<const Eigen::Vector3d> points, const std::vector<PointData>& data);
/// Writes one .vtp file of a surface; quadratic faces are drawn by their corners.
void write_surface(const std::string& path, const geometry::SurfaceMesh& mesh, const std::vector<PointData>& data);

/// The list of files over time that ParaView opens. Rewritten whole and renamed at each add(), so that a run that stops
/// leaves a readable list.
class PvdSeries {
 public:
  /// @param path  of the .pvd file; files are named relative to its folder
  explicit PvdSeries(std::string path) : path_(std::move(path)) {}
  void add(double time, const std::string& file);
  /// Goes on with the list that a run before left: the files until `time` [s] stay in it.
  void keep_until(double time);

 private:
  std::string path_;
  std::vector<std::pair<double, std::string>> files_;
};

}  // namespace acopla::io
