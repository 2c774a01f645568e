// How fast the kernel of a library of laws is beside the built-in one of the same law: law_speed LIBRARY, where LIBRARY restates the linear
// laws under other names (tests/plugins/restated_linear.cc). Both run on the same contacts in turn; medians and their ratio.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <random>
#include <stdexcept>

#include "dem/laws.h"

namespace {

using namespace acopla::dem;

// A settled bed in small: spheres on a jittered lattice, each in touch with its neighbours along the axes.
struct Bed {
  Particles particles;
  PairContacts contacts;

  explicit Bed(std::uint32_t side) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> jitter(-1, 1);
    constexpr double radius = 0.005;
    for (std::uint32_t z = 0; z < side; ++z)
      for (std::uint32_t y = 0; y < side; ++y)
        for (std::uint32_t x = 0; x < side; ++x) {
          const auto any = [&] { return Vec3(jitter(random), jitter(random), jitter(random)); };
          const Vec3 at = 1.98 * radius * Vec3(x, y, z) + 0.01 * radius * any(), velocity = 0.01 * any(), spin = any();
          particles.add(at, radius, 2500, 0, velocity, spin);
        }
    const auto place = [&](std::uint32_t x, std::uint32_t y, std::uint32_t z) { return (z * side + y) * side + x; };
    for (std::uint32_t z = 0; z < side; ++z)
      for (std::uint32_t y = 0; y < side; ++y)
        for (std::uint32_t x = 0; x < side; ++x)
          for (const auto j : {x + 1 < side ? place(x + 1, y, z) : 0, y + 1 < side ? place(x, y + 1, z) : 0, z + 1 < side ? place(x, y, z + 1) : 0})
            if (j) {
              contacts.i.push_back(place(x, y, z));
              contacts.j.push_back(j);
            }
    contacts.size = contacts.i.size();
    while (contacts.i.size() % lanes) {
      contacts.i.push_back(contacts.i.back());
      contacts.j.push_back(contacts.j.back());
    }
  }
};

double seconds(const Kernel& kernel, Bed& bed) {
  Exports none;
  const auto begin = std::chrono::steady_clock::now();
  kernel.pairs(bed.contacts, bed.particles, none, 1e-9, nullptr);
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    fmt::print(stderr, "law_speed LIBRARY\n");
    return 2;
  }
  auto laws = Laws::built_in();
  try {
    laws.load(argv[1]);
  } catch (const std::runtime_error& error) {
    fmt::print(stderr, "{} {}\n", argv[1], error.what());
    return 2;
  }
  PairProperties pair;
  pair.stiffness = 1e5;
  pair.damping_ratio = 0.2;
  pair.friction = 0.3;
  pair.normal_values = {1e5};
  pair.tangential_values = {3.5};
  pair.laws = {"linear", "linear_slider", "none"};
  const auto own = laws.make(pair, 3);
  pair.laws = {"restated_linear", "restated_slider", "none"};
  const auto theirs = laws.make(pair, 3);

  Bed bed(24);
  bed.contacts.history.assign(bed.contacts.i.size() / lanes * own->history_size(), HistoryLane{});
  std::vector<double> built_in, library;
  for (int n = 0; n < 1001; ++n) {
    // In turn, and each one first as often as the other: what else the machine does meets both.
    const double first = seconds(n % 2 ? *own : *theirs, bed), second = seconds(n % 2 ? *theirs : *own, bed);
    built_in.push_back(n % 2 ? first : second);
    library.push_back(n % 2 ? second : first);
  }
  const double a = median(built_in) / static_cast<double>(bed.contacts.size) * 1e9, b = median(library) / static_cast<double>(bed.contacts.size) * 1e9;
  fmt::print("contacts {}\nbuilt_in_ns {:.3f}\nlibrary_ns {:.3f}\nratio {:.4f}\n", bed.contacts.size, a, b, b / a);
}
