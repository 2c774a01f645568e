#include "io/series.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <filesystem>
#include <limits>
#include <map>
#include <utility>

#include "io/error.h"
#include "io/hdf5_handle.h"

namespace acopla::io {
namespace {

using geometry::Vec3;

// The library prints a stack of errors by itself; ours are one sentence.
void silence() { H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); }

// What HDF5 keeps of the tables of chunks grows with their number, to 32 MiB, unless it is told that the last ones are enough.
Handle access_to_file() {
  Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5AC_cache_config_t config{};
  config.version = H5AC__CURR_CACHE_CONFIG_VERSION;
  if (H5Pget_mdc_config(access.get(), &config) < 0) return access;
  config.set_initial_size = true;
  config.initial_size = config.min_size = config.max_size = 1 << 20;
  H5Pset_mdc_config(access.get(), &config);
  return access;
}

// Rows are only ever appended: one chunk at a time is enough, where HDF5 would keep a megabyte of each dataset.
Handle access_to_appended() {
  Handle access(H5Pcreate(H5P_DATASET_ACCESS), H5Pclose);
  constexpr std::size_t slots = 7, bytes = 8 << 10;  // a chunk of small rows; larger ones pass it by
  H5Pset_chunk_cache(access.get(), slots, bytes, 1.0);
  return access;
}

// Paths inside the file are made of names from cases, which may hold dots but not slashes.
struct Appendable {
  Handle data;
  std::vector<hsize_t> size;  // first dimension grows
};

}  // namespace

struct SeriesWriter::File {
  std::string path;
  Handle file;
  std::map<std::string, Appendable> datasets;
  hsize_t windows = 0;
  mutable bool abandoned = false;

  ~File() {
    datasets.clear();
    hsize_t size = 0;
    const bool known = H5Fflush(file.get(), H5F_SCOPE_LOCAL) >= 0 && H5Fget_filesize(file.get(), &size) >= 0;
    // Gives back what was reserved and not used: HDF5 does not know of it.
    std::error_code ignored;  // the file is whole, only longer
    if (file.finish() && known && !abandoned) std::filesystem::resize_file(path, size, ignored);
  }

  [[noreturn]] void fail(const std::string& what) const {
    abandon();
    throw UserError({path, 0, 0}, fmt::format("{} cannot be written. Check the free space of the results folder.", what));
  }

  // Leaves the file as the last flush left it: what HDF5 would still write when it is closed, half of which might find room, goes nowhere.
  void abandon() const {
    abandoned = true;
    void* handle = nullptr;
    const int nowhere = ::open("/dev/null", O_RDWR | O_CLOEXEC);
    if (nowhere >= 0 && file.valid() && H5Fget_vfd_handle(file.get(), H5P_DEFAULT, &handle) >= 0 && handle)
      ::dup2(nowhere, *static_cast<const int*>(handle));
    if (nowhere >= 0) ::close(nowhere);
  }

  // Asks for all the room that a flush may need before it begins: one that ended in its middle would leave a file that nobody can read.
  void reserve() const {
    constexpr hsize_t spare = 64 << 10;  // for what HDF5 lays out only while it flushes
    hsize_t size = 0;
    void* handle = nullptr;
    if (H5Fget_filesize(file.get(), &size) < 0 || H5Fget_vfd_handle(file.get(), H5P_DEFAULT, &handle) < 0 || !handle) return;
    if (::fallocate(*static_cast<const int*>(handle), 0, 0, static_cast<off_t>(size + spare)) == 0) return;
    if (errno == ENOSPC || errno == EFBIG || errno == EDQUOT) fail("the file");  // other systems cannot be asked
  }

  Appendable& dataset(const std::string& name, const std::vector<hsize_t>& row) {
    if (const auto found = datasets.find(name); found != datasets.end()) return found->second;
    std::vector<hsize_t> size{0}, limit{H5S_UNLIMITED}, chunk{1};
    hsize_t values = 1;
    for (const auto extent : row) {
      size.push_back(extent);
      limit.push_back(extent);
      chunk.push_back(std::max<hsize_t>(extent, 1));  // a surface may be empty, a chunk may not
      values *= extent;
    }
    if (values < 512) chunk[0] = 512 / std::max<hsize_t>(values, 1);  // small rows share a chunk
    const Handle space(H5Screate_simple(static_cast<int>(size.size()), size.data(), limit.data()), H5Sclose);
    const Handle create(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    H5Pset_chunk(create.get(), static_cast<int>(chunk.size()), chunk.data());
    const double fill = std::numeric_limits<double>::quiet_NaN();  // a window without a value is not a zero
    H5Pset_fill_value(create.get(), H5T_NATIVE_DOUBLE, &fill);
    const Handle link(H5Pcreate(H5P_LINK_CREATE), H5Pclose);
    H5Pset_create_intermediate_group(link.get(), 1);
    Handle data(H5Dcreate2(file.get(), name.c_str(), H5T_IEEE_F64LE, space.get(), link.get(), create.get(),
                           access_to_appended().get()),
                H5Dclose);
    if (!data.valid()) fail(name);
    return datasets.emplace(name, Appendable{std::move(data), size}).first->second;
  }

  void append(const std::string& name, const std::vector<hsize_t>& row, const double* values) {
    auto& target = dataset(name, row);
    target.size[0] = windows;
    if (H5Dset_extent(target.data.get(), target.size.data()) < 0) fail(name);
    const Handle space(H5Dget_space(target.data.get()), H5Sclose);
    std::vector<hsize_t> start(target.size.size(), 0), count = target.size;
    start[0] = windows - 1;
    count[0] = 1;
    H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr);
    const Handle memory(H5Screate_simple(static_cast<int>(count.size()), count.data(), nullptr), H5Sclose);
    if (H5Dwrite(target.data.get(), H5T_NATIVE_DOUBLE, memory.get(), space.get(), H5P_DEFAULT, values) < 0) fail(name);
  }

  // What grows with the windows has no last extent; the rest, meshes, stays.
  void cut(std::size_t to) {
    std::vector<std::string> names;
    const auto collect = [](hid_t, const char* name, const H5O_info_t* info, void* all) -> herr_t {
      if (info->type == H5O_TYPE_DATASET) static_cast<std::vector<std::string>*>(all)->push_back(std::string("/") + name);
      return 0;
    };
    if (H5Ovisit2(file.get(), H5_INDEX_NAME, H5_ITER_INC, collect, &names, H5O_INFO_BASIC) < 0) fail("the file");
    for (const auto& name : names) {
      Handle data(H5Dopen2(file.get(), name.c_str(), access_to_appended().get()), H5Dclose);
      const Handle space(H5Dget_space(data.get()), H5Sclose);
      const auto rank = static_cast<std::size_t>(std::max(0, H5Sget_simple_extent_ndims(space.get())));
      std::vector<hsize_t> size(rank), limit(rank);
      H5Sget_simple_extent_dims(space.get(), size.data(), limit.data());
      if (rank == 0 || limit[0] != H5S_UNLIMITED) continue;
      if (name == "/windows" && size[0] < to)
        throw UserError({path, 0, 0}, fmt::format("the record holds {} windows and the checkpoint was written after {}: they are not of one run. "
                                                  "Start the run from its beginning.", size[0], to));
      if (size[0] > to) {
        size[0] = to;
        if (H5Dset_extent(data.get(), size.data()) < 0) fail(name);
      }
      datasets.emplace(name, Appendable{std::move(data), size});
    }
    windows = to;
  }

  template <class T>
  void write_once(const std::string& name, hid_t stored, hid_t given, const std::vector<hsize_t>& size, const T* values) {
    const Handle space(H5Screate_simple(static_cast<int>(size.size()), size.data(), nullptr), H5Sclose);
    const Handle link(H5Pcreate(H5P_LINK_CREATE), H5Pclose);
    H5Pset_create_intermediate_group(link.get(), 1);
    const Handle data(H5Dcreate2(file.get(), name.c_str(), stored, space.get(), link.get(), H5P_DEFAULT, H5P_DEFAULT),
                      H5Dclose);
    if (!data.valid() || H5Dwrite(data.get(), given, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) < 0) fail(name);
  }
};

SeriesWriter::SeriesWriter(const std::string& path) : file_(std::make_unique<File>()) {
  silence();
  file_->path = path;
  file_->file = Handle(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access_to_file().get()), H5Fclose);
  if (!file_->file.valid()) file_->fail("the file");
}

SeriesWriter::SeriesWriter(const std::string& path, std::size_t windows) : file_(std::make_unique<File>()) {
  silence();
  file_->path = path;
  file_->file = Handle(H5Fopen(path.c_str(), H5F_ACC_RDWR, access_to_file().get()), H5Fclose);
  if (!file_->file.valid())
    throw UserError({path, 0, 0}, "the record cannot be opened to go on with it: it is missing, damaged, or another program has it open. Start the run from its beginning.");
  file_->cut(windows);
}

SeriesWriter::~SeriesWriter() = default;

void SeriesWriter::add_surface(const std::string& name, const geometry::SurfaceMesh& mesh) {
  if (H5Lexists(file_->file.get(), ("/" + name).c_str(), H5P_DEFAULT) > 0) return;
  std::vector<double> points;
  for (const auto& point : mesh.points) points.insert(points.end(), point.data(), point.data() + 3);
  file_->write_once(fmt::format("/{}/points", name), H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, {mesh.points.size(), 3},
                    points.data());
  file_->write_once(fmt::format("/{}/connectivity", name), H5T_STD_U32LE, H5T_NATIVE_UINT32,
                    {mesh.connectivity().size()}, mesh.connectivity().data());
  file_->write_once(fmt::format("/{}/kinds", name), H5T_STD_U8LE, H5T_NATIVE_UINT8, {mesh.kinds().size()},
                    reinterpret_cast<const std::uint8_t*>(mesh.kinds().data()));
}

void SeriesWriter::add_initial(const std::string& surface, const std::string& field, std::span<const Vec3> values) {
  const auto name = fmt::format("/{}/initial", surface);
  if (H5Lexists(file_->file.get(), name.c_str(), H5P_DEFAULT) > 0 && H5Lexists(file_->file.get(), fmt::format("{}/{}", name, field).c_str(), H5P_DEFAULT) > 0)
    return;  // a run that is resumed
  file_->write_once(fmt::format("{}/{}", name, field), H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, {values.size(), 3}, values.empty() ? nullptr : values[0].data());
}

void SeriesWriter::begin_window(double start, double end) {
  ++file_->windows;
  const std::array<double, 2> row{start, end};
  file_->append("/windows", {2}, row.data());
}

void SeriesWriter::add_field(const std::string& surface, const std::string& field, std::span<const Vec3> values) {
  // Eigen's 3-vectors of double are three packed doubles.
  static_assert(sizeof(Vec3) == 3 * sizeof(double));
  file_->append(fmt::format("/{}/{}", surface, field), {values.size(), 3}, values.empty() ? nullptr : values[0].data());
}

void SeriesWriter::add_scalar(const std::string& name, double value) { file_->append("/" + name, {}, &value); }

void SeriesWriter::flush() {
  file_->reserve();
  if (H5Fflush(file_->file.get(), H5F_SCOPE_LOCAL) < 0) file_->fail("the file");
}

struct SeriesReader::File {
  std::string path;
  Handle file;
  std::vector<std::pair<double, double>> windows;

  [[noreturn]] void fail(const std::string& what) const { throw UserError({path, 0, 0}, what); }

  std::vector<std::string> names(const std::string& group) const {
    const Handle opened(H5Gopen2(file.get(), group.c_str(), H5P_DEFAULT), H5Gclose);
    H5G_info_t info{};
    std::vector<std::string> found;
    if (!opened.valid() || H5Gget_info(opened.get(), &info) < 0) return found;
    for (hsize_t k = 0; k < info.nlinks; ++k) {
      std::array<char, 256> name{};
      if (H5Lget_name_by_idx(file.get(), group.c_str(), H5_INDEX_NAME, H5_ITER_INC, k, name.data(), name.size(),
                             H5P_DEFAULT) > 0)
        found.emplace_back(name.data());
    }
    return found;
  }

  Handle open(const std::string& name) const {
    const auto group = name.substr(0, name.rfind('/'));
    Handle data;
    if (group.empty() || H5Lexists(file.get(), group.c_str(), H5P_DEFAULT) > 0)
      data = Handle(H5Dopen2(file.get(), name.c_str(), H5P_DEFAULT), H5Dclose);
    if (!data.valid())
      fail(fmt::format("{} is not in this record. It holds: {}.", name, fmt::join(names(group.empty() ? "/" : group), ", ")));
    return data;
  }

  std::vector<hsize_t> size(const Handle& data) const {
    const Handle space(H5Dget_space(data.get()), H5Sclose);
    std::vector<hsize_t> extent(static_cast<std::size_t>(std::max(0, H5Sget_simple_extent_ndims(space.get()))));
    H5Sget_simple_extent_dims(space.get(), extent.data(), nullptr);
    return extent;
  }

  template <class T>
  std::vector<T> read(const std::string& name, hid_t type) const {
    const auto data = open(name);
    std::size_t count = 1;
    for (const auto extent : size(data)) count *= extent;
    std::vector<T> values(count);
    if (count && H5Dread(data.get(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0)
      fail(fmt::format("{} cannot be read: the record is damaged. Run the case again.", name));
    return values;
  }
};

SeriesReader::SeriesReader(const std::string& path) : file_(std::make_unique<File>()) {
  silence();
  file_->path = path;
  if (!std::filesystem::exists(path)) file_->fail("the record does not exist. Run the case that makes it first.");
  file_->file = Handle(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (!file_->file.valid()) file_->fail("this is not a readable HDF5 record. Run the case that makes it again.");
  const auto rows = file_->read<double>("/windows", H5T_NATIVE_DOUBLE);
  for (std::size_t k = 0; k + 1 < rows.size(); k += 2) file_->windows.emplace_back(rows[k], rows[k + 1]);
}

SeriesReader::~SeriesReader() = default;
SeriesReader::SeriesReader(SeriesReader&&) noexcept = default;

std::size_t SeriesReader::windows() const { return file_->windows.size(); }
std::pair<double, double> SeriesReader::window(std::size_t index) const { return file_->windows.at(index); }

std::vector<std::string> SeriesReader::surfaces() const {
  std::vector<std::string> found;
  for (const auto& name : file_->names("/"))
    if (H5Lexists(file_->file.get(), fmt::format("/{}/points", name).c_str(), H5P_DEFAULT) > 0) found.push_back(name);
  return found;
}

geometry::SurfaceMesh SeriesReader::surface(const std::string& name) const {
  const auto points = file_->read<double>(fmt::format("/{}/points", name), H5T_NATIVE_DOUBLE);
  const auto nodes = file_->read<std::uint32_t>(fmt::format("/{}/connectivity", name), H5T_NATIVE_UINT32);
  const auto kinds = file_->read<std::uint8_t>(fmt::format("/{}/kinds", name), H5T_NATIVE_UINT8);
  geometry::SurfaceMesh mesh;
  for (std::size_t k = 0; k + 2 < points.size(); k += 3) mesh.points.emplace_back(points[k], points[k + 1], points[k + 2]);
  std::size_t first = 0;
  for (const auto kind : kinds) {
    const auto count = geometry::nodes_of(static_cast<geometry::FaceKind>(kind));
    if (count == 0 || first + count > nodes.size()) file_->fail(fmt::format("surface {} is damaged.", name));
    mesh.add_face(static_cast<geometry::FaceKind>(kind), std::span(nodes).subspan(first, count));
    first += count;
  }
  return mesh;
}

std::vector<Vec3> SeriesReader::field(const std::string& surface, const std::string& field, std::size_t window) const {
  const auto name = fmt::format("/{}/{}", surface, field);
  const auto data = file_->open(name);
  const auto extent = file_->size(data);
  if (extent.size() != 3 || extent[2] != 3 || window >= extent[0])
    file_->fail(fmt::format("{} has no window {}.", name, window));
  const std::array<hsize_t, 3> start{window, 0, 0}, count{1, extent[1], 3};
  const Handle space(H5Dget_space(data.get()), H5Sclose);
  H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr);
  const Handle memory(H5Screate_simple(3, count.data(), nullptr), H5Sclose);
  std::vector<Vec3> values(extent[1]);
  if (!values.empty() &&
      H5Dread(data.get(), H5T_NATIVE_DOUBLE, memory.get(), space.get(), H5P_DEFAULT, values[0].data()) < 0)
    file_->fail(fmt::format("{} cannot be read: the record is damaged. Run the case again.", name));
  return values;
}

bool SeriesReader::has(const std::string& surface, const std::string& field) const {
  return H5Lexists(file_->file.get(), fmt::format("/{}", surface).c_str(), H5P_DEFAULT) > 0 &&
         H5Lexists(file_->file.get(), fmt::format("/{}/{}", surface, field).c_str(), H5P_DEFAULT) > 0;
}

std::vector<Vec3> SeriesReader::initial(const std::string& surface, const std::string& field) const {
  const auto flat = file_->read<double>(fmt::format("/{}/initial/{}", surface, field), H5T_NATIVE_DOUBLE);
  std::vector<Vec3> values;
  for (std::size_t k = 0; k + 2 < flat.size(); k += 3) values.emplace_back(flat[k], flat[k + 1], flat[k + 2]);
  return values;
}

std::vector<double> SeriesReader::scalars(const std::string& name) const {
  return file_->read<double>("/" + name, H5T_NATIVE_DOUBLE);
}

}  // namespace acopla::io
