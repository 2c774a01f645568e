// Error and run time of the DEM's verification cases over fractions of the critical step: one JSON object a line.
//   dem_accuracy sweep [SMALLEST]     every case at fractions 0.4, 0.2, … down to SMALLEST (default 0.003)
//   dem_accuracy restitution          every normal law and restitution at the default step
//   dem_accuracy table                every case of the verification table at 0.01 of critical, beside its reference
//   dem_accuracy trace KEY END        x, v, ω, couple against time of a reference case of rolling, at the default step
#include <fmt/format.h>

#include <cstdlib>
#include <cstring>
#include <nlohmann/json.hpp>

#include "cases.h"
#include "setup.h"

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

void table() {
  const double fraction = 0.01;
  const auto show = [](const std::string& name, const std::string& key, const Outcome& outcome) {
    Json all = Json::array();
    for (const auto& f : outcome.figures) all.push_back({{"name", f.name}, {"value", f.value}, {"reference", f.reference}, {"error", f.error()}});
    print({{"case", name}, {"key", key}, {"worst", outcome.worst()}, {"figures", all}});
  };
  for (std::size_t soft = 0; soft < 7; ++soft) show("collision", fmt::format("{}", soft), elastic_collision(fraction, soft));
  for (const char* key : {"disc_engine_stiffness_x1", "disc_engine_stiffness_x100", "sphere_engine_stiffness_x1", "sphere_engine_stiffness_x100"})
    show("struck", key, struck_ball(fraction, key));
  for (const char* table_of : {"rolling_consistent", "rolling_printed"}) {
    const auto& values = reference()[table_of]["values"];
    for (const auto& [key, value] : (std::string(table_of) == "rolling_printed" ? values : values["soft"]).items())
      if (key.find("engine") != std::string::npos) show(table_of, key, rolling(fraction, key));
  }
  for (const auto& [key, value] : reference()["incline"]["values"].items()) show("incline", key, incline(fraction, key));
  for (const double zeta : {0.0, 0.1, 0.5}) show("vibration", fmt::format("{:g}", zeta), free_vibration(fraction, zeta));
  for (const char* law : {"linear_1e+04", "linear_1e+06", "hertz_1.33e+06", "hertz_1.33e+08"})
    for (const double e : {1.0, 0.8, 0.5, 0.3}) show("bounce", fmt::format("{} e {:g}", law, e), bouncing_ball(fraction, law, e));
  show("hertz", "", hertz_head_on(fraction));
  for (const double e : {1.0, 0.5})
    for (const double tangential : {8.0, 1.0, 0.2}) show("oblique", fmt::format("e {:g} slip {:g}", e, tangential), oblique_impact(fraction, e, tangential));
  for (const char* key : {"torsion_printed", "rolling_frictionless_floor_printed"}) show("spin", key, spin_decay(fraction, key));
  for (const char* law : {"linear", "hertz"}) {
    show("column", "five_equal", column(0.2, fmt::format("column_five_equal_{}", law), {0.01, 0.01, 0.01, 0.01, 0.01}));
    show("column", "ratio_10", column(0.2, fmt::format("column_ratio_10_{}", law), {0.01, 0.001, 0.01}));
    show("column", "ratio_100", column(0.2, fmt::format("column_ratio_100_{}", law), {0.01, 0.0001, 0.01}));
    for (const char* key : {"row_ratio_10", "row_ratio_100"}) show("row", key, squeezed_row(0.2, key, law));
  }
}

void trace(const std::string& key, double end) {
  for (const auto& s : rolling_trace(default_fraction, key, end, 400))
    print({{"time", s.time}, {"x", s.x}, {"v", s.v}, {"spin", s.spin}, {"couple", s.couple}});
}

}  // namespace

int main(int count, char** words) {
  const std::string command = count > 1 ? words[1] : "";
  if (command == "sweep") sweep(count > 2 ? std::atof(words[2]) : 0.003);
  else if (command == "restitution") restitutions();
  else if (command == "table") table();
  else if (command == "trace" && count == 4) trace(words[2], std::atof(words[3]));
  else {
    fmt::print(stderr, "usage: dem_accuracy sweep [SMALLEST] | restitution | table | trace KEY END\n");
    return 2;
  }
}
