// Error and run time of the DEM's verification cases over fractions of the critical step: one JSON object a line.
//   dem_accuracy sweep [SMALLEST]     every case at fractions 0.4, 0.2, … down to SMALLEST (default 0.003)
//   dem_accuracy restitution          every normal law and restitution at the default step
//   dem_accuracy rolling KEY…         x, v, ω r of reference cases of rolling at the default step, beside the reference
//   dem_accuracy collision            the elastic collision at the default step for every stiffness, worst of eight phases
#include <fmt/format.h>

#include <cstdlib>
#include <cstring>
#include <nlohmann/json.hpp>

#include "cases.h"

using namespace acopla::dem::verification;
using Json = nlohmann::json;

namespace {

constexpr double default_fraction = 0.2;

void print(const Json& row) {
  fmt::print("{}\n", row.dump());
  std::fflush(stdout);
}

void sweep(double smallest) {
  for (const auto& entry : cases())
    for (double fraction = 0.4; fraction >= 0.999 * smallest; fraction /= 2) {
      const auto outcome = entry.run(fraction);
      print({{"case", entry.name}, {"law", entry.law}, {"order", entry.order}, {"fraction", fraction}, {"step", outcome.step},
             {"steps", outcome.steps}, {"seconds", outcome.seconds}, {"error", outcome.worst()}});
    }
}

void restitutions() {
  for (const char* normal : {"linear", "hertz"})
    for (const bool paper : {false, true})
      for (const double e : {0.01, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0}) {
        if (paper && e == 1.0) continue;
        const auto outcome = restitution(default_fraction, normal, e, paper);
        print({{"normal", normal}, {"paper", paper}, {"restitution", e}, {"expected", outcome.figures.back().reference},
               {"mean", outcome.figures.back().value}, {"worst", outcome.worst("restitution")}, {"step", outcome.step}});
      }
}

Json figures(const Outcome& outcome) {
  Json all = Json::array();
  for (const auto& f : outcome.figures) all.push_back({{"name", f.name}, {"value", f.value}, {"reference", f.reference}, {"error", f.error()}});
  return all;
}

}  // namespace

int main(int count, char** words) {
  const std::string command = count > 1 ? words[1] : "";
  if (command == "sweep") sweep(count > 2 ? std::atof(words[2]) : 0.003);
  else if (command == "restitution") restitutions();
  else if (command == "rolling")
    for (int k = 2; k < count; ++k) print({{"case", words[k]}, {"figures", figures(rolling(default_fraction, words[k]))}});
  else if (command == "collision")
    for (std::size_t soft = 0; soft < 7; ++soft) print({{"soft", soft}, {"figures", figures(elastic_collision(default_fraction, soft))}});
  else {
    fmt::print(stderr, "usage: dem_accuracy sweep [SMALLEST] | restitution | rolling KEY… | collision\n");
    return 2;
  }
}
