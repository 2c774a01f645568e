#include "protocol/shared_memory.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstring>
#include <random>

namespace acopla::protocol {
namespace {

constexpr std::size_t page = 4096;

std::size_t size_of(int descriptor) {
  struct stat file {};
  return ::fstat(descriptor, &file) == 0 ? static_cast<std::size_t>(file.st_size) : 0;
}

// A memory that cannot shrink is never read past its end, which would end the process.
bool cannot_shrink(int descriptor) {
  const int seals = ::fcntl(descriptor, F_GET_SEALS);
  return seals >= 0 && (seals & F_SEAL_SHRINK);
}

}  // namespace

std::unique_ptr<SharedMemory> SharedMemory::create(std::uint64_t token) {
  std::unique_ptr<SharedMemory> memory(new SharedMemory(::memfd_create("acopla", MFD_CLOEXEC | MFD_ALLOW_SEALING)));
  if (memory->descriptor_ < 0 || ::fcntl(memory->descriptor_, F_ADD_SEALS, F_SEAL_SHRINK) != 0) return nullptr;
  memory->path_ = fmt::format("/proc/{}/fd/{}", ::getpid(), memory->descriptor_);
  if (!memory->room(0)) return nullptr;
  std::memcpy(memory->memory_, &token, sizeof token);
  return memory;
}

std::unique_ptr<SharedMemory> SharedMemory::open(const std::string& path, std::uint64_t token) {
  // Without waiting, should the path be another's pipe here.
  std::unique_ptr<SharedMemory> memory(new SharedMemory(::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NONBLOCK)));
  const int descriptor = memory->descriptor_;
  if (descriptor < 0 || !cannot_shrink(descriptor)) return nullptr;
  memory->path_ = path;
  const auto size = size_of(descriptor);
  if (size < arrays_begin || !memory->map(size)) return nullptr;
  return std::memcmp(memory->memory_, &token, sizeof token) == 0 ? std::move(memory) : nullptr;
}

SharedMemory::~SharedMemory() {
  if (memory_) ::munmap(memory_, mapped_);
  if (descriptor_ >= 0) ::close(descriptor_);
}

bool SharedMemory::map(std::size_t bytes) {
  void* memory = memory_ ? ::mremap(memory_, mapped_, bytes, MREMAP_MAYMOVE)
                         : ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor_, 0);
  if (memory == MAP_FAILED) return false;
  memory_ = static_cast<std::byte*>(memory);
  mapped_ = bytes;
  return true;
}

// What is mapped is there, as it cannot shrink: only beyond it the system is asked.
std::byte* SharedMemory::room(std::size_t bytes) {
  if (bytes > most) return nullptr;
  const std::size_t wanted = (arrays_begin + bytes + page - 1) / page * page;
  if (wanted > mapped_) {
    // Pages are asked for before they are touched: a machine that has none says so here, where frames can still be sent instead.
    if (wanted > size_of(descriptor_) && ::posix_fallocate(descriptor_, 0, static_cast<off_t>(wanted)) != 0) return nullptr;
    if (!map(wanted)) return nullptr;
  }
  return memory_ + arrays_begin;
}

std::span<const std::byte> SharedMemory::contents(std::uint64_t bytes) {
  if (bytes > mapped_)
    if (const auto size = size_of(descriptor_); size > mapped_ && !map(size))
      throw ProtocolError("shared memory cannot be mapped: there is no more address space");
  return {memory_, mapped_};
}

MemoryPair MemoryPair::create() {
  std::random_device random;
  const auto token = (std::uint64_t{random()} << 32) | random();
  return {SharedMemory::create(token), SharedMemory::create(token), token};
}

MemoryPair MemoryPair::open(const MemoryOffer& offer) {
  return {SharedMemory::open(offer.requests, offer.token), SharedMemory::open(offer.answers, offer.token), offer.token};
}

}  // namespace acopla::protocol
