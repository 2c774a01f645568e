// The table of a structure in a case file.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "fem/dynamics.h"
#include "fem/formulation.h"
#include "fem/foundation.h"
#include "fem/linear_solver.h"
#include "fem/loads.h"
#include "fem/mesh.h"
#include "fem/part.h"
#include "fem/shapes.h"
#include "io/case_table.h"

namespace acopla::fem {

struct Settings {
  Settings(std::string participant, io::Table of_case)
      : name(std::move(participant)), table(std::move(of_case)) {}

  /// A part held in some directions, or moved.
  struct Support {
    io::Table table;
    Part part;
    std::array<bool, 3> directions;
    bool moves = false;
    Vec3 value = Vec3::Zero();  ///< displacement [m], velocity [m/s] or acceleration [m/s²] at amplitude 1
    MotionHistory history;
  };
  /// A material and the group of cells that it fills; no group: all cells.
  struct MaterialOfPart {
    io::Table table;
    std::string group;
    Material material;
  };
  /// A node whose motion, and stress where asked for, is reported of every window.
  struct Probe {
    io::Table table;
    std::string name;
    Vec3 at;  ///< [m]; the nearest node is taken
    bool stress = false;
  };
  /// An axis about which the torque of the supports and of the loads is reported of every window.
  struct Torque {
    std::string name;
    Vec3 about = Vec3::Zero();  ///< a point of the axis [m]
    Vec3 axis = Vec3::UnitZ();  ///< of length 1
  };
  /// Of a dynamic analysis.
  struct Motion {
    Scheme scheme;
    Rayleigh damping;
    std::optional<double> step;  ///< longest step [s]; empty: one a window
    bool from_equilibrium =
        true;  ///< under weight and loads at t = 0; otherwise from rest without strain
  };

  std::string name;  ///< of the participant
  io::Table table;   ///< for messages about what shows later, e.g. a structure left free
  int dimension = 3;
  Formulation formulation;
  MeshChoice mesh;
  int degree = 2;
  std::vector<MaterialOfPart> materials;
  std::vector<Support> supports;
  std::vector<Foundation> foundations;  ///< of a static structure
  std::vector<Load> loads;
  std::optional<Motion> motion;  ///< empty: static
  SolverOptions solver;
  bool vtu = true;
  bool hdf5 = false;            ///< write the nodal fields of every picture into one file as well
  std::optional<double> every;  ///< time between pictures [s]; empty: the last window only
  bool von_mises = true;        ///< report the largest von Mises stress of every window
  std::vector<Probe> probes;
  std::vector<Torque> torques;
  bool reactions = false;       ///< report the reaction of each support
  std::size_t frequencies = 0;  ///< lowest natural frequencies to report at the end
  bool condition = false;       ///< report the condition number of the matrix that is solved with, at the end
  int processes = 1;            ///< that `acopla run` starts; who else starts them, mpirun, counts itself
  bool energy = false;          ///< report the energy balance of a structure in motion
};

/// Reads and checks table `name` of the case, and the names of the mesh's physical groups.
/// @throws io::UserError
Settings read_settings(const io::Table& root, const std::string& name);

}  // namespace acopla::fem
