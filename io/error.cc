#include "io/error.h"

#include <fmt/format.h>

namespace acopla::io {

std::string Location::text() const {
  return line > 0 ? fmt::format("{}:{}:{}", file, line, column) : file;
}

}  // namespace acopla::io
