// The four kinds of cells, for parameterised tests.
#pragma once

#include <gtest/gtest.h>

#include <ostream>
#include <string>

namespace acopla::fem::test {

struct CellKind {
  bool tetrahedra;
  int degree;
};

/// "Q2" for hexahedra, "P2" for tetrahedra of second order.
inline std::string name_of(const CellKind& kind) {
  return std::string(kind.tetrahedra ? "P" : "Q").append(std::to_string(kind.degree));
}
inline void PrintTo(const CellKind& kind, std::ostream* out) { *out << name_of(kind); }
inline std::string name_of_kind(const testing::TestParamInfo<CellKind>& info) {
  return name_of(info.param);
}

inline auto all_kinds() {
  return testing::Values(CellKind{false, 1}, CellKind{false, 2}, CellKind{true, 1},
                         CellKind{true, 2});
}

}  // namespace acopla::fem::test
