// The table of a structure in a case file.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "fem/linear_solver.h"
#include "fem/material.h"
#include "fem/mesh.h"
#include "io/case_table.h"

namespace acopla::fem {

struct Settings {
  struct Fix {
    std::string group;  ///< physical surface
    std::array<bool, 3> directions;
  };

  std::string name;  ///< of the participant
  io::Table table;   ///< for messages about what shows later, e.g. a structure left free
  std::string mesh;  ///< absolute path
  int degree = 2;
  Material material;
  std::vector<Fix> fixes;
  SolverOptions solver;
  bool vtu = true;
  std::optional<double> every;  ///< time between pictures [s]; empty: the last window only
};

/// Reads and checks table `name` of the case, and the names of the mesh's physical groups.
/// @throws io::UserError
Settings read_settings(const io::Table& root, const std::string& name);

}  // namespace acopla::fem
