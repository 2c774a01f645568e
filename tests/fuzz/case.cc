// libFuzzer target: any text at all as a case file must end in a case, or in a located UserError; and `canonical`, which checkpoints compare, must
// not fail on what was read. ./acopla fuzz SECONDS builds it with clang's sanitizers and runs it.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "coupler/case.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    acopla::coupler::read_case(acopla::io::Table::from_text({reinterpret_cast<const char*>(data), size}, "case.toml"));
  } catch (const acopla::io::UserError&) {
  }
  return 0;
}
