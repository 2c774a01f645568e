// What deal.II's exceptions say, in one line.
#pragma once

#include <exception>
#include <string>

namespace acopla::fem {

/// The sentence of a deal.II exception (its text frames it with where it was thrown from and which
/// condition failed), or the first line that says something of any other.
std::string first_line(const std::exception& error);

}  // namespace acopla::fem
