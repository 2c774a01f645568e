// Which contact model each pair of materials has.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "dem/kernel.h"

namespace acopla::dem {

class Laws;

/// The contact models of a scene. Pairs of materials that never meet have none.
struct KernelTable {
  std::shared_ptr<const Laws> laws;            ///< keeps the libraries open that the kernels come from
  std::size_t materials = 1;
  std::vector<std::uint16_t> group;            ///< [a · materials + b], symmetric
  std::vector<std::unique_ptr<Kernel>> kernel; ///< one a group; may be null
  const Kernel& of(std::size_t a, std::size_t b) const { return *kernel[group[a * materials + b]]; }
};

}  // namespace acopla::dem
