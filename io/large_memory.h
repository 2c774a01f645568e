// Memory of arrays of many megabytes, in large pages where the system has them.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <new>

namespace acopla::io {

/// `bytes` of memory not set to anything, for std::free and std::realloc; nullptr when there is none. From some megabytes on it asks
/// the kernel for pages of 2 MiB: a factor of 60 MB is then touched for the first time in 30 page faults instead of 15,000, which cost
/// a virtual machine as much as the factorisation's arithmetic.
void* allocate_large(std::size_t bytes);

/// An allocator of that memory for containers.
template <class T>
struct LargeMemory {
  using value_type = T;
  LargeMemory() = default;
  template <class U>
  LargeMemory(const LargeMemory<U>&) {}
  T* allocate(std::size_t count) {
    auto* memory = static_cast<T*>(allocate_large(count * sizeof(T)));
    if (!memory) throw std::bad_alloc();
    return memory;
  }
  void deallocate(T* memory, std::size_t) { std::free(memory); }
  bool operator==(const LargeMemory&) const = default;
};

}  // namespace acopla::io
