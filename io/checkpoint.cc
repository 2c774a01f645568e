#include "io/checkpoint.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>
#include <zlib.h>

#include <bit>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <stdexcept>

#include "io/error.h"
#include "io/hdf5_handle.h"

namespace acopla::io {
namespace {

using Kind = Element::Kind;

constexpr int format_version = 1;
constexpr std::size_t heading_bytes = 512;  // smallest user block of HDF5
constexpr std::string_view magic = "Acopla checkpoint\n";
constexpr std::string_view byte_order = std::endian::native == std::endian::little ? "little" : "big";
constexpr std::string_view mend = "Resume from another checkpoint, or start the run from its beginning.";

[[noreturn]] void fail(const std::string& path, const std::string& sentence) { throw UserError({path, 0, 0}, sentence); }

[[noreturn]] void fail_to_write(const std::string& path, int error = 0) {
  fail(path, fmt::format("the checkpoint cannot be written{}. Check the free space and the rights of its folder.",
                         error ? fmt::format(": {}", std::strerror(error)) : ""));
}

// ---- The heading ----

// The CRC is that of the bytes from 512 on; a heading is right when it is the very one those bytes get.
std::string heading(std::uintmax_t file_bytes, std::uint32_t crc) {
  auto text = fmt::format("{}format {}\nbyte order {}\nbytes {}\ncrc32 {:08x}\nAn HDF5 file begins at byte {}.\n", magic,
                          format_version, byte_order, file_bytes, crc, heading_bytes);
  text.resize(heading_bytes, '\n');
  return text;
}

std::string_view heading_value(std::string_view text, std::string_view key) {
  const auto line = fmt::format("\n{} ", key);
  const auto begin = text.find(line);
  if (begin == std::string_view::npos) return {};
  text.remove_prefix(begin + line.size());
  return text.substr(0, text.find('\n'));
}

class Descriptor {
 public:
  Descriptor(const std::string& path, int flags) : id_(open(path.c_str(), flags | O_CLOEXEC)) {}
  ~Descriptor() {
    if (id_ >= 0) close(id_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return id_; }
  bool valid() const { return id_ >= 0; }

 private:
  int id_;
};

// Reads up to `size` bytes from `offset`; fewer at the end of the file or after an error.
std::size_t read_at(const Descriptor& file, char* to, std::size_t size, std::size_t offset) {
  std::size_t done = 0;
  while (done < size) {
    const auto got = pread(file.get(), to + done, size - done, static_cast<off_t>(offset + done));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) break;
    done += static_cast<std::size_t>(got);
  }
  return done;
}

// Length of the file and CRC-32 of what follows the heading.
std::pair<std::uintmax_t, std::uint32_t> measure(const Descriptor& file) {
  std::vector<char> block(std::size_t{1} << 20);
  std::size_t end = heading_bytes;
  auto crc = crc32(0, nullptr, 0);
  while (const auto got = read_at(file, block.data(), block.size(), end)) {
    crc = crc32(crc, reinterpret_cast<const Bytef*>(block.data()), static_cast<uInt>(got));
    end += got;
  }
  return {end, static_cast<std::uint32_t>(crc)};
}

void check_heading(const std::string& path) {
  std::error_code none;
  const auto bytes = std::filesystem::file_size(path, none);
  if (none) fail(path, "there is no such checkpoint. Check the path, or start the run from its beginning.");
  const Descriptor file(path, O_RDONLY);
  if (!file.valid()) fail(path, fmt::format("the checkpoint cannot be read: {}. Check its rights.", std::strerror(errno)));
  std::string found(heading_bytes, '\0');
  found.resize(read_at(file, found.data(), found.size(), 0));
  if (!found.starts_with(magic.substr(0, found.size())))
    fail(path, "this is not a checkpoint of Acopla. Name a file that a run wrote as one.");
  if (found.size() < heading_bytes) fail(path, fmt::format("the checkpoint is cut off after {} bytes. {}", found.size(), mend));
  if (const auto format = heading_value(found, "format"); format != std::to_string(format_version))
    fail(path, fmt::format("the checkpoint is of format {}; this program reads format {}. Resume it with the version of Acopla "
                           "that wrote it, or start the run from its beginning.",
                           format, format_version));
  if (const auto order = heading_value(found, "byte order"); order != byte_order)
    fail(path,
         fmt::format("the checkpoint is of byte order {} and this machine's is {}. Resume it on a machine like the one that "
                     "wrote it, or start the run from its beginning.",
                     order, byte_order));
  const auto [length, crc] = measure(file);
  if (found == heading(length, crc)) return;
  if (const auto whole = heading_value(found, "bytes"); whole != std::to_string(bytes))
    fail(path,
         fmt::format("the checkpoint has {} bytes and was written with {}: it is cut off or damaged. {}", bytes, whole, mend));
  fail(path, fmt::format("the checkpoint is damaged: its checksum does not match. {}", mend));
}

// ---- Arrays of the state in HDF5 ----

hid_t number_type(const Element& element) {
  const auto choose = [&](hid_t one, hid_t two, hid_t four, hid_t eight) {
    switch (element.component_bytes) {
      case 1:
        return one;
      case 2:
        return two;
      case 4:
        return four;
      case 8:
        return eight;
      default:
        return hid_t{-1};
    }
  };
  switch (element.kind) {
    case Kind::signed_integer:
      return choose(H5T_NATIVE_INT8, H5T_NATIVE_INT16, H5T_NATIVE_INT32, H5T_NATIVE_INT64);
    case Kind::unsigned_integer:
      return choose(H5T_NATIVE_UINT8, H5T_NATIVE_UINT16, H5T_NATIVE_UINT32, H5T_NATIVE_UINT64);
    case Kind::real:
      return choose(-1, -1, H5T_NATIVE_FLOAT, H5T_NATIVE_DOUBLE);
    default:
      return -1;
  }
}

// Text is one string as long as it is; HDF5 has none of length zero, so that empty text is a string without a place.
Handle text_type(std::size_t bytes) {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type.get(), std::max<std::size_t>(bytes, 1));
  H5Tset_strpad(type.get(), H5T_STR_NULLPAD);
  return type;
}

Handle text_space(std::size_t bytes) { return {H5Screate(bytes ? H5S_SCALAR : H5S_NULL), H5Sclose}; }

Handle stored_type(const State::Entry& entry) {
  switch (entry.element.kind) {
    case Kind::text:
      return text_type(entry.count);
    case Kind::boolean: {  // as h5py does
      Handle type(H5Tenum_create(H5T_NATIVE_INT8), H5Tclose);
      std::int8_t value = 0;
      H5Tenum_insert(type.get(), "FALSE", &value);
      value = 1;
      H5Tenum_insert(type.get(), "TRUE", &value);
      return type;
    }
    case Kind::record:
      return {H5Tcreate(H5T_OPAQUE, entry.element.component_bytes), H5Tclose};
    default:
      return {H5Tcopy(number_type(entry.element)), H5Tclose};
  }
}

Handle stored_space(const State::Entry& entry) {
  if (entry.element.kind == Kind::text) return text_space(entry.count);
  const hsize_t size[2] = {entry.count, entry.element.components};
  return {H5Screate_simple(entry.element.components == 1 ? 1 : 2, size, nullptr), H5Sclose};
}

// What a dataset holds: its element and the count of them; of text, its length.
std::pair<Element, std::size_t> described(const Handle& data) {
  const Handle type(H5Dget_type(data.get()), H5Tclose), space(H5Dget_space(data.get()), H5Sclose);
  const auto bytes = H5Tget_size(type.get());
  Element element{Kind::record, static_cast<std::uint32_t>(bytes), 1};
  switch (H5Tget_class(type.get())) {
    case H5T_STRING:
      return {{Kind::text, 1, 1}, H5Sget_simple_extent_type(space.get()) == H5S_NULL ? 0 : bytes};
    case H5T_ENUM:
      element.kind = Kind::boolean;
      break;
    case H5T_FLOAT:
      element.kind = Kind::real;
      break;
    case H5T_INTEGER:
      element.kind = H5Tget_sign(type.get()) == H5T_SGN_NONE ? Kind::unsigned_integer : Kind::signed_integer;
      break;
    default:
      break;
  }
  hsize_t size[2] = {0, 1};
  if (H5Sget_simple_extent_ndims(space.get()) <= 2) H5Sget_simple_extent_dims(space.get(), size, nullptr);
  element.components = static_cast<std::uint32_t>(size[1]);
  return {element, size[0]};
}

void write_entry(const Handle& group, const State::Entry& entry, const std::string& path) {
  const std::string name(entry.name);
  if (name.empty() || name.find('/') != std::string::npos || H5Lexists(group.get(), name.c_str(), H5P_DEFAULT) > 0)
    throw std::logic_error(fmt::format("\"{}\" cannot name one array of a state: names are unique, without slashes", name));
  const auto type = stored_type(entry), space = stored_space(entry);
  const Handle create(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_obj_track_times(create.get(), false);  // the same state makes the same file
  const Handle data(H5Dcreate2(group.get(), name.c_str(), type.get(), space.get(), H5P_DEFAULT, create.get(), H5P_DEFAULT),
                    H5Dclose);
  if (!data.valid()) fail_to_write(path);
  if (!entry.bytes.empty() && H5Dwrite(data.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, entry.bytes.data()) < 0)
    fail_to_write(path);
}

void read_entry(const Handle& group, const std::string& name, State& state, const std::string& path) {
  const Handle data(H5Dopen2(group.get(), name.c_str(), H5P_DEFAULT), H5Dclose);
  if (!data.valid()) fail(path, fmt::format("\"{}\" is not an array. {}", name, mend));
  const auto [element, count] = described(data);
  auto* const to = state.append(name, element, count);
  const Handle type(H5Dget_type(data.get()), H5Tclose);
  if (count && H5Dread(data.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, to) < 0)
    fail(path, fmt::format("\"{}\" cannot be read. {}", name, mend));
}

// ---- The origin, as attributes of the root ----

void write_attribute(const Handle& file, const char* name, const Handle& type, const Handle& space, const void* value,
                     const std::string& path) {
  const Handle attribute(H5Acreate2(file.get(), name, type.get(), space.get(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  if (!attribute.valid() || H5Awrite(attribute.get(), type.get(), value) < 0) fail_to_write(path);
}

void write_text(const Handle& file, const char* name, const std::string& value, const std::string& path) {
  write_attribute(file, name, text_type(value.size()), text_space(1), value.c_str(), path);
}

Handle open_attribute(const Handle& file, const char* name, const std::string& path) {
  Handle attribute(H5Aopen(file.get(), name, H5P_DEFAULT), H5Aclose);
  if (!attribute.valid()) fail(path, fmt::format("the checkpoint does not tell its {}. {}", name, mend));
  return attribute;
}

template <class T>
T read_number(const Handle& file, const char* name, hid_t type, const std::string& path) {
  T value{};
  if (H5Aread(open_attribute(file, name, path).get(), type, &value) < 0)
    fail(path, fmt::format("the {} of the checkpoint cannot be read. {}", name, mend));
  return value;
}

std::string read_text(const Handle& file, const char* name, const std::string& path) {
  const auto attribute = open_attribute(file, name, path);
  const Handle type(H5Aget_type(attribute.get()), H5Tclose);
  std::string value(H5Tget_size(type.get()), '\0');
  if (H5Tis_variable_str(type.get()) || H5Aread(attribute.get(), type.get(), value.data()) < 0)
    fail(path, fmt::format("the {} of the checkpoint cannot be read. {}", name, mend));
  return value.substr(0, value.find('\0'));
}

// ---- The file ----

void write_hdf5(const std::string& part, const State& state, const CheckpointInfo& info, const std::string& path) {
  const Handle create(H5Pcreate(H5P_FILE_CREATE), H5Pclose);
  H5Pset_userblock(create.get(), heading_bytes);
  Handle file(H5Fcreate(part.c_str(), H5F_ACC_TRUNC, create.get(), H5P_DEFAULT), H5Fclose);
  if (!file.valid()) fail_to_write(path);
  write_text(file, "program_version", info.program_version, path);
  write_text(file, "participant", info.participant, path);
  write_text(file, "case_hash", info.case_hash, path);
  const Handle real(H5Tcopy(H5T_NATIVE_DOUBLE), H5Tclose), integer(H5Tcopy(H5T_NATIVE_INT64), H5Tclose);
  write_attribute(file, "time", real, text_space(1), &info.time, path);
  write_attribute(file, "ticks", integer, text_space(1), &info.ticks, path);
  {
    const Handle order(H5Pcreate(H5P_GROUP_CREATE), H5Pclose);
    H5Pset_link_creation_order(order.get(), H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED);
    H5Pset_obj_track_times(order.get(), false);
    const Handle group(H5Gcreate2(file.get(), "state", H5P_DEFAULT, order.get(), H5P_DEFAULT), H5Gclose);
    if (!group.valid()) fail_to_write(path);
    for (std::size_t at = 0; at < state.bytes();) {
      const auto entry = state.entry(at);
      write_entry(group, entry, path);
      at = entry.next;
    }
  }
  if (!file.finish()) fail_to_write(path);
}

// Writes the heading and waits for the disk.
void seal(const std::string& part, const std::string& path) {
  const Descriptor file(part, O_RDWR);
  if (!file.valid()) fail_to_write(path, errno);
  const auto [bytes, crc] = measure(file);
  const auto text = heading(bytes, crc);
  if (pwrite(file.get(), text.data(), text.size(), 0) != static_cast<ssize_t>(text.size())) fail_to_write(path, errno);
  if (fsync(file.get()) != 0) fail_to_write(path, errno);
}

// A rename survives a power failure once its folder is on the disk too.
void synchronise_folder(const std::string& path) {
  const auto folder = std::filesystem::path(path).parent_path();
  const Descriptor opened(folder.empty() ? "." : folder.string(), O_RDONLY | O_DIRECTORY);
  if (opened.valid()) fsync(opened.get());
}

// Removes the unfinished file of a write that failed.
struct Unfinished {
  std::string path;
  ~Unfinished() {
    if (!path.empty()) std::remove(path.c_str());
  }
};

}  // namespace

void write_checkpoint(const std::string& path, const State& state, const CheckpointInfo& info) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  Unfinished part{path + ".part"};
  std::remove(part.path.c_str());  // of a run that was killed
  write_hdf5(part.path, state, info, path);
  seal(part.path, path);
  if (std::rename(part.path.c_str(), path.c_str()) != 0) fail_to_write(path, errno);
  part.path.clear();
  synchronise_folder(path);
}

std::pair<State, CheckpointInfo> read_checkpoint(const std::string& path) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  check_heading(path);  // before HDF5 sees it, which trusts what it reads
  const Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  const Handle group(file.valid() ? H5Gopen2(file.get(), "state", H5P_DEFAULT) : -1, H5Gclose);
  H5G_info_t links{};
  if (!group.valid() || H5Gget_info(group.get(), &links) < 0) fail(path, fmt::format("the checkpoint holds no state. {}", mend));

  CheckpointInfo info;
  info.program_version = read_text(file, "program_version", path);
  info.participant = read_text(file, "participant", path);
  info.case_hash = read_text(file, "case_hash", path);
  info.time = read_number<double>(file, "time", H5T_NATIVE_DOUBLE, path);
  info.ticks = read_number<std::int64_t>(file, "ticks", H5T_NATIVE_INT64, path);

  State state;
  state.set_source(path);
  state.reserve(std::filesystem::file_size(path));
  for (hsize_t k = 0; k < links.nlinks; ++k) {
    const auto name_of = [&](char* to, std::size_t size) {
      return H5Lget_name_by_idx(group.get(), ".", H5_INDEX_CRT_ORDER, H5_ITER_INC, k, to, size, H5P_DEFAULT);
    };
    std::string name(static_cast<std::size_t>(std::max<ssize_t>(name_of(nullptr, 0), 0)), '\0');
    name_of(name.data(), name.size() + 1);
    read_entry(group, name, state, path);
  }
  return {std::move(state), std::move(info)};
}

std::string hash_of(std::string_view text) {
  std::uint64_t hash = 0xcbf29ce484222325ULL;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3ULL;
  return fmt::format("{:016x}", hash);
}

void check_origin(const std::string& path, const CheckpointInfo& found, const CheckpointInfo& wanted) {
  if (found.participant != wanted.participant)
    fail(path, fmt::format("this is a checkpoint of the participant \"{}\", not of \"{}\". Give each participant its own.",
                           found.participant, wanted.participant));
  if (found.program_version != wanted.program_version)
    fail(path,
         fmt::format("the checkpoint was written by {} and this is {}. Resume it with the version that wrote it, or start the "
                     "run from its beginning.",
                     found.program_version, wanted.program_version));
  if (!found.case_hash.empty() && !wanted.case_hash.empty() && found.case_hash != wanted.case_hash)
    fail(path,
         fmt::format("the checkpoint was written for a case whose hash is {}; that of this case is {}. Resume with the case as "
                     "it was, or start the run from its beginning.",
                     found.case_hash, wanted.case_hash));
}

}  // namespace acopla::io
