// A scene in LIGGGHTS's own words.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "dem/scene.h"

namespace acopla::liggghts {

/// What every process needs to make the scene.
struct Deck {
  std::string commands;  ///< one a line, the data and mesh files included that they name
  struct Mesh {
    std::string name;                                     ///< of the wall; its fix is mesh0, mesh1, …: LIGGGHTS allows names fewer letters
    std::vector<dem::Vec3> points;                        ///< [m]
    std::vector<std::array<std::uint32_t, 3>> triangles;  ///< numbered as LIGGGHTS numbers them
  };
  std::vector<Mesh> meshes;
  std::vector<std::string> planes;  ///< names of walls; plane0, plane1, …
  std::uint64_t particles = 0;
};

/// Refuses what LIGGGHTS has no equal for. @throws io::UserError, located
void check(const dem::Scene& scene, const io::Table& table);

/// The commands without those that name files: laws, materials, walls and gravity, as `acopla explain` shows them.
std::string laws_in_words(const dem::Scene& scene);

/// Writes the particles (NAME.data), the meshes (NAME_WALL.stl) and the commands (NAME.in) into a folder that exists.
/// @param particles  all of them
Deck write_deck(const dem::Scene& scene, const dem::Particles& particles, const dem::WallSet& walls, const std::string& folder);

}  // namespace acopla::liggghts
