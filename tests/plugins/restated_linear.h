// Linear and LinearSlider said again under other names: a library's laws must do to the last bit what the built-in ones do.
#pragma once

#include "dem/laws.h"

namespace restated {

using acopla::dem::Field;
using acopla::dem::PairProperties;

struct Linear : acopla::dem::Linear {
  static constexpr const char* name = "restated_linear";
  static constexpr std::array fields{Field{"stiffness", "N/m", acopla::io::positive, Field::required, "normal spring"}};
  static Parameters from(const PairProperties& pair) { return {pair.normal_values[0], pair.damping_ratio}; }
};

struct Slider : acopla::dem::LinearSlider {
  static constexpr const char* name = "restated_slider";
};

}  // namespace restated
