#include "io/large_memory.h"

#include <sys/mman.h>

namespace acopla::io {
namespace {

constexpr std::size_t page = std::size_t{2} << 20;
/// Below this the rest of the last page would weigh too much.
constexpr std::size_t least = 2 * page;

}  // namespace

void* allocate_large(std::size_t bytes) {
  if (bytes < least) return std::malloc(bytes);
  const std::size_t whole = (bytes + page - 1) / page * page;
  void* memory = std::aligned_alloc(page, whole);
  // A kernel that has no such pages keeps its small ones.
  if (memory) madvise(memory, whole, MADV_HUGEPAGE);
  return memory;
}

}  // namespace acopla::io
