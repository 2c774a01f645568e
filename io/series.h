// HDF5 series: a surface, and a field on it for every window of a run.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "geometry/surface_mesh.h"

namespace acopla::io {

/// Writes a file of interface series:
///   /SURFACE/points [n,3], /SURFACE/connectivity, /SURFACE/kinds    the reference surface
///   /SURFACE/FIELD  [windows, n, 3]                                 one row a window
///   /windows        [windows, 2]                                    start and end [s]
///   /TABLE          [windows]                                       scalar columns by group/name
/// After flush() the file is whole, so that a run that stops leaves what it had. @throws UserError
class SeriesWriter {
 public:
  explicit SeriesWriter(const std::string& path);
  /// Goes on with a file after its first `windows` windows; what came later is cut off.
  SeriesWriter(const std::string& path, std::size_t windows);
  ~SeriesWriter();
  SeriesWriter(const SeriesWriter&) = delete;
  SeriesWriter& operator=(const SeriesWriter&) = delete;

  void add_surface(const std::string& name, const geometry::SurfaceMesh& mesh);  ///< unless the file has it already
  /// Appends the field's values of the window begun last; one vector per point of the surface.
  void add_field(const std::string& surface, const std::string& field, std::span<const geometry::Vec3> values);
  /// Appends one scalar of the window begun last, e.g. "ledger/force_loss".
  void add_scalar(const std::string& name, double value);
  void begin_window(double start, double end);
  void flush();

 private:
  struct File;
  std::unique_ptr<File> file_;
};

/// Reads such a file back. @throws UserError when it is not one, or a name is not in it (those that are get listed)
class SeriesReader {
 public:
  explicit SeriesReader(const std::string& path);
  ~SeriesReader();
  SeriesReader(SeriesReader&&) noexcept;

  std::vector<std::string> surfaces() const;
  geometry::SurfaceMesh surface(const std::string& name) const;
  std::size_t windows() const;
  std::pair<double, double> window(std::size_t index) const;  ///< start and end [s]
  std::vector<geometry::Vec3> field(const std::string& surface, const std::string& field, std::size_t window) const;
  std::vector<double> scalars(const std::string& name) const;  ///< one per window

 private:
  struct File;
  std::unique_ptr<File> file_;
};

}  // namespace acopla::io
