// Memory of large arrays.
#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "io/large_memory.h"

#ifdef __SANITIZE_ADDRESS__
/// Memory that is not to be had is a null pointer here too, as std::bad_alloc is expected of it below.
extern "C" const char* __asan_default_options() { return "allocator_may_return_null=1"; }
#endif

namespace acopla::io {
namespace {

TEST(LargeMemory, IsAlignedToALargePageAndMovesAsAnyOther) {
  for (const std::size_t bytes : {std::size_t{100}, std::size_t{3} << 20, (std::size_t{9} << 20) + 1}) {
    auto* memory = static_cast<char*>(allocate_large(bytes));
    ASSERT_NE(memory, nullptr);
    const bool large = bytes > std::size_t{4} << 20;
    EXPECT_TRUE(!large || reinterpret_cast<std::uintptr_t>(memory) % (std::size_t{2} << 20) == 0);
    memory[0] = 'a';
    memory[bytes - 1] = 'z';
    memory = static_cast<char*>(std::realloc(memory, 2 * bytes));  // as CHOLMOD does
    ASSERT_NE(memory, nullptr);
    EXPECT_EQ(memory[0], 'a');
    EXPECT_EQ(memory[bytes - 1], 'z');
    std::free(memory);
  }
  EXPECT_THROW(LargeMemory<double>().allocate(std::size_t{1} << 58), std::bad_alloc);
}

TEST(LargeMemory, OfContainersKeepsWhatGrows) {
  std::vector<double, LargeMemory<double>> values;
  for (int k = 0; k < 2'000'000; ++k) values.push_back(k);  // beyond what large pages are asked for
  const auto copy = values;
  for (int k = 0; k < 2'000'000; k += 999) EXPECT_EQ(copy[static_cast<std::size_t>(k)], k);
}

}  // namespace
}  // namespace acopla::io
